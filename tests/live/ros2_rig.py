"""Cases of `live_rig.py` with the run as a node of ROS 2, and as hardware of ros2_control."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from live.live_rig import CASES, Emulator, Running, main, wait_for
from ros2.caller import Caller
from ros2.rig import Peer, System, bridged, typestore

from fsoe_net.errors import FsnError
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master
from fsoe_net.ros2 import messages

HARDWARE = "control_msgs::msg::dds_::HardwareStatus_"
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
        begun_s = time.time()
        emulator.do("cut ek1914")
        cut_s = time.time()
        (name,) = (name for name in rows if name.startswith("connection "))
        at_s, rows = next(picture for picture in found if picture[1][name].level == 2)
        while "last Reset: " not in rows[name].message:  # its AL state may be first
            _, rows = next(found)
        seen = {"after_s": at_s - cut_s, "since_s": at_s - begun_s}
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


def hardware(network, _other):
    """What another vendor's DDS reads as HardwareStatus: in operation, and with a cut cable."""
    store = typestore()
    emulator = Emulator(network)
    running = Running(network)
    with (
        bridged(running.socket) as domain,
        Peer("listen", domain, "rt/cell/hardware_status", HARDWARE, 100_000) as peer,
    ):

        def rows():
            for payload in peer.payloads():
                status = store.deserialize_cdr(payload, "control_msgs/msg/HardwareStatus")
                yield {device.device_id: facts(device) for device in status.hardware_device_states}

        def facts(device):
            (state,), (ethercat,) = device.hardware_status, device.ethercat_states
            details = {row.key: row.value for row in state.state_details}
            return {
                "identity": [ethercat.vendor_id, ethercat.product_code],
                "al": [ethercat.al_state, ethercat.has_error, ethercat.al_status_code],
                "connectivity": state.connectivity_status,
                "health": state.health_status,
                "fsoe": details["FSoE el1918-ek1914"],
            }

        found = rows()
        seen = {"running": next(row for row in found if row["ek1914"]["fsoe"].startswith("data_"))}
        emulator.do("cut ek1914")
        seen["cut"] = next(row for row in found if row["el1918"]["connectivity"] == 2)
        states = (row["ek1914"]["fsoe"] for row in found)
        seen["ended"] = next(state for state in states if not state.startswith("data_"))
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
        system.until(rows[0], "1")
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
        for _ in range(2):  # it may go a little beyond, and returns
            system.sends(lambda: abs(actual() - 20000) <= 2)
            system.goes("cycle 100")
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


class Drive:
    """Emulated drives, the fsn-master on their bus, and a client that reads their objects."""

    ENABLED, DISABLED, FAULT = 0x27, 0x40, 0x08

    def __init__(self, network, scenario, cable=""):
        self.emulator = Emulator(network, "--scenario", scenario, interfaces=(f"far{cable}",))
        self.network, self.near = network, f"near{cable}"
        self.socket = Path(tempfile.gettempdir(), self.near)
        self.start_master()

    def start_master(self):
        """Start an fsn-master; `socket` leads to the last one."""
        self.running = Running(self.network, interfaces=(self.near,))
        self.client = Client(self.running.socket)
        self.socket.unlink(missing_ok=True)
        self.socket.symlink_to(self.running.socket)

    def object(self, index, drive="axis_1"):
        """Return an object of an emulated drive, or of what was sent to it."""
        entry, side = OBJECTS[index]
        name = f"{drive}.{entry}"
        return getattr(self.client.get(name), side)[name]

    def state(self, drive="axis_1"):
        return state_of(self.object(0x6041, drive))

    def has_sto(self, drive="axis_1"):
        def read():
            with suppress(FsnError):  # a busy machine: no answer in time
                return self.client.sdo_read(drive, 0x60FD, 0, "uint32")

        return bool(wait_for("digital inputs", read).value >> 31)

    def press_stop(self, *, pressed):
        """Press the e-stop, or release it."""
        for number in (1, 2):
            self.emulator.do(f"set el1904.0x6001:0{number} {0 if pressed else 1}")

    def end(self):
        self.running.end(signal.SIGINT)
        self.emulator.end()


