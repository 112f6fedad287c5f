"""A real browser, and what the tests of the page need beside the library."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
_LEVELS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
REQUIRED = "browser" in os.environ.get("FSN_REQUIRE", "").split(",")


def needed(module: str, extra: str) -> ModuleType:
    """Return a module; absent it skips, but fails where FSN_REQUIRE names ``browser``."""
    if REQUIRED:
        return importlib.import_module(module)
    return pytest.importorskip(module, reason=f"needs pip install -e '.[{extra}]'")


def available() -> ModuleType:
    """Return what drives the browser; absent it skips, as `needed`."""
    if CHROMIUM is None and not REQUIRED:
        pytest.skip("needs Chromium (package chromium of Debian)")
    return needed("playwright.sync_api", "browser")


@contextlib.contextmanager
def launched() -> Iterator[Any]:
    """Run the browser until the block ends."""
    with available().sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Give the tests of a module one browser; a page of it is their own."""
    with launched() as browser:
        yield browser


# The text as the editor holds it: the page draws only the lines in sight.
_LOADED = 'async () => { window.codemirror = await import("/assets/vendor/codemirror-view.js"); }'
_TEXT = """codemirror.EditorView.findFromDOM(
    document.querySelector(".editor").shadowRoot).state.doc.toString()"""


def text_of(page: Any) -> str:
    """Return the text in the editor."""
    page.locator(".cm-content").wait_for()
    page.evaluate(_LOADED)
    text = page.evaluate(_TEXT)
    assert isinstance(text, str)
    return text


def wait_for_text(page: Any, test: str, arg: str) -> None:
    """Wait until a condition in JavaScript holds for ``text`` and ``arg``."""
    page.locator(".cm-content").wait_for()
    page.evaluate(_LOADED)
    page.wait_for_function(f"arg => {{ const text = {_TEXT}; return {test}; }}", arg=arg)


def write_text(page: Any, text: str) -> None:
    """Replace the text in the editor, as a person pastes it."""
    page.locator(".cm-content").focus()
    page.keyboard.press("Control+a")
    page.locator(".cm-content").evaluate(
        """(content, text) => {
          const data = new DataTransfer();
          data.setData("text/plain", text);
          content.dispatchEvent(new ClipboardEvent("paste", {
            clipboardData: data, bubbles: true, cancelable: true }));
        }""",
        text,
    )


def accessible(page: Any, *schemes: str) -> None:
    """Demand WCAG 2.2, level AA, of all that is in sight, as far as a program can tell.

    Args:
        page: Of the browser.
        schemes: ``light``, ``dark``, which are switched to; none: as it is.
    """
    axe = needed("axe_playwright_python.sync_playwright", "browser")
    options = {"runOnly": _LEVELS, "iframes": False}
    for scheme in schemes or (None,):
        if scheme is not None:
            page.emulate_media(color_scheme=scheme)
        found = axe.Axe().run(page, options=options).response["violations"]
        assert [(row["id"], [node["html"] for node in row["nodes"]]) for row in found] == []
