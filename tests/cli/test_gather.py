"""What `init` makes of its files and answers at their edges."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace as Facts
from typing import Any

import pytest

from fsoe_net.cli.init_prompt import _with, parse_ring
from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import InputError
from fsoe_net.formats.registry import all_formats
from fsoe_net.model.answers import Answers, Ask, Question
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.proposal import gather
from fsoe_net.proposal.draft import Draft, _names
from fsoe_net.proposal.draft_text import answers_template

HERE = Span("x")
INPUTS: Any = Facts(types=())
NOTHING = Draft(inputs=INPUTS, proposal=None, name="cell", questions=(), findings=())


def test_a_folder_with_too_many_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(gather, "_MOST_FILES", 2)
    for n in range(3):
        (tmp_path / f"{n}.yaml").touch()
    with pytest.raises(InputError) as refused:
        gather._files_in(str(tmp_path), gather.Collector())
    assert str(refused.value) == f"{tmp_path} holds more than 2 files; name those of the bus"


def test_parts_of_a_project_are_left_to_it():
    whole, part, other = "a/x.tsproj", "a/_Config/Box.xti", "a/cell.xml"
    assert gather._without_parts([whole, part, other]) == [whole, other]
    assert gather._without_parts([part, other]) == [part, other]
    safe, its_part = "a/x.splcproj", "a/y.sds"
    assert gather._without_parts([safe, its_part, part]) == [safe, part]


def test_a_file_that_is_cut_off_is_said():
    found = gather.Gathered()
    read: Any = Facts(path="x.pcap", truncated=True, subdevices=(), placeless=False)
    assert gather._sorted(read, all_formats()["eni"], found)
    assert found.notes == ["x.pcap is cut off: what is missing there is not guessed"]
    assert found.buses == [read]


def test_nothing_is_said_of_no_proposal():
    with pytest.raises(InputError, match="which SubDevices are on the ring is not known"):
        NOTHING.files()
    assert NOTHING.open == ()
    assert answers_template(NOTHING).endswith("name: cell\n# cycle_us: 1000\n")


def question(ask: Ask, *choices: tuple[str, str]) -> Question:
    return Question(
        ask=ask, text="Which?", facts=("a fact",), span=HERE, subject="io", choices=choices
    )


def test_open_questions_of_frames_and_mains_in_a_template():
    questions = (
        question(Ask.FRAMES, ("yes", ""), ("no", "")),
        question(Ask.MAIN, ("a", ""), ("b", "")),
    )
    made = Draft(inputs=INPUTS, proposal=None, name="cell", questions=questions, findings=())
    assert answers_template(made).split("# cycle_us: 1000\n\n")[1] == (
        "# frames:\n#   # Which?\n#   # a fact\n#   io: yes   # or no\n# Which?\n# main: [a, b]\n"
    )


@pytest.mark.parametrize("text", ["", "a b", "0 x EL1904", "EL1904,", "=EL1904"])
def test_invalid_rings(text: str):
    assert parse_ring(text) is None


def test_answers_at_the_prompt():
    data = question(Ask.PROCESS_DATA, ("device PDO", "6 bytes"), ("module 0xBE", "7 bytes"))
    found = _with(data, "2", Answers(), NOTHING)
    assert found is not None
    assert found.process_data["io"].text == "module 0xBE"
    assert _with(data, "1, 2", Answers(), NOTHING) is None
    frames = _with(question(Ask.FRAMES, ("yes", ""), ("no", "")), "No", Answers(), NOTHING)
    assert frames is not None
    assert frames.frames["io"].text == "no"


def test_names_that_meet():
    device: Any = None
    subs = [
        DescribedSubDevice(span=HERE, name=name, device=device) for name in ("a", "a", "a_2", "")
    ]
    assert _names(subs) == ("a_1", "a_2", "a_2_2", "subdevice")
