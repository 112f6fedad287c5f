"""The chain (§3): old CRC and sequence number link every frame to the preceding ones."""

from __future__ import annotations

from functools import lru_cache

from fsoe_net.dataclass import dataclass
from fsoe_net.fsoe.crc import frame_crcs, solve_sequence
from fsoe_net.fsoe.pdu import Command, Pdu, assemble


def advance(sequence: int) -> int:
    """Return the number after ``sequence``; 65535 is followed by 1, 0 is never used."""
    return 1 if sequence == 0xFFFF else sequence + 1


def before(sequence: int) -> int:
    """Return the number before ``sequence``, the inverse of `advance`."""
    return 0xFFFF if sequence == 1 else sequence - 1


@lru_cache(maxsize=1024)
def reset_frame(code: int, safe_bytes: int) -> bytes:
    """Return a Reset frame: old 0, sequence 1, ConnID 0, independent of earlier frames (§3)."""
    data = bytes((code,)) + bytes(safe_bytes - 1)
    return assemble(Command.RESET, data, frame_crcs(0, 0, 1, Command.RESET, data), 0)


def fits_start(pdu: Pdu) -> bool:
    """Whether the CRCs match (old 0, sequence 1) with the ConnID in the frame itself."""
    return frame_crcs(0, pdu.connection_id, 1, pdu.command, pdu.safe_data) == pdu.crcs


def is_whole(pdu: Pdu) -> bool:
    """Whether the blocks of a frame match each other, whatever old CRC and number are.

    Each block except the first provides 16 bits of evidence; a frame of one block always matches.
    """
    fields = pdu.connection_id, pdu.command, pdu.safe_data
    sequence = solve_sequence(0, *fields, pdu.crcs[0])
    return frame_crcs(0, fields[0], sequence, *fields[1:]) == pdu.crcs


@dataclass(slots=True, kw_only=True)
class Chain:
    """The five values that each side stores; ``None`` means empty.

    Attributes:
        last: CRC_0 of the last frame of either direction.
        own: CRC_0 of the last frame sent.
        peer: CRC_0 of the last frame accepted.
        tx_sequence: Number of the next frame to send, 1 … 65535.
        rx_sequence: Number of the next frame to accept, 1 … 65535.
    """

    last: int = 0
    own: int | None = None
    peer: int | None = None
    tx_sequence: int = 1
    rx_sequence: int = 1

    def copy(self) -> Chain:
        """Return a copy of the chain."""
        twin = Chain.__new__(Chain)  # a quarter of the time of the constructor
        twin.last, twin.own, twin.peer = self.last, self.own, self.peer
        twin.tx_sequence, twin.rx_sequence = self.tx_sequence, self.rx_sequence
        return twin

    def clear(self) -> None:
        """Reset to the start values: at every Reset sent or received and every Session start."""
        self.last, self.own, self.peer = 0, None, None
        self.tx_sequence = self.rx_sequence = 1

    def send(self, command: int, data: bytes, connection_id: int) -> bytes:
        """Return the frame to send and advance.

        Collision rule: if CRC_0 would equal that of the last frame sent, the sequence number
        advances once more. Once is enough: two numbers never give the same CRC_0.
        """
        crcs = frame_crcs(self.last, connection_id, self.tx_sequence, command, data)
        if crcs[0] == self.own:
            self.tx_sequence = advance(self.tx_sequence)
            crcs = frame_crcs(self.last, connection_id, self.tx_sequence, command, data)
        self.own = self.last = crcs[0]
        self.tx_sequence = advance(self.tx_sequence)
        return assemble(command, data, crcs, connection_id)

    def receive(self, pdu: Pdu) -> bool:
        """Check the CRCs of a received frame and advance; a wrong frame changes nothing.

        For the first Session reply, ``peer`` is empty, so it is received without the collision rule
        (§11.3, §16).
        """
        sequence = self.rx_sequence
        crcs = frame_crcs(self.last, pdu.connection_id, sequence, pdu.command, pdu.safe_data)
        if crcs[0] == self.peer:
            sequence = advance(sequence)
            crcs = frame_crcs(self.last, pdu.connection_id, sequence, pdu.command, pdu.safe_data)
        if crcs != pdu.crcs:
            return False
        self.peer = self.last = crcs[0]
        self.rx_sequence = advance(sequence)
        return True
