"""Proves from the frames alone that a receiver had to accept a frame because all CRCs collided.

The receiver's chain is followed through the frames that it received and sent. The CRC of each block
is computed from the fourteen bytes of §2, independently of the receiver.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from fsoe_net.fsoe.chain import Chain, advance, fits_start
from fsoe_net.fsoe.crc import block_crc
from fsoe_net.fsoe.pdu import Command, Pdu, decode_pdu, is_frame_length

_DATA_COMMANDS = frozenset({Command.PROCESS_DATA, Command.FAIL_SAFE_DATA})

_FREE = frozenset({Command.SESSION, Command.CONNECTION})  # the ConnID is not known yet (§4, §6)


class CollisionProof:
    """Follows the chain of one end from its frames.

    Args:
        base: Chain of the end before its first exchange.
        is_main: Whether it is the main.
        exchanges: Its exchanges in order: frame received, frame sent.

    Attributes:
        chain: Its chain after all of them; ``None`` when the frames are inconsistent.
    """

    def __init__(
        self, base: Chain, *, is_main: bool, exchanges: Iterable[tuple[bytes | None, bytes]]
    ) -> None:
        self.chain: Chain | None = base.copy()
        self._opens = is_main
        for received, sent in exchanges:
            if self.chain is None:
                break
            self._follow(self.chain, received, decode_pdu(sent))

    def _follow(self, chain: Chain, received: bytes | None, sent: Pdu) -> None:
        if sent.command == Command.RESET:
            # A Reset starts the chain of both ends from 0.
            chain.clear()
            return
        pdu = decode_pdu(received) if received and is_frame_length(len(received)) else None
        if self._opens and sent.command == Command.SESSION and fits_start(sent):
            chain.clear()  # a new session, whatever frame was received
        # Without a decodable frame, nothing is known about the chain of the receiver.
        elif pdu is None:
            self.chain = None
            return
        else:
            if pdu.command == Command.SESSION and fits_start(pdu):
                chain.clear()
            if not chain.receive(pdu):
                self.chain = None
                return
        # A sender that does not follow the chain is faulty itself: no proof is possible.
        if not _sends(chain, sent):
            self.chain = None


def _sends(chain: Chain, sent: Pdu) -> bool:
    frame = chain.send(sent.command, sent.safe_data, sent.connection_id)
    return decode_pdu(frame) == sent


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """A wrong frame that had to be accepted, with all data needed to verify this.

    Attributes:
        end: ``main`` or ``sub``.
        frame: The accepted frame.
        right: The frame that the other end had sent.
        old_crc: CRC_0 of the preceding frame, in either direction.
        sequence: Sequence number with which every CRC of ``frame`` fits.
    """

    end: str
    frame: bytes
    right: bytes
    old_crc: int
    sequence: int


def collision(chain: Chain, end: str, frame: bytes, right: bytes) -> Collision | None:
    """Return the proof that a receiver with this chain had to accept a frame, if any.

    Command and ConnID must be as expected, and every CRC must match its data.

    Args:
        chain: Chain of the receiver before the frame.
        end: Name of the receiver.
        frame: The accepted frame.
        right: The frame that the other end sent; gives the command and ConnID due.
    """
    # A frame of another length is rejected without checking a CRC.
    if len(frame) != len(right) or not is_frame_length(len(frame)):
        return None
    pdu, due = decode_pdu(frame), decode_pdu(right)
    same_kind = pdu.command == due.command or (
        pdu.command in _DATA_COMMANDS and due.command in _DATA_COMMANDS
    )
    # Some commands carry no ConnID yet.
    if not same_kind or (pdu.command not in _FREE and pdu.connection_id != due.connection_id):
        return None
    sequence = chain.rx_sequence
    crcs = block_crcs(chain.last, sequence, pdu)
    if crcs[0] == chain.peer:  # the collision rule of §3
        sequence = advance(sequence)
        crcs = block_crcs(chain.last, sequence, pdu)
    if crcs != pdu.crcs:
        return None
    return Collision(end=end, frame=frame, right=right, old_crc=chain.last, sequence=sequence)


def block_crcs(old: int, sequence: int, pdu: Pdu) -> tuple[int, ...]:
    """Return the CRCs of a frame for this old CRC and sequence number, from the bytes of §2."""
    data = pdu.safe_data
    return tuple(
        block_crc(old, pdu.connection_id, sequence, pdu.command, n, data[2 * n : 2 * n + 2])
        for n in range(len(pdu.crcs))
    )
