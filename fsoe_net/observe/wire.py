"""The process data of a plan as EtherCAT frames, laid out as the IgH MainDevice does."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator

from fsoe_net.model import ResolvedEnd
from fsoe_net.plan import Plan, igh_image

__all__ = ["LogicalImage"]

_LRW = 12
_TO_BUS = bytes.fromhex("ffffffffffff 000000000001 88a4")
_FROM_BUS = bytes.fromhex("ffffffffffff 020000000001 88a4")  # a SubDevice has set a bit
_HEAD = struct.Struct("<HBBIHH")
_SHORTEST_BYTES = 60


class LogicalImage:
    """Where each sync manager of a plan lies in the logical address space.

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
        """Return the logical address of one end of a transfer; ``None``: it has no place."""
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
            outputs: Which of the two.
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
            back: On the way back the working counter is complete and a SubDevice has marked the
                source address; on the way out it is 0.
            missing: By how much the working counters fall short of what is expected.
        """
        for datagram in self._domain.datagrams:
            start, size = datagram.offset_bytes, datagram.size_bytes
            head = _HEAD.pack(1 << 12 | (12 + size), _LRW, number & 0xFF, start, size, 0)
            counter = datagram.working_counter if back else 0
            short = min(missing, counter)
            counter, missing = counter - short, missing - short
            data = image[start : start + size] + struct.pack("<H", counter)
            frame = (_FROM_BUS if back else _TO_BUS) + head + data
            yield frame.ljust(_SHORTEST_BYTES, b"\0")
