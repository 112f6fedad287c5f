"""Emulated devices with each other: start-up, outputs, faults on the way and recovery."""

import shutil
from dataclasses import replace

import pytest
from simulate.bench import ESTOP, MS, ROBOT, Bench, bench

from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import ResetCode
from fsoe_net.fsoe.sub_instance import SubInstance
from fsoe_net.model.scenario import LogicChoice

NAME = "el1918-ek1914"
OUT = "ek1914.0x7001:01"
IN = "ek1914.0x6001:01"
TO_DATA = 60


def states(b: Bench) -> set[State]:
    ports = (*b.network.mains.values(), *b.network.subs.values())
    return {p.instance.state for p in ports}


def in_data(path=ESTOP, choice: LogicChoice | None = None) -> Bench:
    b = bench(path, choice)
    b.run(TO_DATA)
    assert states(b) == {State.DATA}
    return b


def new_sub(b: Bench, name: str, **changes: int) -> None:
    """Exchange a SubInstance for one with another configuration."""
    port = b.network.subs[name]
    assert isinstance(port.instance.config, SubConfig)
    port.instance = SubInstance(replace(port.instance.config, **changes), session_ids=lambda: 7)


@pytest.mark.parametrize("path", [ESTOP, ROBOT], ids=["estop", "el6910"])
def test_every_connection_reaches_data_without_a_reset(path):
    b = in_data(path)
    assert b.reset_codes("sub") == []
    assert set(b.reset_codes("main")) == {ResetCode.LOCAL}  # the one each begins with
    assert not any(d.logic.on for d in b.network.masters)


def test_outputs_follow_reset_and_inputs():
    b = in_data()
    assert b.network.safe_output(OUT) == 0
    b.click()
    assert b.network.safe_output(OUT) == 1
    b.network.set_safe_input(IN, 0)
    b.run(6)
    assert b.network.safe_output(OUT) == 0
    b.network.set_safe_input(IN, 1)
    b.run(20)
    assert b.network.safe_output(OUT) == 0
    b.click()
    assert b.network.safe_output(OUT) == 1


def test_outputs_off_is_fail_safe_data():
    b = in_data()
    b.click()
    assert b.network.subs[NAME].instance.data_valid
    b.network.set_safe_input(IN, 0)
    b.run(6)
    assert not b.network.subs[NAME].instance.data_valid
    assert b.network.mains[NAME].instance.data_valid  # the inputs are still told


def test_only_chosen_outputs_switch():
    b = in_data(choice=LogicChoice(outputs=(OUT,)))
    b.click()
    assert (b.network.safe_output(OUT), b.network.safe_output("ek1914.0x7001:02")) == (1, 0)


def test_only_chosen_inputs_count():
    b = in_data(choice=LogicChoice(inputs=("ek1914.6001:2",)))
    b.network.set_safe_input(IN, 0)
    b.click()
    assert b.network.safe_output(OUT) == 1


def test_unplugged_device_watchdog_recovery_and_no_automatic_restart():
    b = in_data()
    b.click()
    b.events.clear()
    b.unplugged = {"ek1914"}
    b.run(97)
    assert b.network.safe_output(OUT) == 1  # the watchdog of 100 ms still runs
    b.run(6)
    assert b.network.safe_output(OUT) == 0
    assert b.reset_codes("main") == [ResetCode.WATCHDOG]
    assert b.reset_codes("sub") == [ResetCode.WATCHDOG]
    b.unplugged = set()
    b.run(200)
    assert states(b) == {State.DATA}
    assert b.network.safe_output(OUT) == 0
    b.click()
    assert b.network.safe_output(OUT) == 1


def test_a_gap_shorter_than_the_watchdog_is_harmless():
    b = in_data()
    b.click()
    b.events.clear()
    b.unplugged = {"ek1914"}
    b.run(90)
    b.unplugged = set()
    b.run(50)
    assert b.events == []
    assert b.network.safe_output(OUT) == 1


