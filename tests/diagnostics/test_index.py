"""The page that lists the findings."""

import re
from pathlib import Path

from fsoe_net.diag.catalogue import CATALOGUE

PAGE = Path(__file__).parents[2] / "docs" / "diagnostics" / "index.md"


def test_the_page_lists_every_finding_with_its_level_and_title():
    text = PAGE.read_text("utf-8")
    rows = re.findall(r"^\| \[(FSN\d+)\]\(\1\.md\) \| (\w+) \| (.*) \|$", text, re.MULTILINE)
    assert {code: (level, title.replace("`", "")) for code, level, title in rows} == {
        code: (row.severity, row.title) for code, row in CATALOGUE.items()
    }
    assert re.findall(r"^FSN\d+$", text, re.MULTILINE) == sorted(CATALOGUE)
