"""The pages of the findings."""

from pathlib import Path

import pytest

from fsoe_net.diag.catalogue import CATALOGUE

PAGES = Path(__file__).parents[2] / "docs" / "diagnostics"


@pytest.mark.parametrize("code", CATALOGUE)
def test_the_page_of_a_code_has_its_title_reason_and_fix(code: str):
    text = (PAGES / f"{code}.md").read_text("utf-8")
    title, _, rest = text.partition("\n")
    assert title.replace("`", "") == f"# {code}: {CATALOGUE[code].title}".replace("`", "")
    what, reason, rest = rest.partition("**Why it matters.** ")
    why, fix, rest = rest.partition("**Fix.** ")
    assert reason
    assert fix
    assert all(part.strip() for part in (what, why, rest))


def test_there_is_not_a_page_of_another_code():
    assert {path.stem for path in PAGES.glob("FSN*.md")} == set(CATALOGUE)
