"""The specimen in docs/extra fits this version; scripts/specimen --check compares all of it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from networks import EXAMPLES
from report.made import inputs_of
from studio.browser import accessible, chromium  # noqa: F401 - a fixture

from fsoe_net.document.style import STYLE
from fsoe_net.report.compose import compose_report
from fsoe_net.report.formats import render_report
from fsoe_net.version import __version__

PATH = Path(__file__).parents[2] / "docs" / "extra" / "specimen.html"
PAGE = PATH.read_text("utf-8")
AGAIN = "the report has changed: run scripts/specimen, and look at docs/extra/specimen.html"


def _form(page: str) -> list[str]:
    """Return the sections with their headings and the heads of their tables."""
    return re.findall(r'<section id="\w+"|<h[23]>.*?</h[23]>|<th\b.*?</th>', page)


def test_the_specimen_is_of_this_version_and_in_the_form_of_today():
    assert f"fsoe-net {__version__}" in PAGE, AGAIN
    assert STYLE in PAGE, AGAIN
    sections = [
        s.key for s in compose_report(inputs_of(EXAMPLES / "estop" / "network.yaml")).sections
    ]
    assert re.findall(r'<section id="(\w+)"', PAGE) == sections, AGAIN
    today = set(_form(render_report(inputs_of(EXAMPLES / "estop" / "network.yaml"), "html")))
    # Without tests and signatures a report has fewer tables; each of them is in the specimen.
    missing = {row for row in today if re.sub(r"<sup>.*?</sup>", "", row) not in
               re.sub(r"<sup>.*?</sup>", "", PAGE)}  # fmt: skip
    assert missing == set(), AGAIN


def test_the_specimen_has_passed_and_names_that_it_is_invented():
    banner = re.sub(
        r"<[^>]*>", "", PAGE.partition('<p class="banner clear">')[2].partition("</p>")[0]
    )
    assert re.search(
        r"4 of 4 test steps as expected · signed by .* and .* · files: no findings", banner
    )
    assert "<h1>Specimen, an invented press with an e-stop</h1>" in PAGE
    assert "specimen, nothing was measured" in PAGE
    assert "evidence and no certificate" in PAGE


def test_the_specimen_is_accessible_in_both_themes(chromium: Any):  # noqa: F811
    page = chromium.new_page(viewport={"width": 1280, "height": 800})
    page.goto(PATH.as_uri())
    accessible(page, "light", "dark")
    page.close()


def test_the_specimen_has_no_private_key_and_no_path_of_a_machine():
    for word in ("PRIVATE KEY", "/tmp/", "/home/", "/root/", "<script"):
        assert word not in PAGE
