"""EtherCAT packets made by hand, and a bus whose process data hold FSoE connections."""

from __future__ import annotations

import itertools
import random
import struct

from fsoe.pair import counted, make_main, make_sub

from fsoe_net.fsoe.pdu import frame_length

LRD, LWR, LRW, FPRD = 10, 11, 12, 4
MAC = bytes.fromhex("010105010000 020000000001")


def datagram(command, address, data, counter, more=False):
    head = struct.pack("<BBIHH", command, 0, address, len(data) | (0x8000 if more else 0), 0)
    return head + data + struct.pack("<H", counter)


def packet(*datagrams, vlan=False, udp=False):
    body = b"".join(datagrams)
    ethercat = struct.pack("<H", 0x1000 | len(body)) + body
    if udp:
        length = len(ethercat)
        ip = struct.pack(
            ">BBHHHBBH4s4s", 0x45, 0, 28 + length, 0, 0, 64, 17, 0, b"\xc0\xa8\0\1", b"\xff" * 4
        )
        return MAC + b"\x08\0" + ip + struct.pack(">HHHH", 0x88A4, 0x88A4, 8 + length, 0) + ethercat
    return MAC + (b"\x81\0\0\5" if vlan else b"") + b"\x88\xa4" + ethercat


def cut(data, *places):
    """Return a packet of one logical datagram with its image cut into several; see `packet`."""
    at = 26 - 10
    command, _, address, length = struct.unpack_from("<BBIH", data, at)
    image = data[at + 10 : at + 10 + (length & 0x7FF)]
    (counter,) = struct.unpack_from("<H", data, at + 10 + len(image))
    ends = [0, *sorted(places), len(image)]
    rows = [
        datagram(command, address + first, image[first:last], counter, more=last != len(image))
        for first, last in itertools.pairwise(ends)
    ]
    body = b"".join(rows)
    return data[: at - 2] + struct.pack("<H", 0x1000 | len(body)) + body


class Bus:
    """A relayed connection in process data full of other things.

    Each cycle is one datagram: outputs go out as copied from the inputs of the cycle before, and
    the inputs come back as the ends have left them. A frame of the main stands at ``main_at`` and
    one cycle later, for the sub, at ``main_copy_at``; those of the sub likewise. The ends in
    ``quick`` answer in the very cycle in which the copy reaches them; 0 is the main.
    """

    def __init__(self, out=1, inn=1, *, connection_id=7, noise=True, seed=0, size=200, quick=()):
        self.quick = quick
        self.main = make_main(out, inn, ids=counted(77 + seed), connection_id=connection_id)
        self.sub = make_sub(out, inn, ids=counted(99 + seed))
        self.rng = random.Random(seed)
        self.noise = noise
        self.size = size
        self.main_at, self.sub_at = 20, 60
        self.main_copy_at, self.sub_copy_at = 100, 150
        self.inputs = [bytes(frame_length(out)), bytes(frame_length(inn))]
        self.outputs = list(self.inputs)
        self.now_ns = 0
        self.sent = []

    def image(self) -> bytes:
        """Return the process data of the next cycle."""
        self.now_ns += 1_000_000
        data = bytearray(self.rng.randbytes(self.size) if self.noise else bytes(self.size))
        for way in self.quick:
            self._step(way)
        shown = list(self.inputs)
        for at, frame in (
            (self.main_at, shown[0]),
            (self.sub_at, shown[1]),
            (self.main_copy_at, self.outputs[0]),
            (self.sub_copy_at, self.outputs[1]),
        ):
            data[at : at + len(frame)] = frame
        for way in {0, 1}.difference(self.quick):
            self._step(way)
        self.outputs = shown
        return bytes(data)

    def _step(self, way):
        end = (self.main, self.sub)[way]
        end.enable = end.state.value == "Data"
        end.set_safe_data(self.rng.randbytes(end._sends))
        frame = end.step(self.now_ns, self.outputs[1 - way])
        if frame is not None:
            self.inputs[way] = frame
            self.sent.append((way, frame))
