"""Words that hold the place of a source are open points; what names one is not."""

from __future__ import annotations

import pytest

from fsoe_net.timing.elements import names_a_revision, names_a_source

OPEN = (
    "", " ", "-", "?", "...", "0", "1", "4711", "x", "m", "xxx", "tbd", "T.B.D.", "t b d",
    "TBC", "tba", "TODO", "todo: read the manual", "FIXME", "n/a", "N.A.", "n. a. in the manual",
    "unknown", "Unknown!", "manual of unknown revision", "guess", "guessed", "my best guess",
    "a rough estimate", "Estimated.", "assumed", "our own assumption", "worst case",
    "rule of thumb", "from experience", "engineering judgement", "none", "no source", "no idea",
    "later", "open", "manual 3.0?",
    "tbd by the maker", "manual (TBC)", "to be determined", "to be confirmed by Beckhoff",
    "not known", "not yet available", "not stated in the manual", "Not Applicable", "dummy value",
    "placeholder", "\uff54\uff42\uff44", "typical value", "to be checked: EL1904 manual",
)  # fmt: skip
NAMED = (
    "manual", "sheet", "EL1904 manual 3.0.0, page 46", "data sheet of the maker",
    "ISO 13849-1, table C.1", "B10d estimated as in ISO 13849-1, annex C", "measured by A. Meier",
    "certificate TÜV Süd 2019", "Betriebsanleitung 2.1", "取扱説明書", "manual B/C, T 2",
    "typical value of the Siemens catalogue", "assumed in the risk assessment RA-7", "example",
)  # fmt: skip


@pytest.mark.shows("R28")
@pytest.mark.parametrize("text", OPEN)
def test_a_placeholder_is_not_a_source(text: str) -> None:
    assert not names_a_source(text)


@pytest.mark.shows("R28")
@pytest.mark.parametrize("text", NAMED)
def test_a_source_names_a_document(text: str) -> None:
    assert names_a_source(text)


@pytest.mark.parametrize(
    ("text", "named"),
    [("3.0", True), ("B", True), ("1", True), ("0", False), ("", False), ("3.0?", False),
     ("tbd", False), ("-", False), ("to be read", False), ("unknown", False)],
)  # fmt: skip
def test_a_manual_may_be_named_by_its_revision(text: str, named: bool) -> None:
    assert names_a_revision(text) is named
