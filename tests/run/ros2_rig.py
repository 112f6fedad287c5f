"""A case of `live_rig.py` with the run as a node of ROS 2, read by another vendor's DDS."""

from __future__ import annotations

import signal
import time

from ros2.rig import Peer, bridged, typestore
from run.live_rig import CASES, Emulator, Running, main

ARRAY = "diagnostic_msgs::msg::dds_::DiagnosticArray_"


def reset(network, _other):
    """The cable behind the first SubDevice is cut: when is it an ERROR there?"""
    store = typestore()
    emulator = Emulator(network)
    running = Running(network)
    with (
        bridged(running.socket) as domain,
        Peer("listen", domain, "rt/diagnostics", ARRAY, 100_000) as peer,
    ):

        def arrays():
            for payload in peer.payloads():
                array = store.deserialize_cdr(payload, "diagnostic_msgs/msg/DiagnosticArray")
                stamp = array.header.stamp
                rows = {row.name.removeprefix("cell: "): row for row in array.status}
                yield stamp.sec + stamp.nanosec / 1e9, rows

        found = arrays()
        for _, rows in found:
            if all(row.level <= 1 for row in rows.values()):
                break
        emulator.do("cut ek1914")
        cut_s = time.time()
        (name,) = (name for name in rows if name.startswith("connection "))
        at_s, rows = next(picture for picture in found if picture[1][name].level == 2)
        seen = {"after_s": at_s - cut_s, "text": rows[name].message}
        for _, rows in found:  # a SubDevice is polled more slowly
            if rows["SubDevice el1918"].level == 2:
                break
        emulator.do("splice ek1914")
        for _, rows in found:
            if all(row.level <= 1 for row in rows.values()):
                break
    running.end(signal.SIGINT)
    emulator.end()
    return seen


CASES |= {"reset": reset}

if __name__ == "__main__":
    main()
