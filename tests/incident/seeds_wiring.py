"""Seeded failures of wiring, addresses, IDs and mapping."""

from __future__ import annotations

from pathlib import Path

from incident.rig import CELL, COUPLER, ESTOP, MS, Rig, Seed, config, edited, network

from fsoe_net.simulate.port import main_port
from fsoe_net.simulate.session import counted_session_ids
from fsoe_net.simulate.setup import choose_setups

SLOTS_IN = (
    ("out: {ec_module: el6910, index: 0x7020", "out: {ec_module: el6910, index: 0x70FF"),
    ("out: {ec_module: el6910, index: 0x7030", "out: {ec_module: el6910, index: 0x7020"),
    ("out: {ec_module: el6910, index: 0x70FF", "out: {ec_module: el6910, index: 0x7030"),
)
SLOTS_OUT = (
    ("in: {ec_module: el6910, index: 0x6020", "in: {ec_module: el6910, index: 0x60FF"),
    ("in: {ec_module: el6910, index: 0x6030", "in: {ec_module: el6910, index: 0x6020"),
    ("in: {ec_module: el6910, index: 0x60FF", "in: {ec_module: el6910, index: 0x6030"),
)


def wrong_address(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.session.network.set_address("drive_1", 250)
    rig.run(1_500)
    return rig.end()


def wrong_address_in_the_program(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp), tmp)
    config(rig.ports(COUPLER)[0], address=15)
    rig.run(1_500)
    return rig.end()


def devices_swapped(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.session.network.set_address("drive_1", 202)
    rig.session.network.set_address("drive_2", 201)
    rig.run(1_500)
    return rig.end()


def devices_swapped_unread(tmp: Path) -> Path:
    """As above, but no device tells its address, as in files of a bus that cannot read it."""
    return edited(devices_swapped(tmp), lambda head: head.update(fsoe=[]))


def copies_crossed(tmp: Path) -> Path:
    crossed = network(CELL, tmp, *SLOTS_IN, *SLOTS_OUT)
    rig = Rig(network(CELL, tmp), tmp, plan=crossed)
    rig.run(1_500)
    return rig.end()


def copies_crossed_one_way(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, plan=network(CELL, tmp, *SLOTS_IN))
    rig.run(1_500)
    return rig.end()


def roles_exchanged(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp), tmp)
    main, sub = rig.ports(COUPLER)
    main.instance, sub.instance = sub.instance, main.instance
    rig.run(1_500)
    rig.recorder.request("outputs stay off")
    rig.run(1_100)
    return rig.end()


def two_mains(tmp: Path) -> Path:
    resolution = network(ESTOP, tmp)
    rig = Rig(resolution, tmp)
    _, sub = rig.ports(COUPLER)
    sub.instance = main_port(choose_setups(resolution)[0], counted_session_ids()).instance
    rig.run(1_500)
    return rig.end()


def duplicate_connection_id(tmp: Path) -> Path:
    same = network(CELL, tmp, ("address: 202, connection_id: 4", "address: 202, connection_id: 3"))
    rig = Rig(same, tmp, plan=network(CELL, tmp))
    rig.run(1_000)
    rig.recorder.request("the drives disturb each other")
    rig.run(1_100)
    return rig.end()


def connection_id_of_another_program(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp), tmp)

    def other_id(sm: int, data: bytes) -> bytes:
        return data[:4] + b"\x07\0" + data[6:] if rig.now_ns > 500 * MS else data

    rig.wire("el1918", inputs=other_id)
    rig.run(1_700)
    return rig.end()


def mapping_shifted_sub(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp), tmp)
    rig.ports(COUPLER)[1].tx_byte += 1
    rig.run(1_500)
    return rig.end()


def mapping_shifted_main(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp), tmp)
    rig.ports(COUPLER)[0].tx_byte += 1
    rig.run(1_500)
    return rig.end()


def frame_size(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp), tmp)
    sub = rig.ports(COUPLER)[1]
    config(sub, safe_in_bytes=2)
    sub.safe = bytearray(2)
    rig.run(1_500)
    return rig.end()


WIRING: dict[str, Seed] = {
    "wrong FSoE address at the device": (wrong_address, "wrong_address"),
    "wrong FSoE address in the program": (wrong_address_in_the_program, "wrong_address"),
    "two devices swapped": (devices_swapped, "devices_swapped"),
    "two devices swapped, addresses unread": (devices_swapped_unread, "devices_swapped"),
    "copies crossed, both ways": (copies_crossed, "copies_crossed"),
    "copies crossed, one way": (copies_crossed_one_way, "copies_crossed"),
    "direction exchanged": (roles_exchanged, "roles_exchanged"),
    "two MainInstances at one connection": (two_mains, "roles_exchanged"),
    "duplicate connection ID": (duplicate_connection_id, "duplicate_connection_id"),
    "another connection ID": (connection_id_of_another_program, "connection_id"),
    "mapping of the sub shifted by a byte": (mapping_shifted_sub, "mapping_shifted"),
    "mapping of the main shifted by a byte": (mapping_shifted_main, "mapping_shifted"),
    "frame size wrong": (frame_size, "frame_size"),
}
