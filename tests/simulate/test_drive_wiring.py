"""Emulated drives behind their FSoE connections: what the safe data do to the motor."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from simulate.bench import ROBOT, ROOT, Bench, bench

from fsoe_net.fsoe.event import State
from fsoe_net.model.drives import DriveSetup, drive_axes
from fsoe_net.model.scenario import LogicChoice
from fsoe_net.model.signals import write_bits
from fsoe_net.simulate.drive.power import PdsState

S = PdsState
CELL = ROOT / "examples" / "robot-cell" / "network.yaml"
STO, SS1 = "axis_1.0x6640:00", "axis_1.0x6650:01"
BOTH = tuple(f"axis_{n}.{bit}" for n in (1, 2) for bit in ("0x6640:00", "0x6650:01"))


class CellBench:
    """A network with drives; objects of an axis are written as the MainDevice would."""

    def __init__(self, path: Path = CELL, choice: LogicChoice | None = None) -> None:
        self.bench: Bench = bench(path, choice)
        self.network = self.bench.network
        self.bench.run(60)

    def axis(self, name: str = "axis_1"):
        return self.network.axes[name].axis

    def put(self, name: str, index: int, value: int) -> None:
        sm, placed = self.axis(name).objects.axis.outputs[index]
        data = self.bench.io[name.partition(".")[0]].data[sm]
        bits = placed.entry.bits
        write_bits(data, placed.bit_offset, bits, value & ((1 << bits) - 1))

    def shown(self, name: str, index: int) -> int:
        """Return an input as the MainDevice reads it."""
        sm, placed = self.axis(name).objects.axis.inputs[index]
        whole = int.from_bytes(self.bench.io[name.partition(".")[0]].data[sm], "little")
        return whole >> placed.bit_offset & ((1 << placed.entry.bits) - 1)

    def run(self, milliseconds: int) -> None:
        self.bench.run(milliseconds)

    def turn(self, *names: str, speed: int = 5 * 65536) -> None:
        """Bring axes to a speed in PV."""
        for name in names:
            self.put(name, 0x6060, 3)
            self.put(name, 0x60FF, speed)
        for word in (0, 6, 7, 15):
            for name in names:
                self.put(name, 0x6040, word)
            self.run(2)
        self.run(300)
        for name in names:
            assert self.axis(name).power.state is S.OPERATION_ENABLED

    def reported(self, name: str) -> int:
        """Return a safe input of a drive as its MainInstance has it."""
        device = name.partition(".")[0]
        return self.network.mains[f"el6910-{device}"].received(name)


def running(**how) -> CellBench:
    cell = CellBench(**how)
    cell.bench.click()
    cell.turn("axis_1", "axis_2")
    return cell


def test_statusword_and_position_come_to_the_main_device():
    cell = running()
    assert cell.shown("axis_1", 0x6041) & 0x6F == 0x27
    assert cell.shown("axis_1", 0x606C) == pytest.approx(5 * 65536, rel=1e-3)
    assert cell.shown("axis_1", 0x6061) == 3


def test_fail_safe_data_are_sto():
    cell = running()
    cell.network.set_safe_input("el1904.0x6001:01", 0)
    cell.run(6)
    for name in ("axis_1", "axis_2"):
        assert cell.axis(name).power.state is S.SWITCH_ON_DISABLED
        assert cell.shown(name, 0x6077) == 0
    cell.run(4)
    assert cell.reported(STO) == 1


def test_a_connection_that_is_not_in_data_is_sto_and_only_for_its_own_drive():
    cell = running(choice=LogicChoice(inputs=()))
    cell.network.mains["el6910-axis_1"].instance.request_reset()
    cell.run(2)
    assert cell.network.subs["el6910-axis_1"].instance.state is not State.DATA
    assert cell.axis("axis_1").safe.torque_off
    cell.run(200)
    assert cell.network.subs["el6910-axis_1"].instance.state is State.DATA
    assert cell.axis("axis_1").safe.torque_off  # FailSafeData until somebody presses reset


def test_torque_is_off_within_the_watchdog_when_frames_stop():
    cell = running()
    cell.bench.unplugged.add("axis_1")
    cell.run(99)
    assert cell.axis("axis_1").power.state is S.OPERATION_ENABLED
    cell.run(3)
    assert cell.axis("axis_1").safe.torque_off
    assert cell.axis("axis_1").power.state is S.SWITCH_ON_DISABLED


def test_ss1_first_and_sto_after_its_delay():
    delays = dict.fromkeys((STO, "axis_2.0x6640:00"), 300_000_000)
    cell = running(choice=LogicChoice(outputs=BOTH, delays_ns=delays))
    assert (cell.reported(STO), cell.reported(SS1)) == (0, 0)
    cell.network.set_safe_input("el1904.0x6001:01", 0)
    cell.run(14)
    assert cell.axis().power.state is S.QUICK_STOP
    assert (cell.reported(STO), cell.reported(SS1)) == (0, 1)
    assert cell.network.safe_output(STO) == 1  # still ProcessData
    cell.run(60)
    assert cell.axis().context.servo.plant.speed == 0.0
    assert (cell.reported(STO), cell.reported(SS1)) == (1, 1)
    assert cell.network.safe_output(STO) == 1
    cell.run(300)
    assert not cell.network.subs["el6910-axis_1"].instance.data_valid


def test_nothing_turns_again_by_itself():
    """Controlword and targets are still there; acknowledged alone the drive stays where it is."""
    cell = running()
    cell.network.set_safe_input("el1904.0x6001:01", 0)
    cell.run(500)
    cell.network.set_safe_input("el1904.0x6001:01", 1)
    cell.run(10)
    cell.bench.click()
    at = cell.shown("axis_1", 0x6064)
    cell.run(300)
    assert cell.network.safe_output(STO) == 1
    assert cell.shown("axis_1", 0x6064) == at
    cell.turn("axis_1")
    assert cell.shown("axis_1", 0x6064) != at


def test_frames_of_the_drive_stay_whole_next_to_its_process_data():
    cell = running()
    cell.run(500)
    assert cell.bench.reset_codes("sub") == []
    assert all(p.instance.data_valid for p in cell.network.subs.values())


def test_a_wire_from_an_output_terminal():
    """STO of drive 1 hangs on the contactor output, not on its own frame."""
    cell = CellBench(ROBOT)
    wire = "el2904.0x7001:01"
    cell.network.choose_drives({"drive_1": DriveSetup(sto=wire)})
    cell.network.choose_logic(LogicChoice(outputs=("drive_1.0x6640:00", "drive_1.0x6650:01")))
    cell.bench.click()
    cell.run(10)
    assert cell.axis("drive_1").safe.torque_off
    every = (wire, *(f"drive_1.{bit}" for bit in ("0x6640:00", "0x6650:01")))
    cell.network.choose_logic(LogicChoice(outputs=every))
    cell.run(10)
    assert not cell.axis("drive_1").safe.torque_off


def test_sls_bits_of_a_drive_choose_their_limits():
    cell = CellBench(ROBOT)
    free = [n for n in cell.network.safe_outputs if "0x6690:02" not in n]
    cell.network.choose_logic(LogicChoice(outputs=tuple(free)))
    setup = DriveSetup(sls_rpm=(100, 60, 30), sls_delay_ms=50)
    cell.network.choose_drives({"drive_1": setup})
    cell.bench.click()
    cell.turn("drive_1")
    speed = cell.axis("drive_1").context.servo.plant.speed
    assert speed == pytest.approx(60 / 60 * math.tau, rel=1e-3)
    main = cell.network.mains["el6910-drive_1"]
    assert [main.received(f"drive_1.0x6690:0{n}") for n in (1, 2, 3, 4)] == [0, 1, 0, 0]


def test_a_standard_input_that_was_set_stays():
    cell = running()
    sm, placed = cell.axis().objects.axis.inputs[0x6077]
    device = cell.network.devices["axis_1"]
    device.set_input(sm, placed.bit_offset, placed.entry.bits, 999)
    cell.run(50)
    assert cell.shown("axis_1", 0x6077) == 999


def test_power_cycle_takes_a_drive_back_to_the_start():
    cell = running()
    cell.network.devices["axis_1"].power_cycle()
    cell.run(5)
    assert cell.axis().power.state is S.SWITCH_ON_DISABLED
    assert cell.shown("axis_1", 0x6041) & 0x6F == 0x40


def test_axes_of_one_device_are_eight_hundred_apart(tmp_path: Path):
    two = (ROOT / "examples/robot-cell/devices/drive.yaml").read_text()
    for index in ("6040", "6060", "607a", "60ff", "6041", "6061", "6064", "606c"):
        line = next(row for row in two.splitlines() if f"index: 0x{index}," in row)
        other = line.replace(f"0x{index}", f"0x{int(index, 16) + 0x800:04x}")
        two = two.replace(line, f"{line}\n{other.replace('_interface: ', '_interface: second_')}")
    folder = tmp_path / "examples" / "robot-cell"
    (folder / "devices").mkdir(parents=True)
    for name in ("el6910", "el1008"):
        text = (CELL.parent / "devices" / f"{name}.yaml").read_text()
        (folder / "devices" / f"{name}.yaml").write_text(text)
    (folder / "devices" / "drive.yaml").write_text(two)
    other = tmp_path / "examples" / "el6910" / "devices"
    other.mkdir(parents=True)
    (other / "el1904.yaml").write_text((ROBOT.parent / "devices" / "el1904.yaml").read_text())
    (folder / "network.yaml").write_text(CELL.read_text())
    cell = CellBench(folder / "network.yaml")
    assert list(cell.network.axes) == ["axis_1", "axis_1.1", "axis_2", "axis_2.1"]
    cell.bench.click()
    cell.turn("axis_1.1")
    assert cell.axis("axis_1").power.state is S.SWITCH_ON_DISABLED
    assert cell.shown("axis_1.1", 0x606C) == pytest.approx(5 * 65536, rel=1e-3)
    assert cell.shown("axis_1", 0x606C) == 0


def test_a_terminal_is_not_a_drive():
    layout = bench(ROBOT).resolution.network.subdevices[1].layout
    assert layout is not None
    assert drive_axes(layout) == ()
