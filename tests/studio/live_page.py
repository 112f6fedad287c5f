"""The live page, opened."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def opened(chromium: Any, url: str) -> Iterator[Any]:
    """The live page; a word of the browser's console, or another host, fails the test."""
    context = chromium.new_context(viewport={"width": 1280, "height": 900})
    context.set_default_timeout(200_000)  # a busy machine is no failure
    page = context.new_page()
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda m: said.append(m.text) if " 422 " not in m.text else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(url)
    try:
        yield page
    finally:
        context.close()
    assert said == []
    assert {address.split("/")[2] for address in asked} == {url.split("/")[2]}
