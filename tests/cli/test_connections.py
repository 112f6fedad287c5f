"""Networks with connections in place of transfers, as a user sees them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES, resolved

EL6910 = EXAMPLES / "el6910"


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """The robot cell with slots in place of its transfers."""
    folder = Path(shutil.copytree(EL6910, tmp_path / "short"))
    file = folder / "network.yaml"
    text = file.read_text("utf-8")
    text = re.sub(r"    transfers:.*?(?=    connections:)", "", text, flags=re.DOTALL)
    for slot, sub in enumerate(("el1904", "el2904", "drive_1", "drive_2")):
        text = text.replace(f"6910, sub: {sub},", f"6910, sub: {sub}, slot: {slot},")
    file.write_text(text, "utf-8")
    return file


def test_both_forms_give_one_plan(short: Path, tmp_path: Path):
    one, two = tmp_path / "short.fsnplan", tmp_path / "long.fsnplan"
    for network, plan in ((short, one), (EL6910 / "network.yaml", two)):
        done = fsn("plan", str(network), "-o", str(plan))
        assert (done.returncode, done.stderr) == (0, "")
    assert one.read_bytes() == two.read_bytes()
    shown = fsn("plan", "--show", str(one)).stdout
    assert re.search(r"31 .*drive_1 SM3 .*el6910 SM2 .*el6910-drive_1\n", shown)
    assert len(re.findall(r"  el6910-[a-z0-9_]+$", shown, re.MULTILINE)) == 8


def test_no_difference_between_the_forms(short: Path, tmp_path: Path):
    plan = tmp_path / "long.fsnplan"
    assert fsn("plan", str(EL6910 / "network.yaml"), "-o", str(plan)).returncode == 0
    for other in (EL6910 / "network.yaml", plan):
        done = fsn("diff", str(short), str(other))
        assert done.stdout.endswith("no difference\n"), done.stdout


def test_an_unconfirmed_connection_is_read_and_refused(short: Path, tmp_path: Path):
    text = short.read_text("utf-8")
    short.write_text(text.replace("slot: 2,", "slot: 2, unconfirmed: sizes fit,"), "utf-8")
    check = fsn("check", str(short))
    assert check.returncode == 1
    assert "4 FSoE connections; 1 error" in check.stdout
    plan = tmp_path / "no.fsnplan"
    for command in (
        ("plan", str(short), "-o", str(plan)),
        ("emulate", str(short), "--interface", "nothing0"),
        ("run", str(short)),
        ("convert", str(short), "-o", str(tmp_path / "driver"), "--to", "driver"),
    ):
        done = fsn(*command)
        assert done.returncode == 1, done.stderr
        assert "marked unconfirmed" in done.stdout + done.stderr, command
    assert not plan.exists()
    assert not (tmp_path / "driver").exists()


def test_a_connection_without_frames_is_not_lost_in_another_format(short: Path, tmp_path: Path):
    short.write_text(short.read_text("utf-8").replace("slot: 2", "slot: 9"), "utf-8")
    done = fsn("convert", str(short), "-o", str(tmp_path / "driver"), "--to", "driver")
    assert done.returncode == 1
    assert "no such frame pair" in done.stderr
    assert not (tmp_path / "driver").exists()


def test_convert_writes_the_transfers_out(short: Path, tmp_path: Path):
    done = fsn("convert", str(short), "-o", str(tmp_path / "out" / "network.yaml"))
    assert done.returncode == 0, done.stderr
    again = resolved(tmp_path / "out" / "network.yaml")
    assert [len(net.transfers) for net in again.network.nets] == [8]
    assert [(c.slot, c.made) for c in again.connections] == [(n, False) for n in range(4)]
    assert [c.facts.address for c in again.connections if c.facts] == [101, 102, 201, 202]


def test_slots_are_written_in_their_order_for_linuxcnc(short: Path, tmp_path: Path):
    lines = short.read_text("utf-8").splitlines(keepends=True)
    ours = [n for n, line in enumerate(lines) if "{main:" in line]
    lines[ours[0]], lines[ours[1]] = lines[ours[1]], lines[ours[0]]
    short.write_text("".join(lines), "utf-8")
    out = tmp_path / "lcec.xml"
    done = fsn("convert", str(short), "-o", str(out), "--to", "lcec")
    assert done.returncode == 0, done.stderr
    numbers = re.findall(r'name="fsoeSlaveIdx" value="(\d+)"', out.read_text("utf-8"))
    assert numbers == ["2", "3", "4", "5"]
    short.write_text("".join(line for line in lines if "slot: 1," not in line), "utf-8")
    done = fsn("convert", str(short), "-o", str(tmp_path / "gap.xml"), "--to", "lcec")
    assert "el6910: slots 0, 2, 3 are connected" in done.stderr


def test_a_driver_copies_nothing_for_it(short: Path):
    assert fsn("check", str(short)).returncode == 0
    done = fsn("check", str(short), "--runtime", "ros2-2025")
    assert done.returncode == 1
    assert "error[FSN223]: the driver does not support connections" in done.stdout
    assert (
        "FSN223" not in fsn("check", str(EL6910 / "network.yaml"), "--runtime", "ros2-2025").stdout
    )