class DrivenAxis(Drive):
    """A joint of ros2_control whose SubDevice axis_1 is driven by CiA 402, and the drive itself."""

    def __init__(self, network, program, scenario, *commands, params=()):
        super().__init__(network, scenario)
        words = ["subdevice=axis_1", "axis=axis_1", "max_velocity=0.5", *params]
        words = [f"p:shoulder/{word}" for word in words]
        words += [f"c:shoulder/{name}" for name in ("position", *commands)]
        socket = f"socket={self.running.socket}"
        words += ["s:shoulder/position", "s:shoulder/velocity"]
        self.system = System(program, socket, "misses=1000", "lost_ms=2000", *words)
        self.system.goes("init", "configure", "activate")

    def facts(self):
        """State, target and actual position of the drive, and the position of the joint."""
        self.system.goes("cycle 1")
        joint = float(self.system.ask("get shoulder/position"))
        return [self.state(), self.object(0x607A), self.object(0x6064), joint]

    def until_state(self, *states):
        self.system.sends(lambda: self.state() in states)

    def acknowledge(self):
        """Press the reset button of the safety logic until the drive may have torque."""
        while self.has_sto():
            for word in ("release", "press"):
                self.emulator.do(word)
                self.system.goes("cycle 10")

    def enable(self, name="position"):
        """Claim a command; again if a busy machine has made the safety logic take the torque."""
        while (state := self.state()) != self.ENABLED:
            if state == self.FAULT:  # it has left OP before the safety logic took the torque
                sys.exit("the drive has a fault: a busy machine")
            self.acknowledge()
            self.system.goes(f"start shoulder/{name}", "cycle 50")

    def moves(self, index, lowest, highest):
        """Run cycles until an object of the enabled drive is between two values."""

        def arrived():
            assert self.state() == self.ENABLED
            return lowest <= self.object(index) <= highest

        self.system.sends(arrived)

    def stays(self):
        """Run cycles for long enough to enable a drive that may; return its facts."""
        self.acknowledge()
        self.system.goes("cycle 300")
        return self.facts()

    def end(self):
        said = self.system.end()
        super().end()
        return said


OBJECTS = {
    0x6041: ("status_word", "inputs"),
    0x6064: ("position", "inputs"),
    0x606C: ("velocity", "inputs"),
    0x6077: ("effort", "inputs"),
    0x607A: ("position", "outputs"),
}


def state_of(statusword):
    """Return the bits of the state of a drive."""
    return statusword & (0x6F if statusword & 0x20 else 0x4F)


def cia402(network, program, scenario):
    """Claimed, moved, commanded beyond its limit, stopped by the safety logic, and in fault."""
    axis = DrivenAxis(network, program, scenario, "reset_fault")
    system = axis.system
    system.sends(lambda: axis.object(0x607A) == 16384)
    seen = {"unclaimed": axis.stays()}
    axis.enable()
    seen["claimed"] = axis.stays()
    system.goes("set shoulder/position -1.3708")
    axis.moves(0x6064, 14290, 14306)
    seen["moved"] = axis.stays()
    system.goes("set shoulder/position 1")
    axis.until_state(axis.DISABLED)
    seen["jump"] = axis.stays()
    axis.enable()
    system.goes("set shoulder/position -1.3")
    axis.moves(0x6064, 13551, 13567)
    axis.press_stop(pressed=True)
    system.sends(axis.has_sto)
    axis.press_stop(pressed=False)
    seen["e-stop"] = axis.stays()
    axis.enable()
    axis.emulator.do("drive-fault axis_1 0x2310")
    axis.until_state(axis.FAULT)
    system.goes("cycle 50", "start shoulder/position")  # the component has seen the fault by then
    seen["fault"] = axis.stays()
    system.goes("start shoulder/reset_fault", "set shoulder/reset_fault 1")
    axis.until_state(axis.DISABLED)
    seen["reset"] = axis.stays()
    axis.enable()
    return seen | {"again": axis.facts(), "said": axis.end()}


def cia402_lost(network, program, scenario):
    """The bus is lost and returns, and fsn-master is frozen for a while: nothing starts."""
    axis = DrivenAxis(network, program, scenario)
    seen = {}

    def frozen():
        os.kill(axis.running.pid, signal.SIGSTOP)
        yield
        os.kill(axis.running.pid, signal.SIGCONT)

    def cut():
        axis.emulator.do("cut main")
        yield
        axis.emulator.do("splice main")

    for name, loss in (("cut", cut), ("frozen", frozen)):
        axis.enable()
        axis.system.goes("set shoulder/position -1.5")
        axis.moves(0x6064, 15638, 15654)
        returns = loss()
        next(returns)
        while (answer := axis.system.ask("cycle 1")) == "OK":
            pass
        next(returns, None)
        wait_for("the bus", axis.running.in_data)
        while axis.system.ask("activate") != "SUCCESS":
            axis.system.goes("cycle 50")
        seen[name] = [answer, axis.stays()]
    axis.enable()
    return seen | {"claimed": axis.stays(), "said": axis.end()}


