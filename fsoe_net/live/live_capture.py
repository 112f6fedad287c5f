"""Captures a live bus: from the wire if permitted, otherwise rebuilt from process images."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path

from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.capture.wire import RebuiltFrames
from fsoe_net.core.bus_documents import Layout
from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.client import Client
from fsoe_net.live.packet_socket import PacketSocket

_WAIT_S = 0.1
_WIRE = (
    "EtherCAT frames of {interface} with times of the kernel. Process data that fsn-master sends "
    "bypass the queue of the interface and are not seen on their way out; what comes back holds "
    "outputs and inputs."
)
_REBUILT = (
    "REBUILT by fsoe-net from the process image of fsn-master, not seen on the wire: {why}. One "
    "LRW frame per datagram at logical addresses of the image; times are the beginnings of cycles; "
    "no mailbox, no other datagrams."
)


class LiveCapture:
    """Writes the frames on the bus of a running ``fsn-master`` into a file, in its own thread.

    Args:
        path: The file, pcapng.
        control: Control socket of ``fsn-master``.
        interface: Network interface of the bus; ``None`` if there is none to listen on.
        prefer_wire: Whether to listen on the interface if permitted.

    Raises:
        OSError: The file cannot be written.
        EnvironmentFault: Neither is possible; the message has both reasons.

    Attributes:
        rebuilt: Why the frames are rebuilt; empty for frames from the wire.
        packets: Frames written.
        skipped: Frames or cycles missed because this process was too slow.
        fault: Why the capture ended early; empty until then.
    """

    def __init__(
        self, path: str | Path, control: str, interface: str | None, *, prefer_wire: bool = True
    ) -> None:
        self.rebuilt = self.fault = ""
        self.packets = self.skipped = 0
        self._control = control
        self._stop = threading.Event()
        self._wire: PacketSocket | None = None
        if not prefer_wire:
            self.rebuilt = "as requested"
        elif interface is None:
            self.rebuilt = "no socket sees the frames of the cycle"
        else:
            # Needs CAP_NET_RAW. Without it, frames are rebuilt from the process images of
            # fsn-master.
            try:
                self._wire = PacketSocket(interface)
            except OSError as exc:
                self.rebuilt = f"listening on {interface}: {exc.strerror or exc}"
        self._client: Client | None = None
        self._frames: RebuiltFrames | None = None
        if self._wire is None:
            self._attach()
        text = (
            _REBUILT.format(why=self.rebuilt) if self.rebuilt else _WIRE.format(interface=interface)
        )
        try:
            self._writer = CaptureWriter(path, comment=text, interface=interface or "")
        except OSError:
            # The socket is already open; it must not stay open if the file cannot be written.
            self._close_sources()
            raise
        self._thread = threading.Thread(target=self._run, name="capture", daemon=True)
        self._thread.start()

    def _attach(self) -> None:
        """Subscribe to every image.

        Raises:
            EnvironmentFault: The images are not available.
        """
        client = Client(self._control)
        try:
            self._frames = _frames(client.layout())
            client.watch_on(every=1, image=True)
        except EnvironmentFault as fault:
            client.close()
            raise EnvironmentFault(
                f"no capture: {self.rebuilt}; and the process image is not reported: {fault}"
            ) from fault
        self._client = client
        # Cycles have monotonic times, a capture counts from 1970.
        self._epoch_ns = time.time_ns() - time.monotonic_ns()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._take(_WAIT_S)
            # Once more without waiting: packets that arrived before `stop` belong to the file.
            self._take(0.0)
        except OSError as exc:
            self.fault = exc.strerror or str(exc)
        except ValueError as exc:
            self.fault = str(exc)
        finally:
            self._close_sources()
            try:
                self._writer.close()
            except OSError as exc:  # a full disk is noticed when the last bytes are written
                self.fault = self.fault or exc.strerror or str(exc)

    def _take(self, wait_s: float) -> None:
        if self._wire is not None:
            for packet in self._wire.packets(wait_s):
                self._writer.packet(packet.time_ns, packet.data, outbound=packet.outbound)
                self.packets += 1
            self.skipped = self._wire.dropped
        elif self._client is not None:
            # fsn-master may be restarted during a capture; the file then has a gap, not an end.
            try:
                self._images(self._client, wait_s)
            except EnvironmentFault:
                self._client.close()
                self._client = None
        # Retried more slowly than reading, because each attempt is a connection.
        elif not self._stop.wait(5 * wait_s):
            with contextlib.suppress(EnvironmentFault):  # it stopped; wait for the next one
                self._attach()

    def _images(self, client: Client, wait_s: float) -> None:
        for seen in client.watched(wait_s):
            self.skipped += seen.skipped
            if seen.image is None or self._frames is None:
                continue
            wkc = (seen.expected_wkc, seen.actual_wkc)
            for at_ns, packet, out in self._frames.cycle(seen.image, seen.cycle, seen.now_ns, wkc):
                self._writer.packet(self._epoch_ns + at_ns, packet, outbound=out)
                self.packets += 1

    def _close_sources(self) -> None:
        if self._wire is not None:
            self._wire.close()
        if self._client is not None:
            self._client.close()

    def to_json(self) -> dict[str, object]:
        """Return the outcome (``docs/reference/json-output.md``)."""
        return {
            "rebuilt": self.rebuilt or None,
            "frames": self.packets,
            "missed": self.skipped,
            "fault": self.fault or None,
        }

    def stop(self) -> None:
        """End the capture and complete the file. Idempotent."""
        self._stop.set()
        self._thread.join()


def _frames(layout: Layout) -> RebuiltFrames:
    return RebuiltFrames(
        [(d.offset_bytes, d.size_bytes, d.expected_wkc) for d in layout.datagrams],
        [(sm.offset_bytes, sm.size_bytes) for sm in layout.sms if sm.is_output],
        layout.image_bytes,
    )
