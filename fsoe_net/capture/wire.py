"""The process data of a plan as EtherCAT frames, laid out as the IgH MainDevice does."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator

from fsoe_net.model.transfer_ends import ResolvedEnd
from fsoe_net.plan.image import igh_image
from fsoe_net.plan.model import Plan

_LRW = 12
_TO_BUS = bytes.fromhex("ffffffffffff 000000000001 88a4")
_FROM_BUS = bytes.fromhex("ffffffffffff 020000000001 88a4")  # a SubDevice has set a bit
_HEAD = struct.Struct("<HBBIHH")
# Minimum Ethernet frame length without the checksum.
_SHORTEST_BYTES = 60


class LogicalImage:
    """The position of each sync manager of a plan in the logical address space.

    Args:
        plan: A plan with registered process data.

    Attributes:
        size_bytes: Length of the image.
    """

    def __init__(self, plan: Plan) -> None:
        domain = igh_image(plan)
        self._domain = domain
        self.size_bytes = domain.size_bytes
        self._plan = plan
        self._bases = {f.sm: f.offset_bytes for f in domain.fmmus}

    def address(self, end: ResolvedEnd) -> int | None:
        """Return the logical address of one end of a transfer, or ``None`` if it has none."""
        for sm, base in self._bases.items():
            record = self._plan.sync_managers[sm]
            owner = self._plan.subdevices[record.subdevice].name
            if end.sm and (owner, record.index) == (end.endpoint.module, end.sm.sm.index):
                return base + end.byte_offset
        return None

    def gather(self, read: Callable[[int], bytes], *, outputs: bool, into: bytearray) -> None:
        """Fill the outputs or the inputs of an image.

        Args:
            read: Returns the bytes of a sync manager by record number.
            outputs: Whether to fill the outputs; otherwise the inputs.
            into: The image, `size_bytes` long.
        """
        for f in self._domain.fmmus:
            if f.is_output is outputs:
                into[f.offset_bytes : f.offset_bytes + f.size_bytes] = read(f.sm)

    def packets(
        self, image: bytes | bytearray, number: int, *, back: bool, missing: int = 0
    ) -> Iterator[bytes]:
        """Yield the Ethernet frames that carry an image, one datagram each.

        Args:
            image: The process data.
            number: Number of the cycle, for the datagram index.
            back: Whether the frames are on the way back: then the working counter is complete and a
                SubDevice has marked the source address. Otherwise it is 0.
            missing: Difference between the expected and the actual working counters.
        """
        rows = [(d.offset_bytes, d.size_bytes, d.working_counter) for d in self._domain.datagrams]
        return image_packets(rows, image, number, back=back, missing=missing)


def image_packets(
    datagrams: Iterable[tuple[int, int, int]],
    image: bytes | bytearray,
    number: int,
    *,
    back: bool,
    missing: int = 0,
) -> Iterator[bytes]:
    """Yield Ethernet frames that carry an image, one LRW datagram each.

    Args:
        datagrams: Offset, length and complete working counter of each.
        image: The process data.
        number: See `LogicalImage.packets`.
        back: See `LogicalImage.packets`.
        missing: See `LogicalImage.packets`.
    """
    for start, size, complete in datagrams:
        # EtherCAT header: type 1, and the length with datagram header (10) and counter (2).
        head = _HEAD.pack(1 << 12 | (12 + size), _LRW, number & 0xFF, start, size, 0)
        counter = complete if back else 0
        short = min(missing, counter)
        counter, missing = counter - short, missing - short
        data = image[start : start + size] + struct.pack("<H", counter)
        frame = (_FROM_BUS if back else _TO_BUS) + head + data
        yield frame.ljust(_SHORTEST_BYTES, b"\0")


class RebuiltFrames:
    """Converts images of successive cycles to frames on their way out and back.

    Args:
        datagrams: Offset, length and complete working counter of each; ``None`` if unknown.
        outputs: Offset and length of the outputs.
        image_bytes: Length of an image.
    """

    def __init__(
        self,
        datagrams: Iterable[tuple[int, int, int | None]],
        outputs: Iterable[tuple[int, int]],
        image_bytes: int,
    ) -> None:
        self._datagrams = tuple(datagrams)
        self._outputs = tuple(outputs)
        self._image_bytes = image_bytes
        self._sent: bytearray | None = None
        self._sent_ns = 0
        self._sent_number = -1

    def cycle(
        self, image: bytes, number: int, now_ns: int, wkc: tuple[int, int]
    ) -> Iterator[tuple[int, bytes, bool]]:
        """Yield the frames of one cycle: time, packet, whether it is outbound.

        An image has the values at the end of its cycle: received inputs and the outputs to send
        next. Its inputs therefore belong to the outputs of the previous cycle. If that cycle is
        missing, the returning frame is omitted.

        Args:
            image: The process data at the end of the cycle.
            number: Number of the cycle.
            now_ns: Start time of the cycle.
            wkc: Expected and actual working counter of the cycle.

        Raises:
            ValueError: The image has another length.
        """
        if len(image) != self._image_bytes:
            raise ValueError(f"an image of {len(image)} bytes, not {self._image_bytes}")
        expected, actual = wkc
        rows = [(o, s, actual if c is None else c) for o, s, c in self._datagrams]
        if self._sent is not None and self._sent_number == number - 1:
            came = bytearray(image)
            for offset, size in self._outputs:
                came[offset : offset + size] = self._sent[offset : offset + size]
            missing = max(0, expected - actual)
            # The return time is unknown; a time just before the next cycle keeps the order.
            at_ns = max(self._sent_ns, now_ns - 1)
            for packet in image_packets(rows, came, number - 1, back=True, missing=missing):
                yield at_ns, packet, False
        for packet in image_packets(rows, image, number, back=False):
            yield now_ns, packet, True
        self._sent, self._sent_ns, self._sent_number = bytearray(image), now_ns, number
