"""Parameters that a main has sent, as the C monitor and the Python one observe them."""

import json
import zlib

import pytest
from core.both_monitors import TO_MAIN, TO_SUB, Both
from data_files import listed, need
from fsoe.pair import ADDRESS, CONNECTION_ID, WATCHDOG_MS, Bench, make_main, make_sub

from fsoe_net.fsoe.crc import frame_crcs
from fsoe_net.fsoe.parameters import FsoeParameters
from fsoe_net.fsoe.pdu import SAFE_SIZES, Command, assemble

NOTHING = FsoeParameters()
CONNECTION = FsoeParameters(connection_id=CONNECTION_ID, address=ADDRESS)
SIZES = [(1, 1), (1, 126), (2, 6), (4, 4), (6, 2), (14, 6), (126, 126)]
RUNS = listed("traces", "p*_good.jsonl")


def whole(app=b""):
    return FsoeParameters(
        connection_id=CONNECTION_ID,
        address=ADDRESS,
        watchdog_ms=WATCHDOG_MS,
        app_bytes=len(app),
        app_crc=zlib.crc32(app),
    )


def start(out, inn, app=b"", cycles=None):
    """Return the frames of a start-up with its direction, in the order sent."""
    bench = Bench(main=make_main(out, inn, app), sub=make_sub(out, inn, app))
    rows = []
    while len(rows) < 2 * cycles if cycles else bench.main.state.value != "Data":
        rows += [(TO_SUB, bench.main_turn()), (TO_MAIN, bench.sub_turn())]
    return [(way, frame) for way, frame in rows if frame is not None]


def observed(rows, out, inn):
    """Return what both monitors know after each frame."""
    both = Both(out, inn)
    known = []
    for way, frame in rows:
        both.frame(way, frame)
        known.append(both.c.parameters)
    return known


@pytest.mark.shows("R16")
@pytest.mark.parametrize("app", [b"", b"\0", b"\x01\x02\x03", bytes(range(256))])
@pytest.mark.parametrize(("out", "inn"), SIZES)
def test_all_lengths_in_both_directions(out, inn, app):
    known = observed(start(out, inn, app), out, inn)
    assert list(dict.fromkeys(known)) == [NOTHING, CONNECTION, whole(app)]


def test_all_sizes_of_safe_data():
    for size in sorted(SAFE_SIZES):
        assert observed(start(size, size, b"abc"), size, size)[-1] == whole(b"abc")


def test_a_frame_that_is_seen_again_counts_once():
    rows = [row for row in start(2, 2, b"\x07" * 9) for _ in range(3)]
    assert observed(rows, 2, 2)[-1] == whole(b"\x07" * 9)


def is_start(frame):
    return frame[0] in (Command.SESSION, Command.CONNECTION, Command.PARAMETER)


@pytest.mark.parametrize("way", [TO_SUB, TO_MAIN])
@pytest.mark.parametrize("number", range(8))
def test_unobserved_frames_are_unknown(way, number):
    """Each frame of a start-up of 4 bytes is left out in turn, with two in Data behind it."""
    rows = start(2, 2, b"\x07" * 4, cycles=16)
    ours = [n for n, (w, frame) in enumerate(rows) if w == way and is_start(frame)]
    assert len(ours) == 8
    lost = ours[number]
    last = {TO_SUB: CONNECTION, TO_MAIN: whole(b"\x07" * 4)}[way]
    known = observed(rows[:lost] + rows[lost + 1 :], 2, 2)[-1]
    assert known == (last if number == 7 else NOTHING)


@pytest.mark.shows("R16")
@pytest.mark.parametrize("skipped", range(2, 16))
def test_parameters_are_unknown_after_joining_late(skipped):
    rows = start(2, 2, cycles=20)
    begun = next(n for n, (_, frame) in enumerate(rows) if frame[0] == Command.SESSION)
    known = observed(rows[skipped:], 2, 2)[-1]
    assert known == (whole() if skipped <= begun else NOTHING)


