"""Ways to break the built-in ends, and by which class of the catalogue each shows, and how."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe.devices import _NoCrc

from fsoe_net.fsoe import chain as chain_module
from fsoe_net.fsoe.chain import Chain, advance
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.instance import Instance
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import Command, ResetCode
from fsoe_net.fsoe.sub_instance import SubInstance


@dataclass(frozen=True)
class Broken:
    """An engine with one thing wrong: ``where.name`` replaced; ``shown`` finds it."""

    what: str
    shown: str
    reason: str
    where: type | object
    name: str
    by: object


def _without_crc(kind):
    right = kind._power_up

    def power_up(self):
        right(self)
        self._chain = _NoCrc()

    return power_up


def _passed(where, name, value):
    """Return ``where.name`` made to return ``value`` when it returns a reset code."""
    right = getattr(where, name)
    return lambda self, pdu: value if right(self, pdu) is not None else None


def _first_block_only(self, pdu):
    sequence = self.rx_sequence
    crcs = chain_module.frame_crcs(
        self.last, pdu.connection_id, sequence, pdu.command, pdu.safe_data
    )
    if crcs[0] != pdu.crcs[0]:
        return False
    self.peer = self.last = crcs[0]
    self.rx_sequence = advance(sequence)
    return True


def _any_near_number(self, pdu):
    return _one_of(self, pdu, range(-2, 3))


def _next_number_too(self, pdu):
    """Apply the collision rule of §3 whether or not the CRCs collide."""
    return _one_of(self, pdu, (0, 1))


def _one_of(self, pdu, steps):
    for step in steps:
        sequence = (self.rx_sequence - 1 + step) % 0xFFFF + 1
        crcs = chain_module.frame_crcs(
            self.last, pdu.connection_id, sequence, pdu.command, pdu.safe_data
        )
        if crcs == pdu.crcs:
            self.peer = self.last = crcs[0]
            self.rx_sequence = advance(sequence)
            return True
    return False


def _step_without(codes):
    """A SubInstance that drops what it must refuse."""
    right = SubInstance.step

    def step(self, now_ns, received):
        before = self.snapshot()
        answer = right(self, now_ns, received)
        if answer is not None and answer[0] == Command.RESET and answer[1] in codes:
            seen = self._seen
            self.restore(before)
            self._seen = seen
            return None
        return answer

    return step


def _in_data(self, pdu):
    if pdu.command not in (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA):
        return ResetCode.COMMAND
    return None if self._chain.receive(pdu) else ResetCode.CRC


def _connection_id_under(mask):
    """A SubInstance in Data that compares these bits of the ConnID."""

    def in_data(self, pdu):
        if (pdu.connection_id ^ self.connection_id) & mask:
            return ResetCode.CONNECTION_ID
        return _in_data(self, pdu)

    return in_data


def _other_code(kind, wrong):
    right = kind._reset

    def reset(self, code, *, by_peer=None):
        return right(self, wrong.get(code, code), by_peer=by_peer)

    return reset


def _main_error(skipped):
    right = MainInstance._error

    def error(self, pdu):
        code = right(self, pdu)
        return None if code == skipped else code

    return error


def _stretched(kind, factor):
    right = kind._watchdog_expired

    def expired(self):
        start = self._watchdog_start_ns
        if not isinstance(self, kind):
            return right(self)
        return start is not None and self._now_ns - start >= factor * self._watchdog_ns

    return expired


def _one_late(self):
    start = self._watchdog_start_ns
    return start is not None and self._now_ns - start > self._watchdog_ns


def _keeps_data(self):
    self.enable = False


def _takes_all(self, pdu):
    self._valid, self._rx_safe = True, pdu.safe_data


def _told(change):
    """A SubInstance that judges what ``change`` makes of what it was told."""
    right = SubInstance._in_parameter

    def in_parameter(self, pdu):
        if len(self._told) >= self._parameter_bytes:
            change(self)
        return right(self, pdu)

    return in_parameter


def _right_length(self):
    self._told[:2] = b"\2\0"


def _right_app_length(self):
    self._told[4:6] = self.config.app_parameter_bytes.to_bytes(2, "little")


def _some_watchdog(self):
    self._told[2:4] = bytes(self._told[2:4]) if any(self._told[2:4]) else b"\x64\0"


def _without_address(self, pdu):
    if len(self._told) >= 4:
        self._told[2:4] = self.config.address.to_bytes(2, "little")
    return _IN_CONNECTION(self, pdu)


_IN_CONNECTION = SubInstance._in_connection
_IN_PARAMETER = SubInstance._in_parameter


def _data_in_parameter(self, pdu):
    if pdu.command not in (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA):
        return _IN_PARAMETER(self, pdu)
    if not self._chain.receive(pdu):
        return ResetCode.CRC
    self._watchdog_ns = 100_000_000
    self._enter(State.DATA)
    return None


def _constant_id(self):
    return b"\x34\x12"


def _enable_survives(self):
    self._rx_safe, self._valid = bytes(self._receives), False


def _always_process_data(self):
    return self._send(Command.PROCESS_DATA, self._tx_safe)


def _any_reset(self, pdu):
    return self._reset(ResetCode.LOCAL, by_peer=pdu.safe_data[0])


def _any_session(self, pdu):
    if self.state is State.DATA:
        return self._start_session(pdu)
    return _ON_SESSION(self, pdu)


_ON_SESSION = SubInstance._on_session


def _echoes_code(self, pdu):
    return self._reset(pdu.safe_data[0], by_peer=pdu.safe_data[0])


def _answers_reset(self, pdu):
    return self._fail(ResetCode.LOCAL)


def _wraps_to_zero(sequence):
    return sequence + 1 & 0xFFFF


def _reset_stays(self, code, *, by_peer=None):
    frame = _SUB_RESET(self, code, by_peer=by_peer)
    if by_peer is None:
        self.state = State.DATA
    return frame


_SUB_RESET = SubInstance._reset


BROKEN = (
    Broken(
        "65535 is followed by 0",
        "corruption",
        r"sends a wrong CRC or number",
        chain_module,
        "advance",
        _wraps_to_zero,
    ),
    Broken(
        "sub takes every CRC",
        "corruption",
        r"the sub: accepted",
        SubInstance,
        "_power_up",
        _without_crc(SubInstance),
    ),
    Broken(
        "main takes every CRC",
        "corruption",
        r"the main: accepted",
        MainInstance,
        "_power_up",
        _without_crc(MainInstance),
    ),
    Broken(
        "sub drops wrong CRCs",
        "corruption",
        r"the sub: sends nothing, Reset 4",
        SubInstance,
        "step",
        _step_without({4}),
    ),
    Broken(
        "sub drops wrong ConnIDs",
        "forged",
        r"the sub: sends nothing, Reset 3",
        SubInstance,
        "step",
        _step_without({3}),
    ),
    Broken(
        "sub drops unknown commands",
        "masquerade",
        r"the sub: sends nothing, Reset 2",
        SubInstance,
        "step",
        _step_without({2}),
    ),
    Broken(
        "a number two off is taken",
        "forged",
        r"continues with .* Reset 4",
        Chain,
        "receive",
        _any_near_number,
    ),
    Broken(
        "the next number is taken too",
        "forged",
        r"continues with .* Reset 4",
        Chain,
        "receive",
        _next_number_too,
    ),
    Broken(
        "main ignores the ConnID",
        "forged",
        r"the main: continues with .* Reset 3",
        MainInstance,
        "_error",
        _main_error(ResetCode.CONNECTION_ID),
    ),
    Broken(
        "main ignores the echo",
        "forged",
        r"the main: continues with .* Reset 7",
        MainInstance,
        "_error",
        _main_error(ResetCode.ECHO),
    ),
    Broken(
        "sub has no watchdog",
        "loss",
        r"the sub: sends nothing, Reset 5",
        SubInstance,
        "_watchdog_expired",
        lambda _self: False,
    ),
    Broken(
        "sub's watchdog is twice as long",
        "watchdog_edge",
        r"the sub: .*Reset 5",
        SubInstance,
        "_watchdog_expired",
        _stretched(SubInstance, 2),
    ),
    Broken(
        "sub's watchdog is half as long",
        "watchdog_edge",
        r"the sub: Reset 5 .*without a cause",
        SubInstance,
        "_watchdog_expired",
        _stretched(SubInstance, 0.5),
    ),
    Broken(
        "sub's watchdog is 0.5 % short",
        "watchdog_edge",
        r"the sub: sends Reset\(5.* is due after ProcessData",
        SubInstance,
        "_watchdog_expired",
        _stretched(SubInstance, 0.995),
    ),
    Broken(
        "sub's watchdog is 0.5 % long",
        "watchdog_edge",
        r"the sub: .*Reset 5",
        SubInstance,
        "_watchdog_expired",
        _stretched(SubInstance, 1.005),
    ),
    Broken(
        "main's watchdog is 0.5 % short",
        "watchdog_edge",
        r"the main: sends Reset\(5.* is due after ProcessData",
        MainInstance,
        "_watchdog_expired",
        _stretched(MainInstance, 0.995),
    ),
    Broken(
        "main's watchdog is twice as long",
        "watchdog_edge",
        r"the main: .*Reset 5",
        MainInstance,
        "_watchdog_expired",
        _stretched(MainInstance, 2),
    ),
    Broken(
        "a frame at the end of the watchdog is taken",
        "watchdog_edge",
        r"continues with .*Reset 5",
        Instance,
        "_watchdog_expired",
        _one_late,
    ),
    Broken(
        "sub calls a wrong ConnID a wrong CRC",
        "forged",
        r"the sub: sends Reset 4, Reset 3",
        SubInstance,
        "_reset",
        _other_code(SubInstance, {3: 4}),
    ),
    Broken(
        "main calls an unknown command a wrong one",
        "masquerade",
        r"the main: sends Reset 1, Reset 2",
        MainInstance,
        "_reset",
        _other_code(MainInstance, {2: 1}),
    ),
    Broken(
        "data survive a Reset",
        "corruption",
        r"data valid after the end has left",
        Instance,
        "_clear_safe_data",
        _keeps_data,
    ),
    Broken(
        "FailSafeData are taken as ProcessData",
        "enable",
        r"data valid without an accepted ProcessData",
        Instance,
        "_take_data",
        _takes_all,
    ),
    Broken(
        "sub stays in Data after its Reset",
        "forged",
        r"the sub: ",
        SubInstance,
        "_reset",
        _reset_stays,
    ),
    Broken(
        "session ids repeat",
        "former_session",
        r"sessions in a row have the id 34$",
        Instance,
        "_draw_session_id",
        _constant_id,
    ),
    Broken(
        "the enable survives a Reset",
        "enable",
        r"has not enabled it",
        Instance,
        "_clear_safe_data",
        _enable_survives,
    ),
    Broken(
        "ProcessData without enable",
        "enable",
        r"has not enabled it",
        Instance,
        "_send_data",
        _always_process_data,
    ),
    Broken(
        "sub takes a Reset with a wrong CRC",
        "forged",
        r"the sub: sends Reset 0, Reset 4",
        SubInstance,
        "_on_reset",
        _any_reset,
    ),
    Broken(
        "sub takes a Session with a wrong CRC",
        "forged",
        r"the sub: continues with Session.*Reset 4",
        SubInstance,
        "_on_session",
        _any_session,
    ),
    Broken(
        "sub answers a Reset with its code",
        "forged",
        r"the sub: sends Reset \d+, Reset 0",
        SubInstance,
        "_on_reset",
        _echoes_code,
    ),
    Broken(
        "main answers a Reset with a Reset",
        "forged",
        r"the main: sends nothing, SESSION is due after Reset",
        MainInstance,
        "_on_reset",
        _answers_reset,
    ),
)

HANDLERS = (
    Broken(
        "sub ignores the ConnID",
        "forged",
        r"the sub: continues with .*Reset 3",
        State.DATA,
        "",
        _in_data,
    ),
    *(
        Broken(
            f"sub compares the bits {mask:04x} of the ConnID",
            "forged",
            r"the sub: continues with .*Reset 3",
            State.DATA,
            "",
            _connection_id_under(mask),
        )
        for mask in (0x00FF, 0xFF00)
    ),
    Broken(
        "sub ignores the address",
        "parameters",
        r"the sub: continues with .*Reset 6",
        State.CONNECTION,
        "",
        _without_address,
    ),
    Broken(
        "sub ignores the parameter length",
        "parameters",
        r"the sub: continues with .*Reset 8",
        State.PARAMETER,
        "",
        _told(_right_length),
    ),
    Broken(
        "sub ignores the application length",
        "parameters",
        r"the sub: continues with .*Reset 10",
        State.PARAMETER,
        "",
        _told(_right_app_length),
    ),
    Broken(
        "sub takes a watchdog of 0",
        "parameters",
        r"the sub: continues with .*Reset 9",
        State.PARAMETER,
        "",
        _told(_some_watchdog),
    ),
    Broken(
        "sub takes data in Parameter",
        "forged",
        r"the sub: continues with .*Reset 1 ",
        State.PARAMETER,
        "",
        _data_in_parameter,
    ),
)
