"""Every row of the MainInstance's table (§5), with its reset code."""

import copy

import pytest
from fsoe.pair import (
    ADDRESS,
    COMMAND_OF,
    CONNECTION_ID,
    RUNNING,
    WATCHDOG_MS,
    WATCHDOG_NS,
    is_reset,
    last_reset,
    main_in,
    make_main,
    parts,
    right,
    wrong_crc,
)

from fsoe_net.fsoe.chain import Chain, reset_frame
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.pdu import Command

UNKNOWN = (0x00, 0x01, 0xFF, 0x2B)
EVERY = (State.RESET, *RUNNING)
ALLOWED = {state: {COMMAND_OF[state]} for state in RUNNING}
ALLOWED[State.DATA] = {Command.PROCESS_DATA, Command.FAIL_SAFE_DATA}


def _fails(main, frame, code, now_ns=0):
    """The frame makes the main send Reset(code) and fall into state Reset."""
    main.enable = True
    answer = main.step(now_ns, frame)
    assert is_reset(answer, code)
    assert answer == reset_frame(code, main.config.safe_out_bytes)
    assert main.state is State.RESET
    assert main.connection_id == 0
    assert main._chain == Chain()
    assert not main.enable
    assert not main.data_valid
    assert not any(main.received_safe_data)
    assert last_reset(main) == (EventKind.RESET_LOCAL, code)
    assert main.watchdog_remaining_ns(now_ns) == WATCHDOG_NS


def _echo(main):
    """The right answer to what the main sent last."""
    if main.state is State.SESSION:
        return right(main, Command.SESSION, b"\x55\x66"[: main.config.safe_in_bytes])
    if main.state is State.DATA:
        return right(main, Command.PROCESS_DATA, b"\x0f")
    return right(main, COMMAND_OF[main.state], main._chunk)


def test_first_call_sends_a_reset_before_anything_is_read():
    main = make_main()
    assert main.step(0, reset_frame(0, 2)) == reset_frame(0, 2)
    assert main.state is State.RESET
    assert main.step(0, reset_frame(0, 2))[0] == Command.SESSION  # still unread


@pytest.mark.parametrize("state", EVERY)
def test_row_1_local_reset(state):
    main = main_in(state)
    frame = None if state is State.RESET else _echo(main)
    main.request_reset()
    _fails(main, frame, 0)
    assert main.step(1, None) is None  # once


def test_row_2_watchdog_in_reset_starts_a_session():
    main = main_in(State.RESET)
    main.enable = True
    assert main.step(WATCHDOG_NS - 1, None) is None
    assert main.step(WATCHDOG_NS, None)[0] == Command.SESSION
    assert main.state is State.SESSION
    assert main.enable  # §9


@pytest.mark.parametrize("state", RUNNING)
def test_row_3_watchdog_elsewhere(state):
    main = main_in(state)
    assert main.step(WATCHDOG_NS - 1, None) is None
    remaining = [main.watchdog_remaining_ns(WATCHDOG_NS + n) for n in (-1, 0, 1)]
    assert remaining == [1, 0, 0]
    _fails(main, None, 5, WATCHDOG_NS)


@pytest.mark.parametrize("state", RUNNING)
def test_row_3_is_looked_at_before_the_frame(state):
    main = main_in(state)
    good = _echo(main)
    in_time = copy.deepcopy(main)
    assert not is_reset(in_time.step(WATCHDOG_NS - 1, good), 5)
    assert in_time.state is not State.RESET
    _fails(main, good, 5, WATCHDOG_NS)
    # §8: the frame is looked at in the next call, where nobody waits for it any more.
    assert main.step(WATCHDOG_NS, good) == reset_frame(0, 2)


@pytest.mark.parametrize("state", EVERY)
@pytest.mark.parametrize("nothing", ["none", "same"])
def test_row_4_nothing_new(state, nothing):
    main = main_in(state)
    before = copy.copy(main._chain)
    assert main.step(1, None if nothing == "none" else main._seen) is None
    assert main.state is state
    assert main._chain == before
    assert main.watchdog_remaining_ns(1) == WATCHDOG_NS - 1


@pytest.mark.parametrize("code", [0, 1, 4, 200])
def test_row_5_any_reset_opens_the_session(code):
    main = main_in(State.RESET)
    main.enable = True
    assert parts(main.step(3, bytes((0x2A, code, 9, 9, 9, 9, 9)))).command == Command.SESSION
    assert main.state is State.SESSION
    assert main.enable  # §9: given in Reset it survives
    event = main.take_events()[-1]
    assert (event.kind, event.code) == (EventKind.STATE, code)
    assert main.watchdog_remaining_ns(3) == WATCHDOG_NS


