"""`docs/howto/recover.md`: every cause an incident can name, every reset code, every link."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fsoe_net.incident.causes_table import CAUSES

HOWTO = Path(__file__).parents[2] / "docs" / "howto"
PAGE = (HOWTO / "recover.md").read_text("utf-8")


@pytest.mark.parametrize("key", sorted(CAUSES))
def test_every_cause_is_on_the_page(key: str) -> None:
    assert f"`{key}`" in PAGE


def test_every_reset_code_is_on_the_page() -> None:
    table = PAGE.partition("## By reset code")[2].partition("## ")[0]
    codes = re.findall(r"^\| ([\d].*?) \|", table, re.MULTILINE)
    assert codes == ["0", "1, 2", "3", "4", "5", "6", "7", "8 to 11, from 0x80 on"]


def test_every_link_leads_somewhere() -> None:
    heads = {
        re.sub(r"[^\w -]", "", head).strip().lower().replace(" ", "-")
        for head in re.findall(r"^## (.*)$", PAGE, re.MULTILINE)
    }
    for target in re.findall(r"\]\(([^)]+)\)", PAGE):
        if target.startswith("#"):
            assert target[1:] in heads
        else:
            assert (HOWTO / target.partition("#")[0]).is_file()
