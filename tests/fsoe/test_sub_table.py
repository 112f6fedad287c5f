"""Every row of the SubInstance's table (§6), with its reset code."""

import copy

import pytest
from fsoe.pair import (
    ADDRESS,
    CONNECTION_ID,
    RUNNING,
    WATCHDOG_MS,
    WATCHDOG_NS,
    Bench,
    is_reset,
    last_reset,
    make_main,
    make_sub,
    parts,
    right,
    sub_in,
    wrong_crc,
)

from fsoe_net.fsoe.chain import Chain, reset_frame
from fsoe_net.fsoe.config import Parameters
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.pdu import Command

UNKNOWN = (0x00, 0x01, 0xFF, 0x2B)
EVERY = (State.RESET, *RUNNING)
CONNECTION_TEXT = CONNECTION_ID.to_bytes(2, "little") + ADDRESS.to_bytes(2, "little")


def _fails(sub, frame, code, now_ns=0):
    sub.enable = True
    answer = sub.step(now_ns, frame)
    assert is_reset(answer, code)
    assert answer == reset_frame(code, sub.config.safe_in_bytes)
    assert sub.state is State.RESET
    assert sub.connection_id == 0
    assert sub._chain == Chain()
    assert not sub.enable
    assert not sub.data_valid
    assert not any(sub.received_safe_data)
    assert last_reset(sub) == (EventKind.RESET_LOCAL, code)
    assert sub.watchdog_remaining_ns(now_ns) is None


def _session(size=2, data=b"\x77\x88"):
    return Chain().send(Command.SESSION, data[:size].ljust(size, b"\0"), 0)


def test_silent_from_power_up():
    sub = make_sub()
    assert sub.step(0, None) is None
    assert sub.step(10**12, bytes(7)) is None
    assert (sub.state, sub.connection_id) == (State.RESET, 0)
    assert sub.watchdog_remaining_ns(0) is None


@pytest.mark.parametrize("state", EVERY)
def test_row_1_local_reset(state):
    sub = sub_in(state)
    sub.request_reset()
    _fails(sub, None, 0)
    assert sub.step(1, None) is None


def test_row_2_watchdog_in_data():
    sub = sub_in(State.DATA)
    sub.step(5, right(sub, Command.PROCESS_DATA, b"\x0f\x0f"))
    assert sub.watchdog_remaining_ns(5) == WATCHDOG_NS
    assert sub.step(5 + WATCHDOG_NS - 1, None) is None
    assert sub.data_valid
    good = right(sub, Command.PROCESS_DATA, b"\x01\x01")
    in_time = copy.deepcopy(sub)
    assert in_time.step(5 + WATCHDOG_NS - 1, good)[0] == Command.FAIL_SAFE_DATA
    _fails(sub, good, 5, 5 + WATCHDOG_NS)
    _fails(sub, good, 1, 5 + WATCHDOG_NS)  # §8: looked at in the next call, in state Reset


@pytest.mark.parametrize("state", EVERY[:-1])
def test_row_2_watchdog_runs_in_data_only(state):
    sub = sub_in(state)
    assert sub.watchdog_remaining_ns(0) is None
    assert sub.step(10**15, None) is None
    assert sub.state is state


@pytest.mark.parametrize("state", EVERY)
def test_row_3_nothing_new(state):
    sub = sub_in(state)
    before = copy.copy(sub._chain)
    assert sub.step(1, None) is None
    assert sub.step(1, sub._seen) is None
    assert (sub.state, sub._chain) == (state, before)
    if state is State.DATA:
        assert sub.watchdog_remaining_ns(1) == WATCHDOG_NS - 1


@pytest.mark.parametrize("code", [0, 5, 200])
def test_row_4_reset_in_reset_with_any_crc(code):
    sub = sub_in(State.RESET)
    sub.enable = True
    assert sub.step(1, bytes((0x2A, code, 9, 9, 9, 9, 9))) == reset_frame(0, 2)
    assert last_reset(sub) == (EventKind.RESET_BY_PEER, code)
    assert (sub.state, sub.enable) == (State.RESET, False)


@pytest.mark.parametrize("state", RUNNING)
def test_row_5_reset_with_right_crc(state):
    sub = sub_in(state)
    sub.enable = True
    assert sub.step(1, reset_frame(7, 2)) == reset_frame(0, 2)
    assert last_reset(sub) == (EventKind.RESET_BY_PEER, 7)
    assert (sub.state, sub.enable, sub.connection_id) == (State.RESET, False, 0)
    assert sub.watchdog_remaining_ns(1) is None


