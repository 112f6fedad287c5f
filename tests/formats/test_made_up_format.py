"""A format that is only a folder: commands know it, and no other file is touched."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

DECLARED = '''\
"""A list of SubDevices."""

from fsoe_net.formats.registry import Format, Signature, Target, Yields

FORMAT = Format(
    kind="wire-list",
    title="a wire list",
    expects="the first line `wire list`",
    yields=Yields.BUS,
    read="fsoe_net.formats.wire_list.lines:read",
    signatures=(Signature(words="a wire list", begins=b"wire list\\n"),),
    suffixes=(".wires",),
    targets=(
        Target(
            name="wires",
            write="fsoe_net.formats.wire_list.lines:write",
            options={"head": "wire list"},
            suffixes=(".wires",),
        ),
    ),
)
'''
LINES = '''\
"""Its reader and its writer."""

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.recognise import is_format
from fsoe_net.formats.shared.source import source_bytes, text_of
from fsoe_net.formats.shared.writers import Written
from fsoe_net.model.bus import Device
from fsoe_net.model.description import DescribedSubDevice, Description


def read(source, out, *, name="<wires>"):
    data, shown = source_bytes(source, out, name)
    if data is None or not is_format(data, "wire-list", shown, out):
        return None
    subs = []
    for position, line in enumerate(text_of(data).splitlines()[1:]):
        called, vendor, product = line.split()
        device = Device(path=shown, vendor_id=int(vendor, 16), product_code=int(product, 16))
        subs.append(DescribedSubDevice(name=called, position=position, device=device))
    return Description(
        span=Span(shown, 1, 1), format="wires", path=shown, subdevices=tuple(subs)
    )


def write(description, *, file, head):
    lines = [
        f"{s.name} {s.device.vendor_id:x} {s.device.product_code:x}"
        for s in description.subdevices
    ]
    return Written(files={file: "\\n".join([head, *lines, ""])}, notes=("only names and types",))
'''
PROGRAM = (
    "import sys, fsoe_net.formats\n"
    "fsoe_net.formats.__path__.append(sys.argv.pop(1))\n"
    "from fsoe_net.cli.main import main\n"
    "main()\n"
)
WIRES = "wire list\nhead 2 44c2c52\nstop 2 7703052\n"
ESTOP = Path(__file__).parents[2] / "examples" / "estop" / "network.yaml"


@pytest.fixture
def run(tmp_path: Path):
    folder = tmp_path / "more" / "wire_list"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text(DECLARED, "utf-8")
    (folder / "lines.py").write_text(LINES, "utf-8")
    (tmp_path / "bus").mkdir()
    (tmp_path / "bus" / "notes.txt").write_text(WIRES, "utf-8")  # known by content

    def command(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", PROGRAM, str(tmp_path / "more"), *words],
            cwd=tmp_path / "bus",
            capture_output=True,
            text=True,
            check=False,
        )

    return command


def test_it_is_recognised_read_and_written(run, tmp_path: Path):
    done = run("convert", "notes.txt", "-o", "network.yaml")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "network.yaml: 2 SubDevices, 0 copies, 3 files\n"
    done = run("convert", "network.yaml", "-o", "again.wires")
    assert done.returncode == 0, done.stderr
    assert "note: only names and types\n" in done.stderr
    assert (tmp_path / "bus" / "again.wires").read_text("utf-8") == WIRES
    done = run("convert", "--from", "wire-list", "--to", "eni", "network.yaml", "-o", "x.eni")
    assert (
        "FSN140]: this is a YAML file of ethercat_driver_ros2 or fsoe-net, not a wire list"
        in done.stderr
    )


def test_help_and_errors_list_it(run, tmp_path: Path):
    done = run("convert", "--help")
    assert "|wire-list]" in done.stdout
    assert "|wires]" in done.stdout
    assert "a wire list, or a folder" in " ".join(done.stdout.split())
    (tmp_path / "bus" / "odd.txt").write_text("hello", "utf-8")
    done = run("convert", "odd.txt", "-o", "network.yaml")
    assert "\n  wire-list: expects the first line `wire list`\n" in done.stderr


def test_a_network_is_proposed_from_it_and_compared_with_it(run):
    done = run("init", "notes.txt", "-o", "made", "--no-input")
    assert "made/network.yaml: 2 SubDevices, 0 FSoE connections" in done.stdout
    done = run("check", str(ESTOP), "notes.txt")
    assert (
        "warning[FSN443]: no SubDevice of this network is in notes.txt, which has 2 SubDevices\n"
        in done.stdout
    )
