"""A second implementation of `fsn_monitor`: follows a connection from its frames.

Written in Python without the C core, only so that the self-test and the tests can compare both for
each frame.

Verdicts are based on the chain (§3): if old CRC and sequence number are known, every CRC of every
frame can be calculated. They are known after a Reset or Session, or are determined: for a given old
CRC, exactly one number makes CRC_0 right, so two consecutive numbers of one direction show that the
chain was found.
"""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.errors import PduSizeError
from fsoe_net.fsoe.chain import advance, fits_start
from fsoe_net.fsoe.crc import frame_crcs, solve_sequence
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict
from fsoe_net.fsoe.pdu import Command, Pdu, decode_pdu, frame_length

_DATA = (Command.PROCESS_DATA, Command.FAIL_SAFE_DATA)
_LAGGING = (
    (Command.RESET, ConnectionState.RESET),
    (Command.SESSION, ConnectionState.SESSION),
    (Command.CONNECTION, ConnectionState.CONNECTION),
    (Command.PARAMETER, ConnectionState.PARAMETER),
)


def observed_state(to_sub: int, to_main: int) -> ConnectionState:
    """Return the state given by the last commands of both directions; the lagging end decides.

    Args:
        to_sub: Last command of the main, 0 if none.
        to_main: Last command of the sub, 0 if none.
    """
    if to_sub == 0 or to_main == 0:
        return ConnectionState.SILENT
    for command, state in _LAGGING:
        if command in (to_sub, to_main):
            return state
    if to_sub == to_main == Command.PROCESS_DATA:
        return ConnectionState.DATA_PROCESS
    if to_sub in _DATA and to_main in _DATA:
        return ConnectionState.DATA_FAILSAFE
    return ConnectionState.UNKNOWN


@dataclass(slots=True)
class _Side:
    """The known part of the chain in one direction; 0 means unknown for both numbers."""

    last: bytes
    own: int | None = None  # CRC_0 of its last frame, for the collision rule
    sequence: int = 0  # number of its next frame
    guess: int = 0  # number of its next frame, if the calculated one is right
    command: int = 0  # first byte of its last frame


