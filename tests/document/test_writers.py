"""What the writers of pages do with texts of any origin, and with parts that no report has."""

from __future__ import annotations

import re
from importlib import resources

import pytest
from document.pages import ALL

from fsoe_net.document.model import MARKS, Document, Lines, code, strong, words
from fsoe_net.document.write_html import document_html
from fsoe_net.document.write_json import section_json
from fsoe_net.document.write_markdown import document_markdown

MARKDOWN = """\
# title \\\\u001b\\[31m



**✖ not \\\\u202eso**

first second\\\\u0007

- one two three four

## Section

### Heading

| name | time (a) | why |
| --- | --: | --- |
| a<br>b | 1 ms | because it is so, and not otherwise, whatever anybody says |
| \\\\u009b2J | 12 |  |

of the machine

Sources: a s

    $ a command that stays on its line, however narrow the terminal is

*Picture: picture.* what it shows

none
"""


def test_a_document_as_markdown():
    assert document_markdown(ALL) == MARKDOWN


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("# no heading", "\\# no heading"),
        ("- no list", "\\- no list"),
        ("1. no list", "1\\. no list"),
        ("> no quotation", "\\> no quotation"),
        ("<b>&amp;`*_[", "\\<b>\\&amp;\\`\\*\\_\\["),
        ("two\nlines", "two lines"),
        ("\x1b[2J\u202e", "\\\\u001b\\[2J\\\\u202e"),
    ],
)
def test_words_in_markdown_are_words(text: str, shown: str):
    assert document_markdown(Document(title="t", lead=(words(text),))).splitlines()[4] == shown


@pytest.mark.parametrize(("text", "shown"), [("a`b", "`` a`b ``"), ("``", "``` `` ```")])
def test_code_in_markdown_keeps_its_backticks(text: str, shown: str):
    assert document_markdown(Document(lead=(words(code(text)),))).splitlines()[4] == shown


def test_a_page_has_no_markup_of_others():
    evil = "<script>\x1b\u202e&"
    page = document_html(
        Document(title=evil, subtitle=evil, seal=evil, foot=evil, lead=(Lines((evil,)),))
    )
    assert "<script>" not in page
    assert not {"\x1b", "\u202e"} & set(page)
    assert "<pre>&lt;script&gt;\\u001b\\u202e&amp;</pre>" in page


def test_reports_and_studio_have_the_same_signs():
    html_js = resources.files("fsoe_net.studio") / "assets" / "html.js"
    signs = html_js.read_text("utf-8").partition("SIGNS = {")[2].partition("}")[0]
    assert dict(re.findall(r'(\w+): "(.)"', signs)) == {k.value: v for k, v in MARKS.items()}


def test_lines_in_json_stay_lines():
    (section,) = ALL.sections
    parts = section_json(1, section)["parts"]
    assert [p["type"] for p in parts] == ["heading", "table", "lines", "picture", "table"]
    assert parts[2]["lines"] == list(section.parts[2].lines)


def test_a_space_at_the_end_of_strong_words_stays_outside_of_the_marks():
    page = document_markdown(Document(title="t", lead=(words(strong("Tests: "), "none"),)))
    assert page.splitlines()[-1] == "**Tests:** none"
