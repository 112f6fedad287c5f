"""`fsoe-net decode`: whole outputs, exit codes, broken files."""

import gzip
import json
import subprocess
import sys
from pathlib import Path

import pytest
from capture.traffic import LRW, Bus, datagram, packet
from cli.tool import fsn
from click.testing import CliRunner
from data_files import listed, need

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.cli.decode import command
from fsoe_net.cli.run import command as run_command

ESTOP = str(Path(__file__).parents[2] / "examples" / "estop" / "network.yaml")
RIGHT = "2a0400a6340000"


def run(*arguments, code=0, stdin=None):
    done = CliRunner().invoke(command, list(arguments), catch_exceptions=False, input=stdin)
    assert done.exit_code == code, done.output
    return done


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Two seconds of the e-stop cell in virtual time."""
    path = tmp_path_factory.mktemp("capture") / "estop.pcapng"
    arguments = [ESTOP, "--virtual-time", "--duration", "2", "--capture", str(path)]
    assert CliRunner().invoke(run_command, arguments).exit_code == 0
    return str(path)


@pytest.fixture
def damaged(tmp_path):
    """A capture in which one frame of the sub has one wrong bit."""
    path, bus = tmp_path / "damaged.pcapng", Bus(2, 2, noise=False)
    with CaptureWriter(path) as writer:
        for cycle in range(100):
            image = bytearray(bus.image())
            if cycle == 70:
                image[bus.sub_at + 3] ^= 0x10
            writer.packet(cycle * 1_000_000, packet(datagram(LRW, 0, bytes(image), 3)))
    return str(path)


def test_single_frame_is_printed_as_a_row():
    assert run(RIGHT).stdout == (
        "way         command        ConnID  CRC              state          safe data\n"
        "main > sub  Reset               0  right            silent         04 00  4: wrong CRC\n\n"
    )


def test_wrong_crc_is_exit_code_1():
    assert "wrong" in run("2a0400a6350000", code=1).stdout


def test_standard_input_and_json():
    done = run("-", "--format", "json", stdin=f"m {RIGHT}\ns 2a0000c42d0000\n")
    (source,) = json.loads(done.stdout)["sources"]
    assert source["source"] == "hex"
    first, second = source["frames"]
    assert first["direction"] == "main_to_sub"
    assert (first["reset_code"], first["reset_text"]) == (4, "wrong CRC")
    assert (second["direction"], second["crc"], second["state"]) == (
        "sub_to_main",
        "right",
        "reset",
    )


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["zz"], 1, "argument: 'zz' is neither hex nor a file"),
        (["2a00"], 1, "has 2 bytes; FSoE frames have 6, 7, 11"),
        (["-o", "x", RIGHT], 2, "-o belongs to --lua"),
        (["--lua", ESTOP, RIGHT], 2, "--lua takes the network"),
        (["--network", "absent.yaml", RIGHT], 1, "nothing decoded"),
        ([ESTOP], 1, "not a packet capture (pcap, pcapng); give a capture of tcpdump"),
        (["."], 1, "it is a directory"),
    ],
)
def test_decode_reports_usage_errors(arguments, code, message):
    done = fsn("decode", *arguments)
    assert done.returncode == code, done.stderr
    assert message in done.stderr


def test_capture_with_names(capture):
    lines = run(capture, "--network", ESTOP).stdout.splitlines()
    assert " ".join(lines[0].split()) == (
        "packet time ms connection way command ConnID CRC state safe data"
    )
    first, reply = lines[1:3]
    assert first.split()[:7] == ["4", "1.030", "el1918-ek1914", "main", ">", "sub", "Reset"]
    assert "sub > main  Reset" in reply
    data = [line for line in lines if "ProcessData" in line]
    assert data[-1].endswith("e-stop channel A=1 e-stop channel B=1")
    assert all(" right" in line for line in lines[1 : lines.index("")])
    tail = lines[lines.index("") + 1 :]
    assert tail[0] == "el1918-ek1914: ConnID 1, now data process"
    assert "0 wrong, 0 unchecked; every 2.000 … 2.000 … 2.000 ms" in tail[1]
    assert tail[-1].endswith("1999 answered process data datagrams")


def test_capture_without_network_finds_the_same(capture):
    rows = []
    for arguments in ([capture], [capture, "--network", ESTOP]):
        (source,) = json.loads(run(*arguments, "--format", "json").stdout)["sources"]
        rows.append([(f["packet"], f["direction"], f["frame"], f["crc"]) for f in source["frames"]])
        (found,) = source["connections"]
        assert (found["connection_id"], found["roles"]) == (1, "certain")
        assert {p["size_bytes"] for p in found["places"]} == {6}
        assert len(found["places"]) == 4
    assert rows[0] == rows[1]
    assert len(rows[0]) > 1900


def test_changes_and_summary_leave_out(capture):
    whole, changes, summary = (
        len(run(capture, *option).stdout.splitlines())
        for option in ([], ["--changes"], ["--summary"])
    )
    assert whole > 1900
    assert 20 < changes < 60
    assert summary == 8


def test_damage_on_the_wire_is_shown(damaged):
    done = run(damaged, code=1)
    (line,) = [
        line
        for line in done.stdout.splitlines()
        if " wrong " in line and " > " in line and "frames" not in line
    ]
    assert line.split()[0] == "71"
    assert "sub > main" in line
    run(damaged, "--summary", code=1)


def test_a_capture_cut_short_is_read_as_far_as_it_goes(tmp_path, capture):
    data = Path(capture).read_bytes()
    path = tmp_path / "short.pcapng"
    path.write_bytes(data[: len(data) // 2 + 11])
    done = run(str(path), code=1)
    assert "damaged after packet" in done.stderr
    assert "now data process" in done.stdout


@pytest.mark.parametrize("size", [0, 3, 4, 12, 30])
def test_heads_cut_short(tmp_path, capture, size):
    path = tmp_path / "x.pcapng"
    path.write_bytes(Path(capture).read_bytes()[:size])
    done = fsn("decode", str(path))
    assert done.returncode == 1
    assert "x.pcapng: " in done.stderr


@pytest.mark.parametrize("name", listed("pcap", "*.pcapng"))
def test_real_traffic_without_fsoe(name):
    done = run(str(need("pcap", name)), code=1)  # nothing was there to be checked
    assert "no FSoE connection found" in done.stdout
    assert len(done.stdout.splitlines()) == 1


def test_lua_names_the_network(tmp_path):
    path = tmp_path / "fsoe.lua"
    done = run("--lua", ESTOP, "-o", str(path))
    assert "wireshark -X lua_script:" in done.stderr
    assert run("--lua", ESTOP).stdout == path.read_text("utf-8")
    assert '"el1918-ek1914"' in path.read_text("utf-8")


def test_long_hex_is_not_a_file_name():
    frame = "36" + "00" * 254
    assert "ProcessData" in run("main", frame).stdout
    talk = "main 2a0000c42d0000 sub 2a0000c42d0000 " * 20
    assert run(talk).stdout.count("Reset") == 40


def test_no_frame_is_an_error():
    for arguments in (["main"], [" "], [""]):
        assert "no frame was given" in run(*arguments, code=1).stderr
    assert "no frame was given" in run(code=1, stdin="# nothing\n").stderr


def test_captures_come_through_a_pipe_too(capture):
    data = Path(capture).read_bytes()
    assert "stdin" not in run("-", stdin=data).stderr
    assert "1999 answered" in run("-", "--summary", stdin=data).stdout
    assert "1999 answered" in run("-", "--summary", stdin=gzip.compress(data)).stdout


def test_closed_standard_input():
    done = subprocess.run(
        f"{sys.executable} -m fsoe_net.cli decode - <&-",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "standard input is closed" in done.stderr


def test_byte_order_mark_of_windows():
    assert "Reset" in run("-", stdin="\ufeff2a0000c42d0000\n".encode()).stdout


def test_names_of_another_network_are_doubted(capture):
    other = str(Path(ESTOP).parents[1] / "el6910" / "network.yaml")
    assert "the addresses are not those" in run("--network", other, "--summary", capture).stdout
    assert "the addresses" not in run("--network", ESTOP, "--summary", capture).stdout
