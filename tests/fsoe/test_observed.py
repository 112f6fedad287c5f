"""The enums of what is observed: numbers and words of the C core, words of documents and people."""

from __future__ import annotations

import json
import re

import pytest
from live.support import ROOT

from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict, FrameDirection

CORE = ROOT / "master_core"


def core_numbers(prefix: str) -> list[str]:
    """Return the members of an enum of the C core, in the order of their numbers."""
    text = (CORE / "include" / "fsn" / "monitor.h").read_text("utf-8")
    numbers = {int(n): name for name, n in re.findall(rf"\b{prefix}_([A-Z_]+) = (\d+)", text)}
    return [numbers[n] for n in range(len(numbers))]


@pytest.mark.parametrize(
    ("prefix", "members"), [("FSN_OBSERVED", ConnectionState), ("FSN_VERDICT", CrcVerdict)]
)
def test_members_have_the_numbers_of_the_core(
    prefix: str, members: type[ConnectionState] | type[CrcVerdict]
) -> None:
    assert [member.name for member in members] == core_numbers(prefix)


def test_event_words_are_those_of_the_core() -> None:
    text = (CORE / "src" / "control" / "base" / "names.c").read_text("utf-8")
    words = re.findall(r'"([^"]+)"', text.partition("text[] = {")[2].partition("}")[0])
    assert [state.event_word for state in ConnectionState] == words
    assert [ConnectionState.from_event(word) for word in words] == list(ConnectionState)
    assert ConnectionState.from_event("a word of a later version") is ConnectionState.UNKNOWN


def test_documents_hold_the_words() -> None:
    values = [ConnectionState.DATA_PROCESS, CrcVerdict.WRONG, str(FrameDirection.TO_MAIN)]
    assert json.dumps(values) == '["data_process", "wrong", "sub_to_main"]'
    assert f"{FrameDirection.TO_SUB} {CrcVerdict.UNCHECKED}" == "main_to_sub unchecked"


def test_a_direction_is_an_index() -> None:
    assert ("to the sub", "to the main")[FrameDirection.TO_MAIN] == "to the main"


@pytest.mark.parametrize(
    ("state", "text", "in_data"),
    [
        (ConnectionState.DATA_PROCESS, "Data · ProcessData", True),
        (ConnectionState.DATA_FAILSAFE, "Data · FailSafeData", True),
        (ConnectionState.PARAMETER, "Parameter", False),
        (ConnectionState.SILENT, "Silent", False),
    ],
)
def test_people_read_the_terms_of_fsoe(state: ConnectionState, text: str, in_data: bool) -> None:
    assert (state.text, state.in_data) == (text, in_data)