class PythonMonitor:
    """Follows both directions of one connection; index 0 is main to sub, 1 is sub to main.

    Args:
        safe_out_bytes: Safe data bytes from main to sub.
        safe_in_bytes: Safe data bytes from sub to main.

    Attributes:
        gaps: How often the chain was lost and found without a Reset. Frames were not observed, so
            the frame counted as wrong or unchecked at that point was not a fault of the channel.
    """

    def __init__(self, safe_out_bytes: int, safe_in_bytes: int) -> None:
        self.gaps = 0
        self._sides = (
            _Side(bytes(frame_length(safe_out_bytes))),
            _Side(bytes(frame_length(safe_in_bytes))),
        )
        self._last_crc = 0  # CRC_0 of the last frame of either direction
        self._last_direction: int | None = None  # direction of the last frame
        self._lost = False  # the chain was known, and no Reset has occurred since

    @property
    def state(self) -> ConnectionState:
        """State of the connection as observed from its frames."""
        return observed_state(*(side.command for side in self._sides))

    def sequence(self, direction: int) -> int:
        """Return the number of the next frame of a direction; 0 if unknown."""
        return self._sides[direction].sequence

    def frame(self, direction: int, data: bytes, now_ns: int) -> CrcVerdict:
        """Check the image of one direction.

        Args:
            direction: 0 main to sub, 1 sub to main.
            data: The bytes, as long as the frames of this direction.
            now_ns: Time of the observation, for the monitor of the C core only.

        Raises:
            PduSizeError: No FSoE frame of this direction has this length.
        """
        side = self._sides[direction]
        if data == side.last:
            return CrcVerdict.SAME
        if len(data) != len(side.last):
            raise PduSizeError(f"{len(data)} bytes; frames here have {len(side.last)}")
        side.last = bytes(data)
        pdu = decode_pdu(side.last)
        side.command = pdu.command
        return self._judge(direction, pdu)

    def _judge(self, direction: int, pdu: Pdu) -> CrcVerdict:
        if pdu.command == Command.RESET:
            self._clear()
            right = pdu.connection_id == 0 and fits_start(pdu)
            return CrcVerdict.RIGHT if right else CrcVerdict.WRONG
        if pdu.command == Command.SESSION:
            return self._session(direction, pdu)
        if self._last_direction == direction:
            self._lose(direction, pdu)  # the answer was not observed
            return CrcVerdict.UNCHECKED
        if self._sides[direction].sequence == 0:
            return self._search(direction, pdu)
        if self._fits(direction, pdu):
            return CrcVerdict.RIGHT
        self._lose(direction, pdu)
        return CrcVerdict.WRONG

    def _clear(self) -> None:
        """§3: at every Reset, right or wrong, and when the main starts a session."""
        for side in self._sides:
            side.own, side.sequence = None, 1
        self._last_crc, self._last_direction, self._lost = 0, None, False

    def _session(self, direction: int, pdu: Pdu) -> CrcVerdict:
        """Process a Session frame; the main's first one restarts the chain at any time (§6 row 9).

        A frame that does not match leaves a known chain unchanged: a main also ignores the reply to
        an abandoned session (§5 row 11).
        """
        side = self._sides[direction]
        if side.sequence and self._fits(direction, pdu):
            return CrcVerdict.RIGHT
        if direction == 0 and fits_start(pdu):
            self._clear()
            self._accept(0, pdu.crcs[0], 1)
            return CrcVerdict.RIGHT
        if side.sequence:
            return CrcVerdict.WRONG
        self._last_crc, self._last_direction = pdu.crcs[0], direction
        return CrcVerdict.UNCHECKED

    def _fits(self, direction: int, pdu: Pdu) -> bool:
        """Check all CRCs with the known number (§3) and advance the chain."""
        side = self._sides[direction]
        sequence = side.sequence
        crcs = self._crcs(pdu, sequence)
        if crcs[0] == side.own:  # collision rule
            sequence = advance(sequence)
            crcs = self._crcs(pdu, sequence)
        if crcs != pdu.crcs:
            return False
        self._accept(direction, crcs[0], sequence)
        return True

    def _crcs(self, pdu: Pdu, sequence: int) -> tuple[int, ...]:
        return frame_crcs(self._last_crc, pdu.connection_id, sequence, pdu.command, pdu.safe_data)

    def _accept(self, direction: int, crc: int, sequence: int) -> None:
        side = self._sides[direction]
        side.own = self._last_crc = crc
        side.sequence = advance(sequence)
        self._last_direction = direction

    def _lose(self, direction: int, pdu: Pdu) -> None:
        """Discard the numbers; the search begins with the next frame of the other direction."""
        self._lost |= any(side.sequence for side in self._sides)
        for side in self._sides:
            side.own, side.sequence, side.guess = None, 0, 0
        self._sides[direction].own = self._last_crc = pdu.crcs[0]
        self._last_direction = direction

    def _search(self, direction: int, pdu: Pdu) -> CrcVerdict:
        """Calculate the number; a consecutive second one confirms the first."""
        side = self._sides[direction]
        sequence = 0
        if self._last_direction is not None:
            sequence = solve_sequence(
                self._last_crc, pdu.connection_id, pdu.command, pdu.safe_data, pdu.crcs[0]
            )
        whole = sequence == 0 or self._crcs(pdu, sequence) == pdu.crcs
        found = whole and self._continues(side, pdu, sequence)
        side.own = self._last_crc = pdu.crcs[0]
        self._last_direction = direction
        side.guess = advance(sequence) if sequence and whole else 0
        if not whole:
            return CrcVerdict.WRONG  # the blocks do not match each other, whatever the chain is
        if not found:
            return CrcVerdict.UNCHECKED
        side.sequence = side.guess
        self.gaps += self._lost
        self._lost = False
        return CrcVerdict.RIGHT

    def _continues(self, side: _Side, pdu: Pdu, sequence: int) -> bool:
        if sequence == side.guess or side.guess == 0:
            return side.guess != 0
        # The collision rule skips a number whose CRC_0 equals the last one of this direction.
        collides = self._crcs(pdu, side.guess)[0] == side.own
        return collides and sequence == advance(side.guess)
