"""Captures a start-up of the emulated segment, in a network namespace of its own.

Run as a program: ``capture_rig.py soem|fsn near|far NETWORK CAPTURE``. On ``near`` a listener sees
what comes back only, since MainDevices pass by the queues; on ``far`` what goes out as well.
"""

from __future__ import annotations

import json
import socket
import struct
import subprocess
import sys
import threading
import time

from patience import PATIENCE_S
from segment.peers import Devices, soem
from wires import make_room

from fsoe_net.capture.capture import CaptureWriter

ALL_PROTOCOLS = 3
SOCKET_BYTES = 64 << 20
SOL_PACKET, PACKET_STATISTICS = 263, 6


class Listener:
    """Writes every packet of an interface into a capture."""

    def __init__(self, interface, path):
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_PROTOCOLS))
        make_room(self._socket, SOCKET_BYTES)
        self._socket.bind((interface, ALL_PROTOCOLS))
        self._socket.settimeout(0.1)
        self._writer = CaptureWriter(path, interface=interface)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        """Write until nothing is left: at the end a busy machine's packets still wait in here."""
        while True:
            try:
                data = self._socket.recv(2048)
            except TimeoutError:
                if self._stop.is_set():
                    return
                continue
            self._writer.packet(time.time_ns(), data)

    def end(self):
        """Finish the capture; returns how many packets it lacks."""
        self._stop.set()
        self._thread.join()
        self._writer.close()
        seen = self._socket.getsockopt(SOL_PACKET, PACKET_STATISTICS, 8)
        return struct.unpack("=II", seen)[1]


def fsn(network, capture):
    """Run the network with the MainDevice of this project until its connections are in Data."""
    from live.live_rig import FSN, Emulator

    emulator = Emulator(network)
    try:
        done = subprocess.run(
            [*FSN, "run", network, "--interface", "near", "--wait", "30", "--duration", "3"],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
    finally:
        emulator.end()
    return done.stdout[-2000:] + done.stderr[-2000:]


def main():
    who, where, network, capture = sys.argv[1:5]
    listener = Listener(where, capture)
    if who == "soem":
        devices = Devices(network, None)
        seen = soem(devices)
        devices.end()
    else:
        seen = fsn(network, capture)
    if dropped := listener.end():
        sys.exit(f"the listener was too slow for {dropped} packets")
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
