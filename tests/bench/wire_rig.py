"""Devices that return each frame: what `fsoe-net bench --interface near` sends to them.

Run as a program in a network namespace with one cable: ``wire_rig.py returned|lost|foreign``.
Prints the commands of all datagrams, the lengths of their data, and the result or the fault.
"""

from __future__ import annotations

import json
import socket
import sys
import threading

from fsoe_net.bench.wire import measure_wire
from fsoe_net.errors import EnvironmentFault

ETHERCAT, MORE = 0x88A4, 0x8000
FOREIGN = b"\xff" * 6 + b"\x02\0\0\0\0\1\x88\xa4\x0d\x10" + bytes(48)


class Devices:
    """The far end: takes each frame apart by the layout of ETG.1000.4, and may return it."""

    def __init__(self, *, returns: bool) -> None:
        self.commands: set[int] = set()
        self.lengths: set[int] = set()
        self._returns = returns
        self._wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERCAT))
        self._wire.bind(("far", ETHERCAT))
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            frame, address = self._wire.recvfrom(2048)
            if address[2] == socket.PACKET_OUTGOING:
                continue
            self._note(frame)
            if self._returns:
                self._wire.send(frame)

    def _note(self, frame: bytes) -> None:
        at, more = 16, True
        while more:
            word = int.from_bytes(frame[at + 6 : at + 8], "little")
            more = bool(word & MORE)
            self.commands.add(frame[at])
            self.lengths.add(word & 0x7FF)
            at += 12 + (word & 0x7FF)


def send_foreign(over: threading.Event) -> None:
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW) as wire:
        wire.bind(("far", 0))
        while not over.wait(0.005):
            wire.send(FOREIGN)


def main() -> None:
    case, over = sys.argv[1], threading.Event()
    devices = Devices(returns=case == "returned")
    if case == "foreign":
        threading.Thread(target=send_foreign, args=(over,), daemon=True).start()
    row: dict[str, object] = {}
    try:
        wire, times = measure_wire(1_000_000, 1.0, "near")
        row["loops"] = {name: loop.cycles for name, loop in wire.paced.items()}
        row["times"] = {name: value.count for name, value in times.items()}
        row["free"] = len(wire.free)
    except EnvironmentFault as fault:
        row["fault"] = str(fault)
    over.set()
    row |= {"commands": sorted(devices.commands), "lengths": sorted(devices.lengths)}
    print(json.dumps(row))


if __name__ == "__main__":
    main()