@pytest.mark.parametrize("command", [*UNKNOWN, *(set(Command) - {Command.RESET})])
def test_row_5_1_anything_else_repeats_the_reset(command):
    main = main_in(State.RESET)
    assert main.step(7, bytes((command, 1, 2, 3, 4, 5, 6))) == reset_frame(0, 2)
    assert main.state is State.RESET
    assert main.watchdog_remaining_ns(7) == WATCHDOG_NS - 7  # keeps running


@pytest.mark.parametrize("state", RUNNING)
def test_row_6_reset_by_the_sub(state):
    main = main_in(state)
    if state is State.DATA:
        main.step(0, right(main, Command.PROCESS_DATA, b"\x0f\x01"))
        assert main.data_valid
        main.take_events()
    main.enable = True
    sent = parts(main.step(5, bytes((0x2A, 6, 1, 2, 3, 4, 5))))
    assert (sent.command, sent.connection_id) == (Command.SESSION, 0)
    assert main.state is State.SESSION
    assert not main.enable
    assert not main.data_valid
    assert last_reset(main) == (EventKind.RESET_BY_PEER, 6)
    assert main.watchdog_remaining_ns(5) == WATCHDOG_NS


def test_row_6_draws_a_new_session_id():
    main = main_in(State.SESSION)
    first = main._payload
    main.step(1, reset_frame(4, 2))
    assert main._payload != first


@pytest.mark.parametrize("state", RUNNING)
@pytest.mark.parametrize("command", UNKNOWN)
def test_row_7_unknown_command(state, command):
    _fails(main_in(state), right(main_in(state), command, b"\1\2"), 2)


@pytest.mark.parametrize(
    ("state", "command"),
    [(s, c) for s in RUNNING for c in sorted(set(Command) - {Command.RESET} - ALLOWED[s])],
)
def test_row_8_command_of_another_state(state, command):
    main = main_in(state)
    _fails(main, right(main, command, b"\1\2"), 1)


@pytest.mark.parametrize("state", RUNNING[1:])
def test_row_9_connection_id(state):
    main = main_in(state)
    data = main._chunk if state is not State.DATA else b"\1\2"
    _fails(main, right(main, COMMAND_OF[state], data, CONNECTION_ID ^ 0x100), 3)


def test_row_9_not_in_session():
    main = main_in(State.SESSION)
    assert parts(main.step(0, right(main, Command.SESSION, b"\1\2", 77))).command == 0x64


@pytest.mark.parametrize("size", [1, 2, 4, 6])
@pytest.mark.parametrize("state", RUNNING[1:3])
def test_row_10_echo(state, size):
    main = main_in(state, 1, size, size)
    chunk = main._chunk
    _fails(main, right(main, COMMAND_OF[state], bytes((chunk[0] ^ 1,)) + chunk[1:]), 7)
    main = main_in(state, 1, size, size)
    _fails(main, right(main, COMMAND_OF[state], chunk[:-1] + bytes((chunk[-1] ^ 0x80,))), 7)


def test_row_10_every_chunk():
    for chunk in (1, 2, 3, 4):
        main = main_in(State.CONNECTION, chunk, 1, 1)
        _fails(main, right(main, Command.CONNECTION, bytes((main._chunk[0] ^ 4,))), 7)


def test_row_10_padding_is_not_compared():
    main = main_in(State.CONNECTION, 1, 6, 6)
    frame = right(main, Command.CONNECTION, main._chunk + b"\x99\x99")
    assert parts(main.step(0, frame)).command == Command.PARAMETER


@pytest.mark.parametrize("size", [1, 2, 6])
def test_row_11_first_session_reply_with_wrong_crc(size):
    main = main_in(State.SESSION, 1, size, size)
    before = copy.copy(main._chain)
    good = _echo(main)
    for junk in (wrong_crc(good), good[:-1] + b"\x77"):
        assert main.step(9, junk) is None
        assert main.state is State.SESSION
        assert main._chain == before
        assert main.watchdog_remaining_ns(9) == WATCHDOG_NS - 9
    assert not main.take_events()
    assert main.step(10, good) is not None  # the good reply still fits
    assert main.state is not State.RESET


@pytest.mark.parametrize(
    ("state", "chunk", "size"),
    [
        (State.SESSION, 2, 1),
        (State.CONNECTION, 1, 2),
        (State.CONNECTION, 4, 1),
        (State.PARAMETER, 1, 2),
        (State.PARAMETER, 3, 2),
        (State.DATA, 1, 2),
        (State.DATA, 1, 1),
    ],
)
def test_row_12_crc(state, chunk, size):
    main = main_in(state, chunk, size, size)
    _fails(main, wrong_crc(_echo(main)), 4)