def test_wrong_address_is_refused_with_code_6_for_ever():
    b = bench(ESTOP)
    new_sub(b, NAME, address=99)
    b.run(400)
    codes = b.reset_codes("sub")
    assert len(codes) > 3
    assert set(codes) == {ResetCode.ADDRESS}
    assert State.DATA not in states(b)


def test_wrong_parameter_length_is_refused_with_its_code():
    b = bench(ROBOT)
    new_sub(b, "el6910-drive_1", app_parameter_bytes=3)  # the same number of frames
    b.run(200)
    assert set(b.reset_codes("sub")) == {ResetCode.APP_PARAMETER_LENGTH}
    assert b.network.subs["el6910-drive_2"].instance.state is State.DATA


@pytest.mark.parametrize(
    ("byte", "code"),
    [
        (0, ResetCode.UNKNOWN_COMMAND),
        (1, ResetCode.CRC),
        (2, ResetCode.CRC),
        (4, ResetCode.CONNECTION_ID),
    ],
    ids=["command", "data", "crc", "connection id"],
)
def test_one_changed_byte_is_found_and_named(byte: int, code: ResetCode):
    b = in_data()
    b.click()
    b.events.clear()

    def once(frame: bytes) -> bytes:
        b.tamper.clear()
        return frame[:byte] + bytes([frame[byte] ^ 0x80]) + frame[byte + 1 :]

    b.tamper["el1918"] = once
    b.run(2)
    assert b.reset_codes("sub")[0] == code
    assert b.network.safe_output(OUT) == 0
    b.run(300)
    assert states(b) == {State.DATA}
    assert b.network.safe_output(OUT) == 0


def test_main_with_another_connection_id_has_to_restart():
    b = in_data()
    port = b.network.mains[NAME]
    assert isinstance(port.instance.config, MainConfig)
    stranger = replace(port.instance.config, connection_id=77)
    port.instance = MainInstance(stranger, session_ids=lambda: 9)
    b.events.clear()
    b.run(300)
    seen = [e.state_after for who, e in b.events if who == "sub"]
    assert seen[-4:] == [State.SESSION, State.CONNECTION, State.PARAMETER, State.DATA]
    assert b.network.subs[NAME].instance.connection_id == 77


def test_crossed_drives_do_not_reach_data():
    b = bench(ROBOT)
    held: dict[str, bytes] = {}

    def swap(mine: str, other: str):
        def change(frame: bytes) -> bytes:
            held[mine] = frame
            return held.get(other, frame)

        return change

    b.tamper = {"drive_1": swap("1", "2"), "drive_2": swap("2", "1")}
    b.run(400)
    drives = [b.network.mains[f"el6910-drive_{n}"].instance for n in (1, 2)]
    assert all(d.state is not State.DATA for d in drives)
    assert b.network.mains["el6910-el1904"].instance.state is State.DATA


def test_drive_reports_its_torque_until_that_is_set():
    """To the drive 0 demands STO, from the drive 1 reports it."""
    b = in_data(ROBOT)
    main = b.network.mains["el6910-drive_1"]
    sto = "drive_1.0x6640:00"
    assert main.received(sto) == 1
    b.click()
    b.run(4)
    assert (b.network.safe_output(sto), main.received(sto)) == (1, 0)
    b.network.set_safe_input(sto, 1)  # the drive reports what is not so
    b.run(6)
    assert (b.network.safe_output(sto), main.received(sto)) == (1, 1)
    assert b.network.mains["el6910-drive_2"].received("drive_2.0x6640:00") == 0


def test_other_safe_data_of_a_drive_mirror_what_it_receives():
    b = in_data(ROBOT)
    main = b.network.mains["el6910-drive_1"]
    brake = "drive_1.0x6660:00"
    assert main.received(brake) == 0
    b.click()
    b.run(4)
    assert (b.network.safe_output(brake), main.received(brake)) == (1, 1)


