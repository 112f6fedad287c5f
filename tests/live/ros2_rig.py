"""Cases of `live_rig.py` with the run as a node of ROS 2, and as hardware of ros2_control."""

from __future__ import annotations

import signal
import time

from live.live_rig import CASES, Emulator, Running, main
from ros2.caller import Caller
from ros2.rig import Peer, System, bridged, typestore

from fsoe_net.live.client import Client
from fsoe_net.ros2 import messages

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
        while "last Reset: " not in rows[name].message:  # its AL state may be first
            _, rows = next(found)
        seen = {"after_s": at_s - cut_s}
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


def objects(network, _other):
    """A node reads the identity of a drive, and writes objects that may and may not be written."""
    emulator = Emulator(network)
    running = Running(network)
    with bridged(running.socket, allow_control=True) as domain:
        get = Caller(domain, "/cell/get_sdo", messages.GetSdoRequest, messages.GetSdoResponse)
        put = Caller(domain, "/cell/set_sdo", messages.SetSdoRequest, messages.SetSdoResponse)
        seen = {
            "vendor": get.call(0, 4, 0x1018, 1, "uint32").sdo_return_value,
            "missing": get.call(0, 4, 0x2FFF, 1, "uint32").sdo_return_message,
            "written": [
                put.call(0, 4, index, 0, "uint32", "1234").success
                for index in (0x6083, 0xF980 - 0x10000, 0x6610)
            ],
        }
        seen["then"] = get.call(0, 4, 0x6083, 0, "uint32").sdo_return_value
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
        system.until(rows[0], "0")
        seen["without_it"] = system.ask(rows[0])
        emulator.do("splice ek1914")
        system.until(rows[0], "1")
        system.goes("activate", "cycle 50")
        seen["back"] = system.ask(rows[0])
        seen["said"] = system.end()
    running.end(signal.SIGINT)
    emulator.end()
    return seen


def axis(network, program, scenario):
    """A drive is commanded while it is disabled, then enabled, moved and released."""
    emulator = Emulator(network, "--scenario", scenario)
    running = Running(network)
    reader = Client(running.socket)
    position, control, mode = (
        f"axis_1/{w}" for w in ("position", "control_word", "mode_of_operation")
    )
    names = [f"c:{position}", f"c:{control}", f"c:{mode}", f"s:{position}", "s:axis_1/status_word"]

    def target():
        return reader.get("axis_1.position").outputs["axis_1.position"]

    def actual():
        return reader.get("axis_1.position").inputs["axis_1.position"]

    with System(
        program, f"socket={running.socket}", "misses=1000", "lost_ms=2000", *names
    ) as system:
        system.goes("init", "configure", "activate")
        system.until(f"get {position}", "16384")
        system.goes(f"start {position}", f"set {position} 100000")
        system.sends(lambda: target() == 100000)
        system.goes("cycle 50")
        seen = {
            "disabled": {
                "state": system.ask(f"get {position}"),
                "sent": target(),
                "actual": actual(),
            }
        }
        system.goes(f"stop {position}", f"set {position} 100000")
        system.sends(lambda: target() != 100000)
        seen["released"] = target()
        system.goes(f"start {control} {mode}", f"set {mode} 8")
        states = {0x21: 7, 0x23: 15}
        while (state := int(float(system.ask("get axis_1/status_word"))) & 0x6F) != 0x27:
            if state & 0x4F == 0x40:  # a person's reset lets the logic give the torque back
                for word in ("release", "press"):
                    emulator.do(word)
            system.goes(f"set {control} {states.get(state, 6)}", "cycle 20")
        system.goes("cycle 20")
        seen["enabled"] = target()
        system.goes(f"start {position}", f"set {position} 20000")
        system.sends(lambda: abs(actual() - 20000) <= 2)
        seen["moved"] = actual()
        system.goes(f"set {position} 40000")  # a third of a revolution takes a while
        system.sends(lambda: target() == 40000)
        seen["late"] = actual() < 39000
        system.goes(f"stop {position}", f"set {position} 30000", "cycle 20")
        seen["held"] = target()
        system.goes(f"start {position}", f"set {position} 21000")
        system.sends(lambda: target() == 21000)
        system.goes(f"set {position} nan", "cycle 20")
        seen["not_a_number"] = target()
    running.end(signal.SIGINT)
    emulator.end()
    return seen


CASES |= {"adapter": adapter, "axis": axis, "objects": objects, "reset": reset}

if __name__ == "__main__":
    main()
