"""What is written, whole, when one place of what is read changes."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import changed
import pytest
from cases_file import DIAGNOSTICS
from described import bus
from formats.texts import LCEC

from fsoe_net.errors import InputError
from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import eni_notes, write_eni
from fsoe_net.formats.igh.write import write_c_header
from fsoe_net.formats.lcec.read import load_lcec
from fsoe_net.formats.lcec.write import write_lcec
from fsoe_net.formats.own.acceptance import load_acceptance
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.own.write import write_network
from fsoe_net.formats.own.write_acceptance import write_acceptance
from fsoe_net.formats.own.write_test_record import write_test_record
from fsoe_net.formats.ros2.write import write_driver
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.writers import own_words_lost
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import Description

BASE = DIAGNOSTICS / "base"
VERSIONS = ("2025", "2026-06", "2026-08", "newest")
WRITERS: list[Callable[[Description], object]] = [
    write_eni,
    lambda d: write_eni(d, header_bytes=10),
    eni_notes,
    lambda d: own_words_lost(d, nets=True),
    write_c_header,
    lambda d: write_c_header(d, igh=False),
    write_lcec,
    write_network,
    *(lambda d, v=version: write_driver(d, version=v) for version in VERSIONS),
]


def _all_of(description: Description | None) -> list[str]:
    """Return what each writer makes of it."""
    made = []
    for write in WRITERS if description is not None else ():
        try:
            made.append(changed.whole(write(description)))
        except InputError as error:
            made.append(changed.figures(str(error)))
    return made


def _of_network(path: str) -> object:
    network = load_network([path]).network
    try:
        return network and _all_of(describe(network))
    except InputError as error:
        return changed.figures(str(error))


# Name: the text or the file, what is read then, what is written of it.
SOURCES: dict[str, tuple[str | Path, str, Callable[[str], object]]] = {
    "network": (BASE / "network.yaml", "network.yaml", _of_network),
    "drive": (BASE / "devices/drive.yaml", "robot.urdf", _of_network),
    "io": (BASE / "devices/ek1914.yaml", "network.yaml", _of_network),
    "eni": (write_eni(bus(1)), "file", lambda p: _all_of(load_eni(p, Collector()))),
    "lcec": (LCEC, "file", lambda p: _all_of(load_lcec(p, Collector()))),
    "acceptance": (
        BASE / "acceptance.yaml",
        "acceptance.yaml",
        lambda p: (r := load_acceptance(p, Collector())) and write_acceptance(r),
    ),
    "test_record": (
        BASE / "test-record.yaml",
        "test-record.yaml",
        lambda p: (r := load_test_record(p, Collector())) and write_test_record(r),
    ),
}


@pytest.mark.weekly
@pytest.mark.parametrize("way", changed.WAYS)
@pytest.mark.parametrize("name", SOURCES)
def test_each_change(name: str, way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    shutil.copytree(BASE, tmp_path / "case")
    monkeypatch.chdir(tmp_path / "case")
    source, read_at, write = SOURCES[name]
    file = source.relative_to(BASE) if isinstance(source, Path) else Path(read_at)
    whole = source.read_text("utf-8") if isinstance(source, Path) else source

    def results() -> Iterator[tuple[str, str]]:
        for change, text in changed.WAYS[way](whole):
            file.write_text(text, "utf-8")
            yield change, changed.whole(write(read_at))

    changed.count(__file__, f"written-{name}-{way}", results())