def cia402_modes(network, program, scenario):
    """Velocity and homing, by commands of a controller; a fault is reset by itself."""
    modes = ("velocity", "effort", "mode_of_operation", "home")
    params = ("auto_fault_reset=true", "max_velocity=70000", "max_effort=100")
    axis = DrivenAxis(network, program, scenario, *modes, params=params)
    system = axis.system
    axis.client.sdo_write("axis_1", 0x6098, 0, kind="int8", value=37)  # the position is the home
    system.goes("start shoulder/mode_of_operation", "set shoulder/mode_of_operation 9")
    axis.enable("velocity")
    system.goes("set shoulder/velocity 65536")
    axis.moves(0x606C, 60000, 70000)
    seen = {"turns": axis.object(0x606C)}
    system.goes("set shoulder/velocity 70001")  # beyond max_velocity
    axis.until_state(axis.DISABLED)
    axis.enable("velocity")
    system.goes("set shoulder/velocity 65536")
    axis.moves(0x606C, 60000, 70000)
    system.goes("stop shoulder/velocity")
    axis.moves(0x606C, -300, 300)
    seen["released"] = axis.state()
    system.goes("set shoulder/mode_of_operation 6", "start shoulder/home", "cycle 50")
    seen["homing waits"] = axis.facts()
    system.goes("set shoulder/home 1")
    axis.moves(0x6064, -20, 20)
    seen["home"] = axis.stays()
    system.goes("set shoulder/mode_of_operation 1", "start shoulder/position")
    for radians, counts in ((0.3, -3129), (-0.3, 3129)):  # set-points of any distance
        system.goes(f"set shoulder/position {radians}")
        axis.moves(0x6064, counts - 20, counts + 20)
    system.goes(
        "set shoulder/mode_of_operation 10", "start shoulder/effort", "set shoulder/effort 20"
    )
    axis.moves(0x6077, 15, 25)
    seen["torque"] = axis.object(0x6077)
    system.goes("set shoulder/effort 0", "set shoulder/mode_of_operation 3")
    axis.moves(0x606C, -300, 300)
    axis.emulator.do("drive-fault axis_1 0x2310")
    axis.until_state(axis.DISABLED)
    seen["reset"] = axis.stays()
    return seen | {"said": axis.end()}


def driver(urdf, program, scenario):
    """A robot of the driver without FSoE: its own fsn-master, and a drive that is not at 0."""
    emulator = Emulator(urdf, "--scenario", scenario)
    socket = Path("s").absolute()
    words = ["class=EthercatDriver", f"urdf={urdf}", f"socket={socket}", "interface=near"]
    words += ["bus=soem", "misses=1000", "lost_ms=2000", f"fsoe_net={FSOE_NET}"]
    with System(program, *words, f"fsn_master={find_master()}") as system:
        system.goes("init", "configure", "activate")
        drive = Client(socket)

        def facts():
            values = drive.get("axis.0x6041:00", "axis.position")
            joint = float(system.ask("get elbow/position"))
            state = values.inputs["axis.0x6041:00"] & 0x6F
            return [state, values.outputs["axis.position"], values.inputs["axis.position"], joint]

        def reaches(state, counts):
            def is_there():
                found, target, actual, _ = facts()
                return [found, target] == [state, counts] and abs(actual - counts) < 20

            system.sends(is_there)
            system.goes("cycle 300")  # until it rests, and the joint is read after it
            return facts()

        system.sends(lambda: facts()[1] == 16384)
        system.goes("cycle 300")
        seen = {"unclaimed": facts()}
        system.goes("start elbow/position")
        reaches(0x27, 16384)
        system.goes("set elbow/position -1.3")
        seen["moved"] = reaches(0x27, 13559)
        system.goes("cleanup")
        seen |= {"ended": not socket.exists(), "said": system.end()}
    emulator.end()
    return seen


FSOE_NET = Path(sys.executable).with_name("fsoe-net")
CASES |= {"adapter": adapter, "axis": axis, "driver": driver, "objects": objects, "reset": reset}
CASES |= {"cia402": cia402, "cia402_lost": cia402_lost, "cia402_modes": cia402_modes}
CASES |= {"hardware": hardware}

if __name__ == "__main__":
    main()
