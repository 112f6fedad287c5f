"""What a network means, and what is proposed, whole, when one place of a file changes."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import changed
import pytest
from cases_file import DIAGNOSTICS
from networks import PLAIN

from fsoe_net.errors import InputError
from fsoe_net.formats.own.answers import load_answers
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.answers import Answers
from fsoe_net.model.resolve import resolve
from fsoe_net.proposal.draft import Inputs, make_draft
from fsoe_net.proposal.gather import gather

BASE, ROBOT = DIAGNOSTICS / "base", PLAIN / "el6910"
ANSWERS = """\
name: cell
cycle_us: 2000
subdevices:
  - {type: EL6910, position: 1, name: logic}
  - {type: EL1904, name: stop, count: 2, revision: 0x00120000}
main: logic
frames: {stop_1: "yes"}
connections:
  - {sub: stop_1, main: logic, slot: 0, address: 17, connection_id: 3, watchdog_ms: 100}
  - {sub: stop_2, slot: 1}
"""
ANSWERS_OF_BASE = """\
cycle_us: 2000
main: logic
connections:
  - {sub: io, main: logic, slot: 0, address: 17, connection_id: 3, watchdog_ms: 100}
"""


def _resolved(network: str) -> str:
    found = load_network([network]).network
    if found is None:
        return ""
    resolution = resolve(found)
    return changed.whole((resolution, [sub.layout for sub in resolution.network.subdevices]))


def _proposed(files: tuple[str, ...]) -> str:
    answers: Answers | None = Answers()
    if Path("answers.yaml").exists():
        answers = load_answers("answers.yaml", Collector())
    try:
        made = make_draft(Inputs.of(gather(list(files), LoadOptions())), answers or Answers())
    except InputError as error:
        return changed.figures(str(error))
    return changed.whole((made, made.open))


# Name: folder, the file that changes, the network that is resolved or what one is proposed from.
CASES = {
    "network": (BASE, "network.yaml", "network.yaml"),
    "io": (BASE, "devices/ek1914.yaml", "network.yaml"),
    "timed": (BASE, "timed.yaml", "timed.yaml"),
    "proposed": (BASE, "network.yaml", ("network.yaml",)),
    "eni": (BASE, "bus.eni.xml", ("bus.eni.xml", "safety.xml")),
    "safety": (BASE, "safety.xml", ("bus.eni.xml", "safety.xml")),
    "lcec": (BASE, "lcec.xml", ("lcec.xml", "safety.xml")),
    "slaves": (BASE, "slaves.txt", ("slaves.txt", "pdos.txt", "coupler.xml")),
    "pdos": (BASE, "pdos.txt", ("slaves.txt", "pdos.txt", "coupler.xml")),
    "scan": (BASE, "scan.json", ("scan.json", "safety.xml")),
    "answers": (BASE, "answers.yaml", ("lcec.xml",)),
    "ring": (ROBOT, "answers.yaml", ("devices",)),
}
NUMBERS_ONLY = {"eni", "scan"}
WAYS = [(n, way) for n in CASES for way in changed.WAYS if way == "more" or n not in NUMBERS_ONLY]


@pytest.mark.weekly
@pytest.mark.parametrize(("name", "way"), WAYS)
def test_each_change(name: str, way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder, file, files = CASES[name]
    shutil.copytree(folder, tmp_path / "case")
    monkeypatch.chdir(tmp_path / "case")
    for answered, text in (("answers", ANSWERS_OF_BASE), ("ring", ANSWERS)):
        if name == answered:
            Path(file).write_text(text, "utf-8")

    def results() -> Iterator[tuple[str, str]]:
        for change, text in changed.WAYS[way](Path(file).read_text("utf-8")):
            Path(file).write_text(text, "utf-8")
            yield change, (_resolved if isinstance(files, str) else _proposed)(files)

    changed.count(__file__, f"{name}-{way}", results())
