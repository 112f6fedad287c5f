"""Raw frames against a segment on veth pairs, in a network namespace of its own.

Run as a program: ``wire.py CHECK NETWORK``; a check that fails ends with a traceback.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import sys
import time

import pytest
from patience import PATIENCE_S

from fsoe_net.core.segment import Segment, SegmentLink
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.emulate import SegmentSession
from fsoe_net.simulate.session import counted_session_ids

ETHERTYPE = 0x88A4
IGNORE_OUTGOING = 23


def read_frame(command: int, position: int, address: int, size: int, index: int = 0) -> bytes:
    """Return a frame with one datagram that reads."""
    head = bytes.fromhex("ffffffffffff 010101010101 88a4") + struct.pack("<H", 0x1000 | 12 + size)
    body = struct.pack("<BBHHHH", command, index, position, address, size, 0)
    return head + body + bytes(size + 2)


BROADCAST = read_frame(7, 0, 0, 1)


class Port:
    """One port of a MainDevice."""

    def __init__(self, name):
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        self._socket.setsockopt(263, IGNORE_OUTGOING, 1)
        self._socket.bind((name, ETHERTYPE))

    def send(self, frame=BROADCAST):
        self._socket.send(frame)

    def receive(self, patience_s=PATIENCE_S):
        """Return the next frame, ``None`` when there is none for so long."""
        ready, _, _ = select.select([self._socket], [], [], patience_s)
        return self._socket.recv(2048) if ready else None


def counter(frame):
    return int.from_bytes(frame[-2:], "little")


def ring(segment: Segment) -> None:
    segment.link(SegmentLink(interface="far", interface2="far2"))
    first, second = Port("near"), Port("near2")
    first.send()
    assert counter(second.receive()) == 2
    second.send()
    assert counter(first.receive()) == 0
    segment.set_link(0, False)
    for port in (first, second):
        port.send()
        assert counter(port.receive()) == 1
    segment.set_link(0, True)
    first.send()
    assert counter(second.receive()) == 2


def realtime(segment: Segment) -> None:
    try:
        segment.link(SegmentLink(interface="far", priority=10, cpu=0))
    except EnvironmentFault as fault:
        if "CAP_SYS_NICE" not in str(fault):
            raise
        return
    kinds = {os.sched_getscheduler(int(t)) for t in os.listdir("/proc/self/task")}
    assert os.SCHED_FIFO in kinds
    port = Port("near")
    port.send()
    assert counter(port.receive()) == 2
    segment.unlink()
    with pytest.raises(EnvironmentFault, match="1 … 99"):
        segment.link(SegmentLink(interface="far", priority=1000))


def faults(segment: Segment) -> None:
    """Answers that are late, held up, old or missing, as a MainDevice gets them."""
    segment.link(SegmentLink(interface="far"))
    port = Port("near")

    def send(index):
        port.send(read_frame(7, 0, 0, 1, index))

    def index():
        return port.receive()[17]

    segment.set_delay(20_000_000)
    start = time.monotonic_ns()
    send(1)
    send(2)
    assert index() == 1
    assert time.monotonic_ns() - start >= 20_000_000
    assert index() == 2
    segment.set_delay(0)
    start = time.monotonic_ns()
    segment.stall(30_000_000)
    send(3)
    assert index() == 3
    assert time.monotonic_ns() - start >= 25_000_000  # it begins within 5 ms of the call
    segment.repeat(1)
    for number in (4, 5):
        send(number)
    assert [index(), index(), index()] == [4, 5, 4]
    segment.lose(1)
    send(6)
    send(7)
    assert index() == 7
    assert segment.counts().lost == 1


def taken(segment: Segment) -> None:
    """A second segment is refused on an interface, and takes it when the first has let go."""
    other = session_of().segment
    segment.link(SegmentLink(interface="far", interface2="far2"))
    for interface in ("far", "far2"):
        with pytest.raises(EnvironmentFault) as told:
            other.link(SegmentLink(interface=interface))
        assert str(told.value) == (
            f"{interface!r}: Address already in use; another emulation answers there; "
            "end that one first"
        )
    with pytest.raises(EnvironmentFault, match="no such interface: 'eth98'; `ip link`"):
        other.link(SegmentLink(interface="near", interface2="eth98"))
    segment.unlink()
    other.link(SegmentLink(interface="far"))
    Port("near").send()
    other.unlink()


def session_of() -> SegmentSession:
    resolution = resolve(load_network([sys.argv[2]]).network)
    plan = compile_plan(resolution).to_bytes()
    return SegmentSession(resolution, plan, None, session_ids=counted_session_ids())


def main() -> None:
    with session_of().segment as segment:
        checks = {"ring": ring, "realtime": realtime, "faults": faults, "taken": taken}
        checks[sys.argv[1]](segment)


if __name__ == "__main__":
    main()
