"""The search of the docs and its first page: what a reader finds first."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from networks import EXAMPLES
from studio.browser import chromium  # noqa: F401 - a fixture

from fsoe_net.formats.own.network import load_network

DOCS = Path(__file__).parents[1] / "docs"
SCORER = DOCS / "site" / "scorer.js"
TITLE = 15  # what Sphinx gives a page whose title is the searched word
PAGES = ["diagnostics/FSN301", "development/testing", "reference/cli", "howto/scan", "index"]


@pytest.fixture(scope="module")
def generated() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_generated", DOCS / "generated.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def ranked(browser: Any, query: str) -> list[str]:
    """Return the pages in the order of a search in which they score the same."""
    page = browser.new_page()
    page.route("**/*", lambda route: route.fulfill(content_type="text/html", body="<p>docs"))
    page.goto(f"http://docs.invalid/search.html?q={query}")
    page.add_script_tag(content=SCORER.read_text("utf-8"))
    scores = page.evaluate(
        f"{json.dumps(PAGES)}.map((name) => Scorer.score([name, '', '', null, {TITLE}, name]))"
    )
    page.close()
    order = sorted(range(len(PAGES)), key=lambda n: -scores[n])
    return [PAGES[n] for n in order]


def test_howtos_come_before_findings(chromium: Any):  # noqa: F811
    found = ranked(chromium, "scan+frame")
    assert found[0] == "howto/scan"
    assert found[-1] == "diagnostics/FSN301"


def test_a_code_finds_its_own_page(chromium: Any):  # noqa: F811
    assert ranked(chromium, "fsn301") == PAGES


def test_the_gallery_draws_each_example_with_a_report(generated: ModuleType):
    text = generated.fill_in("index", (DOCS / "index.md").read_text("utf-8"))
    assert "<!-- gallery -->" not in text
    for name, page in generated.EXAMPLES.items():
        network = load_network([EXAMPLES / name / "network.yaml"]).network
        assert network is not None
        card = text.partition(f"`examples/{name}`")[0].rpartition("{container} card\n")[2]
        assert all(sub.name in card for sub in network.subdevices)
        assert (DOCS / page).is_file()


def test_each_reader_has_a_card_whose_pages_exist():
    text = (DOCS / "index.md").read_text("utf-8")
    cards = re.findall(r"\{container\} card\n\*\*(.*?)\*\*\n(.*?)::::", text, flags=re.S)
    assert {title for title, _ in cards} >= {
        "Integrator", "Safety engineer", "Device maker", "ROS user", "Developer"
    }  # fmt: skip
    for _, links in cards:
        for page in re.findall(r"\]\((\w.*?)(?:#.*?)?\)", links):
            assert (DOCS / page).is_file()
    assert (DOCS / "extra" / "specimen.html").is_file()
    assert 'href="specimen.html"' in text


def test_our_drawings_follow_the_theme_of_the_page(generated: ModuleType):
    style = generated.picture_style()
    rules = re.findall(r"([^{};]*)\{([^{}]*--back:[^{}]*)", style)
    backs = [re.search(r"--back:([^;]*)", body)[1] for _, body in rules]
    assert len(backs) == 3
    assert backs[0] != backs[1] == backs[2]
    assert style.count("{") == style.count("}")