def test_power_cycle_of_the_master_needs_a_new_reset():
    b = in_data()
    b.press(True)
    b.run(5)
    assert b.network.safe_output(OUT) == 1
    b.network.devices["el1918"].power_cycle()  # reset is still held
    b.run(400)
    assert states(b) == {State.DATA}
    assert b.network.safe_output(OUT) == 0
    b.press(False)
    b.run(2)
    b.click()
    assert b.network.safe_output(OUT) == 1


def test_power_cycle_takes_the_outputs_at_once():
    b = in_data()
    b.click()
    master = b.network.devices["el1918"]
    assert master.logic.on
    master.power_cycle()
    assert not master.logic.on


def test_connection_without_logic_inputs_switches_off_too():
    """The contactors have no safe inputs; losing them must still take the drives off."""
    b = in_data(ROBOT, LogicChoice(inputs=("el1904.0x6001:01",)))
    b.click()
    b.run(2)
    assert b.network.safe_output("drive_1.0x6640:00") == 1
    b.network.mains["el6910-el2904"].instance.request_reset()
    b.run(8)
    assert b.network.safe_output("drive_1.0x6640:00") == 0
    b.run(200)
    assert states(b) == {State.DATA}
    assert b.network.safe_output("drive_1.0x6640:00") == 0


def test_power_cycle_of_a_sub_recovers():
    b = in_data()
    b.click()
    b.network.devices["ek1914"].power_cycle()
    b.run(3)
    assert b.network.safe_output(OUT) == 0
    b.run(300)
    assert states(b) == {State.DATA}
    assert b.network.safe_output(OUT) == 0


def test_standard_inputs_next_to_the_frame():
    b = in_data()
    b.network.devices["ek1914"].set_input(3, 49, 1, 1)
    b.run(2)
    assert b.io["ek1914"].data[3][6] == 0b10
    b.run(20)
    assert states(b) == {State.DATA}
    assert b.io["ek1914"].data[3][6] == 0b10


def test_frames_stay_inside_their_place():
    """Neither end ever touches a byte beside its frame."""
    b = in_data()
    b.click()
    assert bytes(b.io["ek1914"].data[3][6:]) == bytes(2)
    assert bytes(b.io["el1918"].data[3][6:]) == bytes(2)


def test_two_builds_behave_alike():
    one, two = bench(ROBOT), bench(ROBOT)
    for b in (one, two):
        b.run(100)
        b.click()
        b.unplugged = {"drive_1"}
        b.run(250)
    assert one.events == two.events
    assert {n: io.data for n, io in one.io.items()} == {n: io.data for n, io in two.io.items()}


def test_time_comes_from_the_caller_only():
    b = in_data()
    b.now_ns += 10_000 * MS  # the bus stood still for ten seconds
    b.run(3)
    assert ResetCode.WATCHDOG in b.reset_codes("main") + b.reset_codes("sub")


def test_values_that_follow_the_drive_are_not_set():
    """A status bit that says what the drive was told goes on doing so; another one is set."""
    network = bench(ROBOT).network
    for name, port in network.safe_inputs.items():
        network.set_good(name)
        assert port.sends[name].read(port.safe) == (name not in port.mirrored)
    assert any(port.mirrored for port in network.subs.values())


def test_a_device_without_process_data_is_not_emulated(tmp_path):
    shutil.copytree(ESTOP.parent, tmp_path, dirs_exist_ok=True)
    (tmp_path / "coupler.yaml").write_text("vendor_id: 2\nproduct_id: 0x44c2c52\n")
    path = tmp_path / "network.yaml"
    row = "  - {name: coupler, position: 2, config: coupler.yaml}\n\nnets:"
    path.write_text(path.read_text("utf-8").replace("\nnets:", row), "utf-8")
    assert list(bench(path).network.devices) == ["ek1914", "el1918"]
