"""`fsoe-net campaign --replay`: whole outputs, exit codes, broken files."""

import json
import re

import pytest
from click.testing import CliRunner
from data_files import listed, need
from fsoe.recorded import own_run, recording_text

from fsoe_net.cli.campaign import command

ROWS = own_run(20)[1]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.jsonl").write_text(recording_text(ROWS), "utf-8")
    return tmp_path


def run(*arguments, code):
    done = CliRunner().invoke(command, ["--replay", *arguments], catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done


def changed(step: int, key: str, value) -> str:
    return recording_text([*ROWS[:step], ROWS[step] | {key: value}, *ROWS[step + 1 :]])


def test_a_run_that_replays(folder):
    done = run("good.jsonl", code=0)
    assert done.stdout == "good.jsonl: replays: 40 calls compared, 0 tolerated\n"


def test_the_first_difference_is_decoded(folder):
    frame = bytes.fromhex(ROWS[15]["slave_tx"])
    (folder / "bad.jsonl").write_text(
        changed(15, "slave_tx", (frame[:2] + bytes((frame[2] ^ 1,)) + frame[3:]).hex()), "utf-8"
    )
    done = run("good.jsonl", "bad.jsonl", code=1)
    shown = re.sub(r"[0-9a-f]{14}", "FRAME", done.stdout)
    assert re.sub(r"CRC [0-9a-f]{4}", "CRC X", shown) == (
        "good.jsonl: replays: 40 calls compared, 0 tolerated\n"
        "bad.jsonl:17: step 15, 15 ms, sub: frame differs\n"
        "  received        FRAME (FailSafeData 00 00 ConnID 43981 CRC X)\n"
        "  expected frame  FRAME (FailSafeData 00 01 ConnID 43981 CRC X)\n"
        "  got frame       FRAME (FailSafeData 00 00 ConnID 43981 CRC X)\n"
        "  bytes           2 (data 1): 01, got 00\n"
        "  state before    Data\n"
        "  expected after  Data, no reset, data 00 00 not valid\n"
        "  got after       Data, no reset, data 00 00 not valid\n"
    )


def test_how_many_more_differ(folder):
    rows = [*ROWS[:10], *(row | {"master_state": "Reset"} for row in ROWS[10:])]
    (folder / "bad.jsonl").write_text(recording_text(rows), "utf-8")
    done = run("bad.jsonl", code=1)
    assert "step 10, 10 ms, main: state differs" in done.stdout
    assert done.stdout.endswith("  9 more values differ; 40 calls compared\n")


@pytest.mark.parametrize("step", range(20))
@pytest.mark.parametrize("key", ["master_tx", "slave_tx"])
def test_every_changed_byte_is_found_at_its_step(folder, step, key):
    frame = bytes.fromhex(ROWS[step][key])
    for at in range(len(frame)):
        bad = frame[:at] + bytes((frame[at] ^ 0x40,)) + frame[at + 1 :]
        (folder / "bad.jsonl").write_text(changed(step, key, bad.hex()), "utf-8")
        (file,) = json.loads(run("bad.jsonl", "--format", "json", code=1).stdout)["files"]
        first = file["differences"][0]
        assert (first["step"], first["line"], first["bytes"]) == (step, step + 2, [at])


def test_json_has_each_file_with_its_differences(folder):
    (folder / "bad.jsonl").write_text(changed(3, "master_pd_valid", True), "utf-8")
    (folder / "broken.jsonl").write_text("{", "utf-8")
    done = run("good.jsonl", "bad.jsonl", "broken.jsonl", "--format", "json", code=1)
    document = json.loads(done.stdout)
    assert sorted(document) == ["files", "replays", "tool", "version"]
    good, bad, broken = document["files"]
    assert good == {
        "file": "good.jsonl",
        "replays": True,
        "error": None,
        "compared": 40,
        "tolerated": 0,
        "differing": 0,
        "differences": [],
    }
    assert (bad["replays"], bad["differing"], broken["replays"]) == (False, 1, False)
    (row,) = bad["differences"]
    assert (row["side"], row["field"], row["expected"], row["got"]) == (
        "main",
        "valid",
        "True",
        "False",
    )
    assert (row["time_us"], row["bytes"], row["state_before"]) == (3000, [], "Connection")
    assert row["expected_answer"]["valid"]
    assert not row["got_answer"]["valid"]
    assert broken["error"]["line"] == 1
    assert document["replays"] is False


def test_differing_hash_of_a_skip_is_reported_with_its_line(folder):
    skip = json.dumps({"type": "skip", "n": 5, "sha256": "0" * 64})
    (folder / "bad.jsonl").write_text(recording_text(ROWS) + skip, "utf-8")
    done = run("bad.jsonl", code=1)
    assert done.stdout.startswith("bad.jsonl:22: step 19: the cycles in lockstep after it give")
    assert json.loads(run("bad.jsonl", "--format", "json", code=1).stdout)


def test_quirk_lines_take_both_answers(folder):
    rows = [*ROWS[:10], ROWS[10] | {"master_tx": None, "quirk": "11"}]
    (folder / "quirk.jsonl").write_text(recording_text(rows), "utf-8")
    assert run("quirk.jsonl", code=0).stdout.endswith("22 calls compared, 1 tolerated\n")


BROKEN = {
    "no JSON": (b'{"type": "config"', r"f:1: not valid JSON, or cut off"),
    "empty": (b"", r"f: empty; a recording begins with its configuration"),
    "binary": (b"\xff\xfe\x00\x00", r"f:1: not UTF-8"),
    "missing key": (b'{"type": "config"}\n', r"f:1: 'app_params' is missing"),
    "no step": (recording_text([]).encode(), "f: nothing to compare"),
    "frame size": (changed(3, "slave_tx", "2a00").encode(), r"f:5: 'slave_tx' has 2 bytes"),
    "command": (changed(3, "commands", ["master.x"]).encode(), r"f:5: unknown command 'master.x'"),
    "surrogate": (changed(3, "commands", ["\ud800"]).encode(), r"f:5: command '\\ud800' names"),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_files_are_said_with_their_place(folder, kind):
    raw, message = BROKEN[kind]
    (folder / "f").write_bytes(raw)
    done = run("f", "good.jsonl", code=1)
    assert re.match(message, done.stderr), done.stderr
    assert "good.jsonl: replays" in done.stdout  # the others are held all the same


def test_missing_files_and_folders(folder):
    assert (
        run("absent.jsonl", code=1).stderr
        == "absent.jsonl: cannot read 'absent.jsonl': no such file\n"
    )
    assert run(".", code=1).stderr == ".: cannot read '.': it is a directory\n"
    assert run(code=2).stderr


@pytest.mark.parametrize("name", listed("traces", "p*.jsonl"))
def test_recorded_run_replays(name):
    assert ": replays: " in run(str(need("traces", name)), code=0).stdout