def test_row_5_takes_the_connection_id_the_frame_carries():
    sub = sub_in(State.DATA)
    assert sub.step(1, Chain().send(Command.RESET, b"\3\0", 0x4711)) == reset_frame(0, 2)
    assert last_reset(sub) == (EventKind.RESET_BY_PEER, 3)


@pytest.mark.parametrize("state", RUNNING)
def test_row_6_reset_with_wrong_crc(state):
    _fails(sub_in(state), wrong_crc(reset_frame(0, 2)), 4)


@pytest.mark.parametrize("state", EVERY)
@pytest.mark.parametrize("command", UNKNOWN)
def test_row_7_unknown_command(state, command):
    sub = sub_in(state)
    _fails(sub, right(sub, command, b"\1\2"), 2)


def test_row_8_second_session_chunk():
    sub = sub_in(State.SESSION, 1, 1, 1)
    answer = parts(sub.step(1, right(sub, Command.SESSION, b"\x99")))
    assert (answer.command, answer.safe_data, answer.connection_id) == (0x4E, b"\x33", 0)
    assert sub.state is State.SESSION


@pytest.mark.parametrize("state", EVERY)
def test_row_9_session_from_the_start_values(state):
    sub = sub_in(state)
    if state is State.DATA:
        sub.step(0, right(sub, Command.PROCESS_DATA, b"\1\1"))
        assert sub.data_valid
    sub.enable = True
    old_id = sub._session_id
    answer = parts(sub.step(1, _session()))
    assert (answer.command, answer.connection_id) == (Command.SESSION, 0)
    assert sub.state is State.SESSION
    assert sub.enable is (state is State.RESET)  # §9
    assert not sub.data_valid
    assert sub.connection_id == 0
    assert sub._session_id != old_id
    assert sub.watchdog_remaining_ns(1) is None


def test_row_9_as_the_very_first_frame():
    sub = make_sub()
    assert parts(sub.step(1, _session())).command == Command.SESSION


def test_row_9_session_half_done_starts_again():
    sub = sub_in(State.SESSION, 1, 1, 1)
    frame = Chain().send(Command.SESSION, b"\x51", 0)
    assert parts(sub.step(1, frame)).safe_data == sub._session_id[:1]
    assert sub._session_sent_bytes == 1


@pytest.mark.parametrize(("chunk", "size"), [(1, 2), (2, 1), (1, 6)])
def test_row_10_session_after_it_is_complete(chunk, size):
    sub = sub_in(State.SESSION, chunk, size, size)
    _fails(sub, right(sub, Command.SESSION, b"\x01"), 1)


@pytest.mark.parametrize("state", EVERY)
def test_row_11_other_session_frames(state):
    _fails(sub_in(state), wrong_crc(_session()), 4)


def test_row_11_in_a_later_state_the_running_chain_does_not_help():
    sub = sub_in(State.CONNECTION)
    _fails(sub, right(sub, Command.SESSION, b"\1\2", 0), 4)


@pytest.mark.parametrize("command", [0x64, 0x52, 0x36, 0x08])
def test_row_12_in_reset(command):
    sub = sub_in(State.RESET)
    _fails(sub, right(sub, command, b"\1\2"), 1)


@pytest.mark.parametrize("command", [0x52, 0x36, 0x08])
def test_row_13_in_session(command):
    sub = sub_in(State.SESSION)
    _fails(sub, right(sub, command, b"\1\2", CONNECTION_ID), 1)


def test_row_13_connection_before_the_session_id_is_complete():
    sub = sub_in(State.SESSION, 1, 1, 1)
    _fails(sub, right(sub, Command.CONNECTION, b"\xcd", CONNECTION_ID), 1)


def test_row_14_connection_opens():
    sub = sub_in(State.SESSION)
    answer = parts(sub.step(0, right(sub, Command.CONNECTION, b"\x01\x02", 0x0777)))
    assert (answer.command, answer.safe_data) == (0x64, b"\1\2")
    assert answer.connection_id == sub.connection_id == 0x0777
    assert sub.state is State.CONNECTION


def test_row_14_codes():
    sub = sub_in(State.SESSION)
    _fails(sub, wrong_crc(right(sub, Command.CONNECTION, b"\0\0", 0)), 3)
    sub = sub_in(State.SESSION)
    _fails(sub, wrong_crc(right(sub, Command.CONNECTION, b"\1\2", 9)), 4)


def test_row_15_more_connection():
    sub = sub_in(State.CONNECTION)
    good = right(sub, Command.CONNECTION, b"\x34\x12")
    assert parts(sub.step(0, good)).safe_data == b"\x34\x12"
    sub = sub_in(State.CONNECTION)
    _fails(sub, wrong_crc(right(sub, Command.CONNECTION, b"\1\2", 9)), 3)
    sub = sub_in(State.CONNECTION)
    _fails(sub, wrong_crc(good), 4)


