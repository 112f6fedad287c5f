"""Cases of `live_rig.py` with the run as a node of ROS 2, and as hardware of ros2_control."""

from __future__ import annotations

import signal
import time

from ros2.rig import Peer, System, bridged, typestore
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


def adapter(network, program):
    """The e-stop is pressed and reset, then the cable is cut: what ros2_control sees of it."""
    emulator = Emulator(network)
    running = Running(network)
    rows = ("get el1918-ek1914/in_data", "get el1918-ek1914/state")
    names = [f"s:{row.partition(' ')[2]}" for row in rows]
    inputs = [f"ek1914.0x6001:0{n}" for n in (1, 2)]

    def reset_the_logic():
        for word in ("release", "press"):  # a person's reset counts once everything else is there
            emulator.do(word)

    with System(program, f"socket={running.socket}", "lost_ms=500", *names) as system:
        system.goes("init", "configure", "activate")
        while system.ask(rows[1]) != "6":
            assert system.ask("cycle 50") == "OK"
            reset_the_logic()
        for name in inputs:
            emulator.do(f"set {name} 0")
        system.until(rows[1], "5")
        seen = {"pressed": [system.ask(row) for row in rows]}
        for name in inputs:
            emulator.do(f"set {name} 1")
        while system.ask(rows[1]) != "6":
            assert system.ask("cycle 50") == "OK"
            reset_the_logic()
        seen["released"] = [system.ask(row) for row in rows]
        emulator.do("cut ek1914")
        while (answer := system.ask("cycle 1")) == "OK":
            pass
        seen["cut"] = answer
        emulator.do("splice ek1914")
        system.ask("cleanup")
        while system.ask("configure") != "SUCCESS":
            pass
        system.goes("activate")
        while system.ask(rows[0]) != "1":
            system.ask("cycle 5")
        seen["back"] = system.ask(rows[0])
        seen["said"] = system.end()
    running.end(signal.SIGINT)
    emulator.end()
    return seen


CASES |= {"adapter": adapter, "reset": reset}

if __name__ == "__main__":
    main()
