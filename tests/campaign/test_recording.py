"""Broken recordings: each mistake is said with its line, and nothing else is ever raised."""

import hashlib
import io
import json
import tracemalloc

import pytest
from fsoe.recorded import CONFIG, own_run, recording_text
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.campaign.recording.difference import Compared, RecordingDifference, explain
from fsoe_net.campaign.recording.model import Answer
from fsoe_net.campaign.recording.reader import read_recording
from fsoe_net.campaign.recording.replay import replay, replay_file
from fsoe_net.campaign.recording.rows import file_lines
from fsoe_net.errors import RecordingError

ROWS = own_run(10)[1]
KEYS = sorted(CONFIG)
STEP_KEYS = sorted(ROWS[0])

CONFIG_MISTAKES = {
    "out_size": (3, "safe_out_bytes is 3"),
    "in_size": (128, "safe_in_bytes is 128"),
    "connection_id": (0, "connection_id is 0"),
    "slave_address": ("4660", "'slave_address' is '4660', not a whole number"),
    "watchdog_ms": (True, "'watchdog_ms' is True, not a whole number"),
    "app_params": ("abc", "an odd number of digits"),
    "bus_cycle_us": (0, "'bus_cycle_us' is 0"),
    "master_session_id": ("0x12345", "allowed are 0 … 65535"),
    "type": ("step", "the first line is a 'step'"),
}
STEP_MISTAKES = {
    "master_tx": ("360000", "'master_tx' has 3 bytes; its frames have 7"),
    "slave_tx": ("2a0", "an odd number of digits"),
    "master_rx": (12, "'master_rx' is 12, not a string"),
    "slave_rx": ("zz", "no bytes in hex"),
    "master_app_out": ("00", "1 safe data bytes for the master, which sends 2"),
    "slave_state": ("Dance", "no state of an FSoE end"),
    "master_event": ("by_nobody", "none of none, by_master"),
    "slave_pd_valid": (1, "'slave_pd_valid' is 1, not true or false"),
    "master_reason": ("5", "not a whole number"),
    "time_us": (10, "'time_us' goes back from 5000 to 10"),
    "slave_session_id": ("0xz", "no number"),
    "commands": ("master.enable", "'commands' is 'master.enable', not a list"),
    "type": ("song", "unknown kind of line 'song'"),
    "n": (10**400, "a huge number"),
}
EDGES = [
    ("master_rx", "00" * 4096, ""),
    ("master_rx", "00" * 4097, "'master_rx' has 4097 bytes; at most 4096 are read"),
    ("n", 10**15, "1000000000000000 after step 5; 6 is the next one"),
    ("n", 10**15 + 1, "a huge number"),
    ("time_us", 10**15, ""),
    ("time_us", 10**15 + 1, "'time_us' is a huge number; allowed are 0 … 1000000000000000"),
    ("slave_session_id", 0xFFFF, ""),
    ("slave_session_id", 0x10000, "'slave_session_id' is 65536; allowed are 0 … 65535"),
    ("slave_state", "x" * 58, "is '" + "x" * 58 + "', no state"),
    ("slave_state", "x" * 59, "is '" + "x" * 56 + "..., no state"),
]
COMMAND_MISTAKES = {
    "master.dance": "unknown command 'master.dance'",
    "enable": "names neither 'master' nor 'slave'",
    "nobody.enable": "names neither",
    "master.data=0f0": "an odd number of digits",
    "slave.data=0f": "1 safe data bytes for the slave",
    "slave.session=many": "no number",
    "slave.verify=": "no number",
    "slave.power_cycle=65536": "allowed are 0 … 65535",
}


def refused(lines, line: int, reason: str):
    with pytest.raises(RecordingError) as caught:
        replay(lines)
    assert caught.value.line == line
    assert reason in caught.value.reason


@pytest.mark.parametrize("key", CONFIG_MISTAKES)
def test_mistakes_in_the_configuration(key):
    value, reason = CONFIG_MISTAKES[key]
    refused(recording_text(ROWS, **{key: value}).splitlines(), 1, reason)


@pytest.mark.parametrize("key", STEP_MISTAKES)
def test_mistakes_in_a_step(key):
    value, reason = STEP_MISTAKES[key]
    rows = [*ROWS[:6], ROWS[6] | {key: value}, *ROWS[7:]]
    refused(recording_text(rows).splitlines(), 8, reason)