@pytest.mark.parametrize(
    ("chunk", "command"), [(2, 0x64), (1, 0x52), (1, 0x36), (1, 0x08), (2, 0x36), (2, 0x08)]
)
def test_row_16_in_connection(chunk, command):
    sub = sub_in(State.CONNECTION, chunk)
    _fails(sub, right(sub, command, b"\2\0"), 1)


def _connected(text, ident=CONNECTION_ID):
    sub = sub_in(State.SESSION, 1, 4, 4)
    assert parts(sub.step(0, right(sub, Command.CONNECTION, text, ident))).safe_data == text
    sub.take_events()
    return sub


def test_row_17_parameter_opens():
    sub = _connected(CONNECTION_TEXT)
    assert parts(sub.step(0, right(sub, Command.PARAMETER, b"\2\0\x64\0"))).command == 0x52
    assert sub.state is State.PARAMETER


@pytest.mark.parametrize(
    ("text", "ident", "damage", "code"),
    [
        (b"\xff\xff\xff\xff", 9, True, 3),
        (b"\xce\xab\xff\xff", None, True, 3),
        (b"\xcd\xab\xff\xff", None, True, 6),
        (b"\xcd\xab\x35\x12", None, False, 6),
        (b"\xcd\xab\x34\x12", None, True, 4),
    ],
    ids=["field", "connection id", "address", "address alone", "crc"],
)
def test_row_17_checks_in_order(text, ident, damage, code):
    sub = _connected(text)
    frame = right(sub, Command.PARAMETER, b"\2\0\x64\0", ident)
    _fails(sub, wrong_crc(frame) if damage else frame, code)


def test_row_18_more_parameters():
    sub = sub_in(State.PARAMETER)
    good = right(sub, Command.PARAMETER, b"\x64\0")
    assert parts(sub.step(0, good)).safe_data == b"\x64\0"
    sub = sub_in(State.PARAMETER)
    _fails(sub, wrong_crc(right(sub, Command.PARAMETER, b"\1\2", 9)), 3)
    sub = sub_in(State.PARAMETER)
    _fails(sub, wrong_crc(good), 4)


@pytest.mark.parametrize(
    ("chunk", "command"), [(1, 0x64), (3, 0x64), (3, 0x52), (1, 0x36), (2, 0x08)]
)
def test_row_19_in_parameter(chunk, command):
    sub = sub_in(State.PARAMETER, chunk)
    _fails(sub, right(sub, command, b"\2\0"), 1)


def _told(parameters, verdict=0, app_bytes=0, asked=None):
    """A sub in Parameter that was told these six bytes (and what follows)."""

    def verify(parameters):
        if asked is not None:
            asked.append(parameters)
        return verdict

    sub = make_sub(6, 6, verify=verify, app_parameter_bytes=app_bytes)
    sub.step(0, _session(6))
    sub.step(0, right(sub, Command.CONNECTION, CONNECTION_TEXT, CONNECTION_ID))
    for at in range(0, len(parameters), 6):
        sub.step(0, right(sub, Command.PARAMETER, parameters[at : at + 6]))
    assert sub.state is State.PARAMETER
    sub.take_events()
    return sub


@pytest.mark.parametrize(
    ("parameters", "ident", "verdict", "code"),
    [
        (b"\3\0\0\0\1\0", 9, 9, 3),
        (b"\3\0\0\0\1\0", None, 9, 8),
        (b"\2\0\0\0\1\0", None, 9, 10),
        (b"\2\0\0\0\0\0", None, 0x80, 9),
        (b"\2\0\x64\0\0\0", None, 9, 9),
        (b"\2\0\x64\0\0\0", None, 11, 11),
        (b"\2\0\x64\0\0\0", None, 0x80, 0x80),
        (b"\2\0\x64\0\0\0", None, 0xFF, 0xFF),
        (b"\2\0\x64\0\0\0", None, 1, 11),
        (b"\2\0\x64\0\0\0", None, 0x7F, 11),
        (b"\2\0\x64\0\0\0", None, 0x100, 11),
        (b"\2\0\x64\0\0\0", None, -1, 11),
        (b"\2\0\x64\0\0\0", None, 0, 4),
    ],
)
@pytest.mark.parametrize("command", [0x36, 0x08])
def test_row_20_checks_in_order(parameters, ident, verdict, code, command):
    sub = _told(parameters, verdict)
    _fails(sub, wrong_crc(right(sub, command, bytes(6), ident)), code)


