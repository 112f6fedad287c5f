"""The chain (§3): old CRC and sequence number bind every frame to the ones before it."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.fsoe.pdu import Pdu, encode_pdu, frame_crcs

__all__ = ["Chain", "next_sequence", "reset_frame", "valid_from_start"]


def next_sequence(sequence: int) -> int:
    """Return the number after ``sequence``; 65535 is followed by 1, 0 is never used."""
    return 1 if sequence == 0xFFFF else sequence + 1


def reset_frame(code: int, safe_bytes: int) -> bytes:
    """Return a Reset frame: old 0, sequence 1, ConnID 0, whatever happened before."""
    data = bytes((code,)) + bytes(safe_bytes - 1)
    crcs = frame_crcs(0, 0, 1, 0x2A, data)
    return encode_pdu(Pdu(command=0x2A, safe_data=data, crcs=crcs, connection_id=0))


def valid_from_start(pdu: Pdu) -> bool:
    """Whether the CRCs fit (old 0, sequence 1) with the ConnID the frame carries."""
    return frame_crcs(0, pdu.connection_id, 1, pdu.command, pdu.safe_data) == pdu.crcs


@dataclass(slots=True)
class Chain:
    """The five values each side keeps; ``None`` means empty.

    ``last`` is CRC_0 of the last frame of either direction, ``own`` the one sent last, ``peer`` the
    one accepted last.
    """

    last: int = 0
    own: int | None = None
    peer: int | None = None
    tx_sequence: int = 1
    rx_sequence: int = 1

    def clear(self) -> None:
        """Return to the start values: at every Reset sent or received and every Session start."""
        self.last, self.own, self.peer = 0, None, None
        self.tx_sequence = self.rx_sequence = 1

    def seal(self, command: int, data: bytes, connection_id: int) -> bytes:
        """Return the frame to send and advance.

        If CRC_0 would equal the one sent last, the sequence number advances once more, so that
        every new frame differs from its predecessor (collision rule).
        """
        crcs = frame_crcs(self.last, connection_id, self.tx_sequence, command, data)
        if crcs[0] == self.own:
            self.tx_sequence = next_sequence(self.tx_sequence)
            crcs = frame_crcs(self.last, connection_id, self.tx_sequence, command, data)
        self.own = self.last = crcs[0]
        self.tx_sequence = next_sequence(self.tx_sequence)
        return encode_pdu(
            Pdu(command=command, safe_data=data, crcs=crcs, connection_id=connection_id)
        )

    def accept(self, pdu: Pdu) -> bool:
        """Check a received frame; only a right one changes the chain."""
        sequence = self.rx_sequence
        crcs = frame_crcs(self.last, pdu.connection_id, sequence, pdu.command, pdu.safe_data)
        if crcs[0] == self.peer:
            sequence = next_sequence(sequence)
            crcs = frame_crcs(self.last, pdu.connection_id, sequence, pdu.command, pdu.safe_data)
        if crcs != pdu.crcs:
            return False
        self.peer = self.last = crcs[0]
        self.rx_sequence = next_sequence(sequence)
        return True