@pytest.mark.parametrize(("key", "value", "reason"), EDGES, ids=range(len(EDGES)))
def test_edges_of_values_in_a_step(key, value, reason):
    lines = recording_text([*ROWS[:6], ROWS[6] | {key: value}]).splitlines()
    if reason:
        refused(lines, 8, reason)
    else:
        assert replay(lines).compared == 14


@pytest.mark.parametrize(
    "key", [k for k in STEP_KEYS if not k.endswith(("reason", "_id", "state"))]
)
def test_a_missing_key_is_named(key):
    rows = [dict(row) for row in ROWS]
    del rows[3][key]
    refused(recording_text(rows).splitlines(), 5, f"{key!r} is missing")


def test_a_command_that_is_not_a_string():
    rows = [ROWS[0] | {"commands": [1]}]
    refused(recording_text(rows).splitlines(), 2, "command 1 is not a string")


@pytest.mark.parametrize("text", COMMAND_MISTAKES)
def test_mistakes_in_commands(text):
    rows = [ROWS[0] | {"commands": [text]}]
    refused(recording_text(rows).splitlines(), 2, COMMAND_MISTAKES[text])


def test_mistakes_in_lines():
    good = recording_text(ROWS).splitlines()
    refused([], 0, "empty")
    refused(["", "  "], 0, "empty")
    refused(good[:1], 0, "nothing to compare")
    refused([*good[:4], good[4][:100]], 5, "not valid JSON, or cut off")
    refused([*good[:4], "", "[1]"], 6, "a list instead of an object")
    refused(["[" * 100_000], 1, "nested too deeply")
    refused([good[0], '{"type": "skip", "n": 3, "sha256": "00"}'], 2, "SHA-256")
    refused([good[0], '{"type": "skip", "n": 3, "sha256": "0z"}'], 2, "'sha256' is '0z', no bytes")
    refused(
        [good[0], json.dumps({"type": "skip", "cycles": 10**9, "sha256": "00" * 32})], 2, "are 0"
    )


def test_a_bus_cycle_is_needed_where_cycles_are_left_out_only():
    config = {k: v for k, v in CONFIG.items() if k != "bus_cycle_us"}
    lines = [json.dumps(row) for row in (config, *ROWS)]
    assert replay(lines).compared
    skip = json.dumps({"type": "skip", "cycles": 1, "sha256": "00" * 32})
    refused([*lines[:3], skip], 4, "cycles are left out, and the first line has no 'bus_cycle_us'")


def test_file_with_invalid_utf8_or_a_long_line_is_rejected(tmp_path):
    path = tmp_path / "trace.jsonl"
    text = recording_text(ROWS)
    path.write_text(text, "utf-8")
    assert replay_file(path).compared == 20
    path.write_bytes(text.encode() + b'{"note": "\xff"}')
    with pytest.raises(RecordingError, match="line 12: not UTF-8"):
        replay_file(path)
    path.write_bytes(text.encode() + b" " * (1 << 21))
    with pytest.raises(RecordingError, match="line 12: longer than"):
        replay_file(path)


def _numbered(*numbers, **skip_before_last):
    rows = [ROWS[n] | {"n": number} for n, number in enumerate(numbers)]
    if skip_before_last:
        rows.insert(-1, skip_before_last)
    return [json.dumps(row) for row in (CONFIG, *rows)]


@pytest.mark.parametrize(("numbers", "next_one"), [((4, 5, 5), 6), ((4, 5, 3), 6), ((4, 5, 7), 6)])
def test_steps_are_counted_up(numbers, next_one):
    lines = _numbered(*numbers)
    refused(lines, 4, f"step {numbers[-1]} after step 5; {next_one} is the next one")
    assert replay(_numbered(4, 5, 6)).compared == 6  # the first may have any number


def test_steps_after_a_skip_go_on_anywhere_later():
    skip = {"type": "skip", "cycles": 0, "sha256": hashlib.sha256().hexdigest()}
    for number in (6, 9000):
        assert replay(_numbered(4, 5, number, **skip)).compared
    refused(_numbered(4, 5, 5, **skip), 5, "step 5 after step 5")


def test_lines_are_read_when_they_are_needed():
    taken = []

    def lines():
        for line in recording_text(ROWS).splitlines():
            taken.append(line)
            yield line

    recording = read_recording(lines())
    assert len(taken) == 1
    next(recording.lines)
    assert len(taken) == 2


