"""What a reader gives and says, whole, when one place of a file changes."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import changed
import pytest
from cases_file import DIAGNOSTICS
from formats.good_answers import GOOD as ANSWERS
from formats.kinds import KINDS
from formats.texts import DOMAINS, SLAVES_V

from fsoe_net.capture.start_up import load_capture
from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.own.acceptance import load_acceptance
from fsoe_net.formats.own.answers import load_answers
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.scan import load_scan
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.sii.read import load_sii

BASE = DIAGNOSTICS / "base"
SCENARIO = """\
version: 1
duration_s: 2.5
initial: {io.0x6001:01: 0}
logic: {inputs: [io.0x6001:01], outputs: []}
steps:
  - {at_ms: 900, break: io}
  - {at_ms: 0.5, press: reset}
  - {at_ms: 20, set: {io.0x6001:01: true, io.0x6001:02: 0x10}, output: {io.lamp: -3}}
expect:
  - {at_ms: 100, connection: a-b, state: data, max_resets: 0}
  - {during_ms: [10, 20.5], outputs: "off", safe_outputs: {io.0x7001:01: false}, min_resets: 2}
"""
Found = tuple[object, list]


def _collected(read: Callable) -> Callable[[str], Found]:
    def reader(path: str) -> Found:
        out = Collector()
        return read(path, out), out.diagnostics

    return reader


def _network(path: str) -> Found:
    found = load_network([path])
    return found.network, found.diagnostics


# Name: the text or the file in the folder, its name there, what reads it.
TEXTS: dict[str, tuple[str | Path, str, Callable[[str], Found]]] = {
    **{kind: (text, "file", _collected(read)) for kind, (text, read) in KINDS.items()},
    "igh_domains": (DOMAINS, "file", _collected(load_igh_text)),
    "igh_slaves_v": (SLAVES_V, "file", _collected(load_igh_text)),
    "answers": (ANSWERS.decode(), "file", _collected(load_answers)),
    "scenario": (SCENARIO, "file", load_scenario),
    "network": (BASE / "network.yaml", "network.yaml", _network),
    "timed": (BASE / "timed.yaml", "timed.yaml", _network),
    "urdf": (BASE / "robot.urdf", "robot.urdf", _network),
    "transfers": (BASE / "transfers.yaml", "robot.urdf", _network),
    "drive": (BASE / "devices/drive.yaml", "robot.urdf", _network),
    "acceptance": (BASE / "acceptance.yaml", "acceptance.yaml", _collected(load_acceptance)),
    "test_record": (BASE / "test-record.yaml", "test-record.yaml", _collected(load_test_record)),
    "scan": (BASE / "scan.json", "scan.json", load_scan),
}
BINARIES = {
    "sii": (BASE / "gate.sii", 1, _collected(load_sii)),
    "capture": (BASE / "start-up.pcap", 5, _collected(load_capture)),
}


def _whole(found: Found) -> str:
    return f"{changed.whole(found[0])}\n{changed.findings(found[1])}"


@pytest.fixture
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    shutil.copytree(BASE, tmp_path / "case")
    monkeypatch.chdir(tmp_path / "case")


@pytest.mark.weekly
@pytest.mark.shows("R7")
@pytest.mark.usefixtures("_in_folder")
@pytest.mark.parametrize("way", changed.WAYS)
@pytest.mark.parametrize("name", TEXTS)
def test_each_change(name: str, way: str):
    source, read_at, read = TEXTS[name]
    file = source.relative_to(BASE) if isinstance(source, Path) else Path(read_at)
    whole = source.read_text("utf-8") if isinstance(source, Path) else source

    def results() -> Iterator[tuple[str, str]]:
        for change, text in changed.WAYS[way](whole):
            file.write_text(text, "utf-8")
            yield change, _whole(read(read_at))

    changed.count(__file__, f"{name}-{way}", results())


@pytest.mark.weekly
@pytest.mark.shows("R7")
@pytest.mark.usefixtures("_in_folder")
@pytest.mark.parametrize("name", BINARIES)
def test_each_change_of_bytes(name: str):
    source, step, read = BINARIES[name]

    def results() -> Iterator[tuple[str, str]]:
        for change, data in changed.bits(source.read_bytes(), step):
            Path("file").write_bytes(data)
            yield change, _whole(read("file"))

    changed.count(__file__, name, results())
