"""Writes what a run would put on the wire as a capture file."""

from __future__ import annotations

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.capture.wire import LogicalImage
from fsoe_net.core.core import Core
from fsoe_net.plan.model import Plan

_BACK_NS = 30_000  # a frame on a small segment is back after some microseconds


class BusCapture:
    """Turns the image of every cycle into EtherCAT frames, on their way out and back.

    Args:
        writer: Where they go.
        core: Runs the plan on the emulated bus; nobody else may run a cycle.
        plan: The same plan.
    """

    def __init__(self, writer: CaptureWriter, core: Core, plan: Plan) -> None:
        self._writer = writer
        self._core = core
        self._sizes = [sm.size_bytes for sm in plan.sync_managers]
        self._layout = LogicalImage(plan)
        self._image = bytearray(self._layout.size_bytes)
        self._cycle = 0
        self._sent_ns = 0

    def cycle(self, now_ns: int) -> None:
        """Take the cycle that has just run.

        Its inputs came back in the frame that left with the outputs of the cycle before.
        """
        image = self._core.image()

        def read(sm: int) -> bytes:
            base = self._core.sm_base(sm) or 0
            return image[base : base + self._sizes[sm]]

        layout = self._layout
        layout.gather(read, outputs=False, into=self._image)
        if self._cycle > 0:
            s = self._core.snapshot().statistics
            missing = s.expected_wkc - s.actual_wkc
            for packet in layout.packets(self._image, self._cycle, back=True, missing=missing):
                self._writer.packet(min(self._sent_ns + _BACK_NS, now_ns), packet)
        layout.gather(read, outputs=True, into=self._image)
        self._cycle += 1
        for packet in layout.packets(self._image, self._cycle, back=False):
            self._writer.packet(now_ns, packet)
        self._sent_ns = now_ns