@pytest.mark.uncounted
def test_a_long_recording_that_differs_everywhere_needs_little_memory():
    bad = ROWS[9] | {"master_state": "Reset", "slave_state": "Reset"}
    tracemalloc.start()
    result = replay(
        json.dumps(row)
        for part in ([CONFIG], (bad | {"n": n} for n in range(3000)))
        for row in part
    )
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert result.differing > 3000
    assert len(result.differences) == 100
    assert peak < 2_000_000


ODD = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.binary(max_size=9).map(bytes.hex),
    st.sampled_from(["Data", "Reset", "by_slave", "0x1122", "skip", "scripted", "2a0000000000"]),
    st.lists(
        st.sampled_from([*COMMAND_MISTAKES, "slave.reset", "master.power_cycle", 1]), max_size=2
    ),
    st.just({}),
)


def _answers_or_refuses(hold, recording):
    try:
        result = hold(recording)
    except RecordingError as exc:
        str(exc).encode("utf-8")
    else:
        assert result.compared


@settings(max_examples=examples(300))
@given(st.data())
def test_changed_recording_is_replayed_or_rejected(data):
    """Values changed, keys and lines taken away or swapped: an answer or a RecordingError."""
    rows = [CONFIG, *(ROWS[n] | {"quirk": "x"} if n == 7 else ROWS[n] for n in range(10))]
    rows = [dict(row) for row in rows]
    for _ in range(data.draw(st.integers(1, 4))):
        row = rows[data.draw(st.integers(0, len(rows) - 1))]
        key = data.draw(st.sampled_from([*sorted(row), "slave_own_address", "cycles"]))
        if data.draw(st.booleans()):
            row[key] = data.draw(ODD)
        else:
            row.pop(key, None)
    if data.draw(st.booleans()):
        rows.pop(data.draw(st.integers(0, len(rows) - 1)))
    for row in rows:
        if type(row.get("cycles")) is int:
            row["cycles"] %= 1000
    _answers_or_refuses(replay, map(json.dumps, rows))


@settings(max_examples=examples(200))
@given(st.data())
def test_damaged_recording_is_replayed_or_rejected(data):
    raw = bytearray(recording_text(ROWS).encode())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(raw) - 1))
        if data.draw(st.booleans()):
            raw[at] = data.draw(st.integers(0, 255))
        else:
            del raw[at : at + data.draw(st.integers(1, 40))]
    _answers_or_refuses(replay, file_lines(io.BytesIO(raw)))


def test_a_difference_is_explained_value_by_value():
    sent, received = bytes.fromhex("0800009d87cdab"), bytes.fromhex("0800007ca2cdab")
    reset = bytes.fromhex("2a0000c42d0000")
    expected = Answer(
        frame=sent, state="Data", reset_by="none", reset_code=None, valid=True, data=b"\1\2"
    )
    got = Answer(
        frame=reset, state="Reset", reset_by="this end", reset_code=3, valid=False, data=b"\0\0"
    )
    call = Compared(
        time_us=9500, received=received, state_before="Parameter", expected=expected, got=got
    )
    one = RecordingDifference(
        line=7, step=4, side="main", field="frame", expected=sent.hex(), got=reset.hex(), call=call
    )
    assert str(one) == f"step 4 main frame: expected {sent.hex()}, got {reset.hex()}"
    assert explain(one) == [
        "step 4, 9.5 ms, main: frame differs",
        "  received        0800007ca2cdab (FailSafeData 00 00 ConnID 43981 CRC a27c)",
        "  expected frame  0800009d87cdab (FailSafeData 00 00 ConnID 43981 CRC 879d)",
        "  got frame       2a0000c42d0000 (Reset(0: local reset or acknowledgement) 00 00 ConnID 0 "
        "CRC 2dc4)",
        "  bytes           0 (command): 08, got 2a; 3 (CRC 0 low): 9d, got c4; "
        "4 (CRC 0 high): 87, got 2d; 5 (ConnID low): cd, got 00; 6 (ConnID high): ab, got 00",
        "  state before    Parameter",
        "  expected after  Data, no reset, data 01 02 valid",
        "  got after       Reset, reset by this end, code 3: wrong connection ID, "
        "data 00 00 not valid",
    ]
    hashes = RecordingDifference(
        line=7, step=4, side="both", field="hash", expected="a" * 64, got="b" * 64
    )
    assert explain(hashes) == [
        "step 4: the cycles in lockstep after it give other frames",
        f"  expected SHA-256  {'a' * 64}",
        f"  got SHA-256       {'b' * 64}",
    ]
