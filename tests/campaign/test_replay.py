"""Recorded runs of independent implementations: same bytes, states, codes, data, step by step."""

import hashlib
import json

import pytest
from data_files import listed, need
from fsoe.pair import Bench
from fsoe.recorded import CONFIG, own_run, row_of

from fsoe_net.campaign.recording.replay import replay, replay_file
from fsoe_net.errors import RecordingError
from fsoe_net.fsoe.pdu import decode_pdu

RUNS = listed("traces", "p*.jsonl")
STEPS_OF_B = {"p10_ba_6x6_good.jsonl": 15, "p11_ba_1x2_good.jsonl": 15}


def _lines(run: str) -> list[str]:
    return need("traces", run).read_text("utf-8").splitlines()


@pytest.mark.shows("R17")
@pytest.mark.parametrize("run", RUNS)
def test_recorded_run_has_no_differences(run):
    result = replay_file(need("traces", run))
    assert not result.differences, "\n".join(map(str, result.differences[:5]))
    assert result.compared == 2 * (len(_lines(run)) - 1)
    # One implementation puts its outputs into FailSafeData (§9); nothing else is tolerated.
    assert result.tolerated == STEPS_OF_B.get(run, 0)


CHANGES = {
    "frame": ("master_tx", "3600000000cdab"),
    "state": ("slave_state", "Session"),
    "reset code": ("slave_reason", 99),
    "reset by": ("master_event", "by_slave"),
    "valid": ("master_pd_valid", True),
    "data": ("safe_outputs", "7777"),
}


@pytest.mark.shows("R17")
@pytest.mark.parametrize("field", CHANGES)
def test_every_field_is_compared(field):
    lines = _lines("p06_aa_2x2_local_reset.jsonl")
    row = json.loads(lines[20])
    row[CHANGES[field][0]] = CHANGES[field][1]
    lines[20] = json.dumps(row)
    (found,) = replay(lines).differences
    assert (found.step, found.field) == (row["n"], field)
    assert found.side == ("main" if "master" in CHANGES[field][0] else "sub")
    if field == "frame":
        assert "ProcessData 00 00 ConnID 43981 CRC 0000" in found.expected


@pytest.mark.parametrize("right", [True, False])
@pytest.mark.uncounted
def test_hash_of_skipped_cycles_is_compared(right):
    bench, rows = own_run(12)
    digest = hashlib.sha256()
    for n in range(12, 12 + 70_000):
        bench.now_ns = n * 1_000_000
        digest.update(bench.main_turn())
        digest.update(bench.sub_turn())
        bench.log.clear()
    text = digest.hexdigest() if right else "00" * 32
    skip = {"type": "skip", "n": 70_000, "sha256": text}
    result = replay(map(json.dumps, [CONFIG, *rows, skip]))
    assert [(d.side, d.field) for d in result.differences] == ([] if right else [("both", "hash")])
    assert result.compared == 2 * (12 + 70_000)


def test_quirk_accepts_both_until_the_next_reset():
    """§11.2: the recorded main ignores the good reply too, and waits for its watchdog."""
    bench, rows = own_run(1)
    bench.now_ns = 1_000_000
    session = bench.main_turn()
    reply = bench.sub_turn()
    stale = reply[:-3] + bytes((reply[-3] ^ 1,)) + reply[-2:]
    first = bytes.fromhex(rows[0]["slave_tx"])
    rows.append(row_of(bench, 1, (first, session), (session, reply)))
    rows.append(row_of(bench, 2, (stale, session), (None, None), quirk="11.2"))
    rows.extend(row_of(bench, n, (reply, session), (None, None)) for n in range(3, 22))
    reset = bytes.fromhex("2a050025ae0000")
    rows.append(
        row_of(
            bench,
            22,
            (reply, session),
            (reset, None),
            master_state="Reset",
            master_event="by_master",
            master_reason=5,
        )
    )
    for n in range(23, 42):
        rows.append(row_of(bench, n, (reply, session), (None, None), master_state="Reset"))
    result = replay(map(json.dumps, [CONFIG, *rows]))
    assert not result.differences
    assert result.tolerated > 0
    skip = {"type": "skip", "n": 7, "sha256": "00" * 32}
    longer = replay(map(json.dumps, [CONFIG, *rows[:3], skip]))
    shorter = replay(map(json.dumps, [CONFIG, *rows[:3]]))
    assert longer.tolerated == shorter.tolerated + 2 * 7
    assert longer.compared == shorter.compared + 2 * 7
    rows[-1]["master_state"] = "Session"  # after that Reset they are held together again
    (found,) = replay(map(json.dumps, [CONFIG, *rows])).differences
    assert (found.step, found.field, found.got) == (41, "state", "Reset")
    rows[-1]["master_state"] = "Reset"
    del rows[2]["quirk"]
    assert replay(map(json.dumps, [CONFIG, *rows])).differences


def test_scripted_sides_and_commands():
    _, rows = own_run(3)
    config = CONFIG | {"slave_impl": "scripted", "slave_session_id": None}
    for row in rows:
        row["slave_state"] = None
    assert replay(map(json.dumps, [config, *rows])).compared == 3
    rows[0]["commands"] = ["master.dance"]
    with pytest.raises(RecordingError, match="dance"):
        replay(map(json.dumps, [config, *rows]))
    with pytest.raises(RecordingError, match="kind of line"):
        replay(map(json.dumps, [config, {"type": "song"}]))


def test_a_scripted_side_is_not_compared_even_with_a_session_id():
    _, rows = own_run(3)
    rows[2]["slave_state"] = "Data"
    lines = [json.dumps(row) for row in (CONFIG | {"slave_impl": "scripted"}, *rows)]
    result = replay(lines)
    assert (result.compared, result.differences) == (3, [])
    assert replay([json.dumps(CONFIG), *lines[1:]]).differences


@pytest.mark.parametrize("size", [1, 6])
def test_bytes_that_differ_are_named(size):
    _, rows = own_run(9, Bench(size, size))
    row = rows[-1]
    row["slave_tx"] = bytes(b ^ 0xFF for b in bytes.fromhex(row["slave_tx"])).hex()
    for row in rows:
        row["master_app_out"] = row["slave_app_in"] = "00" * size
    config = CONFIG | {"out_size": size, "in_size": size}
    assert len(replay(map(json.dumps, [config, *rows])).differences) == 1


def test_power_cycle_and_verdict():
    bench, rows = own_run(12)
    rows[5]["commands"] = ["slave.power_cycle=0x5566"]
    assert replay(map(json.dumps, [CONFIG, *rows])).differences
    bench, rows = own_run(12)
    rows[0]["commands"] = ["slave.verify=9"]
    found = replay(map(json.dumps, [CONFIG, *rows])).differences
    assert decode_pdu(bytes.fromhex(found[0].got.split(" ")[0])).safe_data == b"\x09\0"
    assert bench.sub.state.value == "Data"