def test_row_20_asks_the_application_for_all_parameters():
    asked = []
    sub = _told(b"\2\0\x2c\1\5\0" + b"\1\2\3\4\5\0", app_bytes=5, asked=asked)
    assert parts(sub.step(0, right(sub, Command.FAIL_SAFE_DATA, bytes(6)))).command == 0x08
    assert sub.state is State.DATA
    assert asked == [Parameters(watchdog_ms=300, app_parameters=b"\1\2\3\4\5")]
    assert sub.watchdog_remaining_ns(0) == 300_000_000


@pytest.mark.parametrize("enable", [False, True])
def test_row_20_first_data_frame(enable):
    sub = sub_in(State.PARAMETER, 3)
    sub.enable = enable
    sub.set_safe_data(b"\x0a\x0b")
    answer = parts(sub.step(8, right(sub, Command.PROCESS_DATA, b"\x21\x22")))
    assert (sub.state, sub.data_valid) == (State.DATA, True)
    assert sub.received_safe_data == b"\x21\x22"
    assert answer.command == (0x36 if enable else 0x08)
    assert answer.safe_data == (b"\x0a\x0b" if enable else b"\0\0")
    assert sub.watchdog_remaining_ns(8) == WATCHDOG_NS


@pytest.mark.parametrize("command", [0x64, 0x52])
def test_row_21_in_data(command):
    sub = sub_in(State.DATA)
    _fails(sub, right(sub, command, b"\2\0"), 1)


@pytest.mark.parametrize("command", [0x36, 0x08])
def test_rows_22_and_23_codes(command):
    sub = sub_in(State.DATA)
    _fails(sub, wrong_crc(right(sub, command, b"\2\0", 9)), 3)
    sub = sub_in(State.DATA)
    _fails(sub, wrong_crc(right(sub, command, b"\2\0")), 4)


def test_rows_22_and_23_data():
    sub = sub_in(State.DATA)
    assert parts(sub.step(1, right(sub, Command.PROCESS_DATA, b"\x12\x34"))).command == 0x08
    assert (sub.data_valid, sub.received_safe_data) == (True, b"\x12\x34")
    assert sub.watchdog_remaining_ns(1) == WATCHDOG_NS
    sub.step(2, right(sub, Command.FAIL_SAFE_DATA, b"\x12\x34"))
    assert (sub.data_valid, sub.received_safe_data) == (False, b"\0\0")
    assert sub.watchdog_remaining_ns(2) == WATCHDOG_NS


def test_echo_keeps_padding_but_cuts_the_first_parameter_frame():
    sub = sub_in(State.SESSION, 1, 8, 8)
    text = CONNECTION_TEXT + b"\x91\x92\x93\x94"
    assert parts(sub.step(0, right(sub, 0x64, text, CONNECTION_ID))).safe_data == text
    frame = right(sub, 0x52, b"\2\0\x64\0\0\0\x95\x96")
    assert parts(sub.step(0, frame)).safe_data == b"\2\0\x64\0\0\0\0\0"


def test_echo_keeps_padding_of_later_parameter_frames():
    sub = sub_in(State.PARAMETER, 1, 4, 4)
    assert parts(sub.step(0, right(sub, 0x52, b"\0\0\x95\x96"))).safe_data == b"\0\0\x95\x96"


def test_echo_beyond_the_smaller_size_is_zero():
    sub = sub_in(State.SESSION, 1, 6, 4)
    frame = right(sub, 0x64, CONNECTION_TEXT + b"\x91\x92", CONNECTION_ID)
    assert parts(sub.step(0, frame)).safe_data == CONNECTION_TEXT
    sub = sub_in(State.SESSION, 1, 4, 6)
    frame = right(sub, 0x64, CONNECTION_TEXT, CONNECTION_ID)
    assert parts(sub.step(0, frame)).safe_data == CONNECTION_TEXT + b"\0\0"


@pytest.mark.parametrize(("told", "wanted", "code"), [(b"\1", 0, 1), (b"", 3, 1), (b"\1", 2, 10)])
def test_other_parameter_length_than_expected(told, wanted, code):
    """§6: code 10 only when the number of chunks happens to be equal."""
    bench = Bench(main=make_main(2, 2, told), sub=make_sub(2, 2, app_parameter_bytes=wanted))
    bench.until(lambda: bench.sub.state is State.PARAMETER)
    bench.sub.take_events()
    bench.until(lambda: bench.sub.state is State.RESET)
    assert last_reset(bench.sub) == (EventKind.RESET_LOCAL, code)


def test_watchdog_comes_from_the_main():
    bench = Bench(main=make_main(2, 2, watchdog_ms=321)).to_data()
    assert bench.sub.watchdog_remaining_ns(0) == 321_000_000
    assert WATCHDOG_MS != 321