@pytest.mark.parametrize("block", range(3))
def test_row_12_every_block_counts(block):
    main = main_in(State.DATA, 1, 6, 6)
    frame = bytearray(right(main, Command.PROCESS_DATA, bytes(6)))
    frame[4 + 4 * block] ^= 0x10
    _fails(main, bytes(frame), 4)


@pytest.mark.parametrize(
    ("combined", "code"),
    [("unknown+id+crc", 2), ("state+id+crc", 1), ("id+echo+crc", 3), ("echo+crc", 7)],
)
def test_rows_7_to_12_are_tried_in_order(combined, code):
    main = main_in(State.CONNECTION)
    command = {"unknown+id+crc": 0x77, "state+id+crc": 0x36}.get(combined, 0x64)
    ident = 5 if "id" in combined else None
    _fails(main, wrong_crc(right(main, command, b"\xee\xee", ident)), code)


def test_row_13_second_session_chunk():
    main = main_in(State.SESSION, 1, 1, 1)
    sent = parts(main.step(4, _echo(main)))
    assert (sent.command, sent.safe_data, sent.connection_id) == (Command.SESSION, b"\x11", 0)
    assert main.state is State.SESSION
    assert main.watchdog_remaining_ns(4) == WATCHDOG_NS


def test_row_14_session_complete():
    main = main_in(State.SESSION, 2, 1, 1)
    sent = parts(main.step(4, _echo(main)))
    assert (sent.command, sent.safe_data) == (Command.CONNECTION, b"\xcd")
    assert sent.connection_id == main.connection_id == CONNECTION_ID
    assert main.state is State.CONNECTION


def test_row_14_bytes_after_the_session_id_are_ignored():
    main = main_in(State.SESSION, 1, 6, 6)
    frame = right(main, Command.SESSION, b"\1\2\x99\x99\x99\x99")
    assert parts(main.step(0, frame)).command == Command.CONNECTION


def test_row_15_next_connection_chunk():
    main = main_in(State.CONNECTION, 1)
    sent = parts(main.step(4, _echo(main)))
    assert (sent.command, sent.safe_data) == (0x64, ADDRESS.to_bytes(2, "little"))
    assert main.state is State.CONNECTION


def test_row_16_connection_complete():
    main = main_in(State.CONNECTION, 2)
    assert parts(main.step(4, _echo(main))).safe_data == b"\2\0"
    assert main.state is State.PARAMETER


def test_row_17_next_parameter_chunk():
    main = main_in(State.PARAMETER, 1)
    assert parts(main.step(4, _echo(main))).safe_data == bytes((WATCHDOG_MS, 0))
    assert main.state is State.PARAMETER


@pytest.mark.parametrize("enable", [False, True])
def test_row_18_parameters_complete(enable):
    main = main_in(State.PARAMETER, 3)
    main.set_safe_data(b"\x5a\xa5")
    main.enable = enable
    sent = parts(main.step(4, _echo(main)))
    assert main.state is State.DATA
    assert sent.command == (Command.PROCESS_DATA if enable else Command.FAIL_SAFE_DATA)
    assert sent.safe_data == (b"\x5a\xa5" if enable else bytes(2))
    assert not main.data_valid


def test_rows_19_and_20_data():
    main = main_in(State.DATA)
    assert parts(main.step(1, right(main, Command.PROCESS_DATA, b"\x12\x34"))).command == 0x08
    assert (main.data_valid, main.received_safe_data) == (True, b"\x12\x34")
    assert main.step(2, main._seen) is None
    assert main.data_valid  # stays valid between frames
    assert main.watchdog_remaining_ns(2) == WATCHDOG_NS - 1
    # §9: whatever FailSafeData carries, the application sees zeros.
    assert main.step(3, right(main, Command.FAIL_SAFE_DATA, b"\x12\x34")) is not None
    assert (main.data_valid, main.received_safe_data) == (False, b"\0\0")
    assert main.state is State.DATA


def test_enable_is_independent_of_the_received_command():
    main = main_in(State.DATA)
    main.enable = True
    main.set_safe_data(b"\x01\x02")
    sent = parts(main.step(1, right(main, Command.FAIL_SAFE_DATA, b"")))
    assert (sent.command, sent.safe_data) == (Command.PROCESS_DATA, b"\x01\x02")