def test_a_reset_leaves_what_was_known_and_a_session_restarts():
    rows = start(6, 6, cycles=8)
    reset = next(frame for _, frame in rows if frame[0] == Command.RESET)
    session = next(frame for _, frame in rows if frame[0] == Command.SESSION)
    known = observed([*rows, (TO_SUB, reset), (TO_SUB, session)], 6, 6)
    assert known[-3:] == [whole(), whole(), NOTHING]


def test_data_without_a_session_is_of_a_start_that_no_one_saw():
    rows = start(6, 6, cycles=8)
    reset = next(frame for _, frame in rows if frame[0] == Command.RESET)
    assert rows[-2][1][0] in (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA)
    known = observed([*rows, (TO_SUB, reset), rows[-2]], 6, 6)
    assert known[-2:] == [whole(), NOTHING]


def crafted(size, *lists):
    """Return frames with right CRCs of a main that sends anything, each answered with an echo."""
    old, rows = 0, []
    for number, (command, data) in enumerate(lists, 1):
        for way in (TO_SUB, TO_MAIN):
            safe = data.ljust(size, b"\0")
            crcs = frame_crcs(old, 7, number, command, safe)
            rows.append((way, assemble(command, safe, crcs, 7)))
            old = crcs[0]
    return rows


SESSION = (Command.SESSION, b"\x11\x22")
SENT = (Command.CONNECTION, b"\x07\x00\x09\x00")
SEEN = FsoeParameters(connection_id=7, address=9)


@pytest.mark.shows("R16")
@pytest.mark.parametrize(
    ("lists", "known"),
    [
        pytest.param([SENT], NOTHING, id="no Session"),
        pytest.param(
            [SESSION, (Command.PARAMETER, b"\2\0\x64\0\0\0")], NOTHING, id="no Connection"
        ),
        pytest.param([SESSION, SENT, (Command.PARAMETER, b"\3\0\x64\0\0\0")], SEEN, id="3 bytes"),
        pytest.param(
            [
                SESSION,
                SENT,
                (Command.PARAMETER, b"\2\0\x64\0\xff\xff"),
                *[(Command.PARAMETER, b"")] * 9,
            ],
            SEEN,
            id="ever so many",
        ),
        pytest.param(
            [SESSION, SENT, (Command.CONNECTION, b"\xff" * 6)], SEEN, id="more than four bytes"
        ),
        pytest.param(
            [SESSION, SENT, *[(Command.PARAMETER, b"\2\0\x64\0\0\0")] * 3],
            FsoeParameters(connection_id=7, address=9, watchdog_ms=100, app_bytes=0, app_crc=0),
            id="again and again",
        ),
        pytest.param([SESSION, SENT, (Command.PROCESS_DATA, b"")], NOTHING, id="Data too early"),
        pytest.param([SESSION, SENT, (0x77, b"")], NOTHING, id="no command of FSoE"),
    ],
)
def test_a_main_that_sends_anything(lists, known):
    assert observed(crafted(6, *lists), 6, 6)[-1] == known


@pytest.mark.shows("R16")
@pytest.mark.parametrize("path", RUNS)
def test_recorded_runs_of_foreign_stacks(path):
    lines = [json.loads(line) for line in need("traces", path).read_text("utf-8").splitlines()]
    config = lines[0]
    both = Both(config["out_size"], config["in_size"])
    for step in lines[1:]:
        if step["type"] != "step":
            break
        for way, key in ((TO_SUB, "master_tx"), (TO_MAIN, "slave_tx")):
            if step[key] is not None:
                both.frame(way, bytes.fromhex(step[key]))
    app = bytes.fromhex(config["app_params"])
    assert both.c.parameters == FsoeParameters(
        connection_id=config["connection_id"],
        address=config["slave_address"],
        watchdog_ms=config["watchdog_ms"],
        app_bytes=len(app),
        app_crc=zlib.crc32(app),
    )
