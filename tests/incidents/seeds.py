"""Seeded failures: each makes an incident file whose cause is known to the test alone."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from incidents.rig import Rig, config, network

from fsoe_net.emul import choose_setups
from fsoe_net.emul.device import main_port
from fsoe_net.plan import Plan, compile_plan
from fsoe_net.run import counted_session_ids

MS = 1_000_000
CELL, ESTOP = "el6910", "estop"
DRIVE = "el6910-drive_1"
COUPLER = "el1918-ek1914"
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


def _watchdog(ms: int) -> tuple[str, str]:
    return "watchdog_ms: 100", f"watchdog_ms: {ms}"


# -- wiring and configuration ----------------------------------------------------------------------


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
    path = devices_swapped(tmp)
    first, rest = path.read_text("utf-8").split("\n", 1)
    path.write_text(json.dumps(json.loads(first) | {"fsoe": []}) + "\n" + rest, "utf-8")
    return path


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


# -- devices ---------------------------------------------------------------------------------------


def unplugged(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, break: el2904}\n")
    rig.run(1_700)
    return rig.end()


def unplugged_main(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, break: el6910}\n")
    rig.run(1_700)
    return rig.end()


def cable_cut(tmp: Path) -> Path:
    steps = "".join(f"  - {{at_ms: 500, break: {d}}}\n" for d in ("el2904", "drive_1", "drive_2"))
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return rig.end()


def unplugged_for_a_moment(tmp: Path) -> Path:
    steps = "  - {at_ms: 500, break: drive_1}\n  - {at_ms: 900, heal: drive_1}\n"
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return rig.end()


def power_cycled(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, power_cycle: drive_1}\n")
    rig.run(1_700)
    return rig.end()


def logic_restarted(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, power_cycle: el6910}\n")
    rig.run(1_700)
    return rig.end()


def local_reset(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps=f"  - {{at_ms: 500, local_reset: {DRIVE}}}\n")
    rig.run(1_700)
    return rig.end()


def slow_device(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.runs(
        "drive_1",
        lambda now: now // MS % 45 == 0 if now < 1_000 * MS else now // MS % 140 == 0,
    )
    rig.run(2_400)
    return rig.end()


def end_silent(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.runs("drive_1", lambda now: now < 500 * MS)
    rig.run(1_700)
    return rig.end()


def main_not_running(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.runs("el6910", lambda _: False)
    rig.run(1_500)
    return rig.end()


def sub_silent(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.runs("el1904", lambda _: False)
    rig.run(1_500)
    return rig.end()


def crc_damage(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)

    def damage(sm: int, data: bytes) -> bytes:
        bad = rig.now_ns > 500 * MS and sm == 3
        return data[:54] + bytes([data[54] ^ 0x10]) + data[55:] if bad else data

    rig.wire("drive_1", inputs=damage)
    rig.run(1_700)
    return rig.end()


def parameters(code: int) -> Callable[[Path], Path]:
    def seed(tmp: Path) -> Path:
        rig = Rig(network(CELL, tmp), tmp)
        config(rig.ports(DRIVE)[1], verify=lambda _: code)
        rig.run(1_500)
        return rig.end()

    return seed


def parameter_length(tmp: Path) -> Path:
    # The drive echoes in chunks of four bytes: two bytes more fit into the same number of chunks.
    rig = Rig(network(CELL, tmp), tmp)
    config(rig.ports(DRIVE)[1], app_parameter_bytes=6)
    rig.run(1_500)
    return rig.end()


def failsafe(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 9000, press: reset}\n")
    rig.run(1_500)
    rig.recorder.request("drives do not move")
    rig.run(1_100)
    return rig.end()


# -- bus and MainDevice ------------------------------------------------------------------------


def watchdog_tight(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp, _watchdog(2)), tmp)
    rig.run(1_500)
    return rig.end()


def watchdog_tight_in_data(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp, _watchdog(4)), tmp)
    rig.runs("ek1914", lambda now: now < 500 * MS or now // MS % 8 < 4)
    rig.run(1_700)
    return rig.end()


def lost_bursts(tmp: Path) -> Path:
    devices = ("el6910", "el1904", "el2904", "drive_1", "drive_2")
    steps = ""
    for start, end in ((400, 430), (500, 560), (575, 690)):
        steps += "".join(f"  - {{at_ms: {start}, break: {d}}}\n" for d in devices)
        steps += "".join(f"  - {{at_ms: {end}, heal: {d}}}\n" for d in devices)
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return rig.end()


def late_replies(tmp: Path) -> Path:
    from dataclasses import replace

    devices = ("el6910", "el1904", "el2904", "drive_1", "drive_2")
    steps = ""
    for start in range(400, 800, 20):
        steps += "".join(f"  - {{at_ms: {start}, break: {d}}}\n" for d in devices)
        steps += "".join(f"  - {{at_ms: {start + 17}, heal: {d}}}\n" for d in devices)
    rig = Rig(network(CELL, tmp, _watchdog(16)), tmp, steps=steps)
    late = {"count": 0}

    def count(glance: Any) -> Any:
        late["count"] += glance.actual_wkc == 0
        return replace(glance, lost_frames=late["count"], old_replies=max(0, late["count"] - 1))

    rig.glances(count)
    rig.run(1_700)
    return rig.end()


def stalled(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.run(1_700, lambda now: 250 * MS if 500 * MS <= now < 501 * MS else 0)
    return rig.end()


def overruns(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp, _watchdog(15)), tmp)
    rig.run(700, lambda now: 8 * MS if now > 500 * MS and now // MS % 3 == 0 else 0)
    rig.run(1_000)
    return rig.end()


def second_writer_on_the_wire(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)

    def write(sm: int, data: bytes) -> bytes:
        turn = rig.now_ns > 500 * MS and rig.now_ns // MS % 5 == 0 and sm == 2
        return data[:36] + b"\x55\xaa" + data[38:] if turn else data

    rig.wire("drive_1", outputs=write)
    rig.run(1_700)
    return rig.end()


def second_writer_in_the_image(tmp: Path) -> Path:
    from dataclasses import replace

    rig = Rig(network(ESTOP, tmp), tmp)

    def write(sm: int, data: bytes) -> bytes:
        return data[:1] + b"\xff" + data[2:] if rig.now_ns > 500 * MS and sm == 2 else data

    def torn(glance: Any) -> Any:
        image = glance.image
        if rig.now_ns > 500 * MS:
            image = image[:1] + b"\xff" + image[2:]
        return replace(glance, image=image)

    rig.wire("ek1914", outputs=write)
    rig.glances(torn)
    rig.run(1_700)
    return rig.end()


def foreign_frames(tmp: Path) -> Path:
    from dataclasses import replace

    rig = Rig(network(CELL, tmp), tmp)
    rig.glances(
        lambda g: replace(
            g,
            actual_wkc=g.actual_wkc + 3 * (400 * MS < rig.now_ns < 800 * MS),
            old_replies=max(0, rig.now_ns // MS - 400),
        )
    )

    def write(sm: int, data: bytes) -> bytes:
        return bytes(len(data)) if rig.now_ns > 500 * MS else data

    rig.wire("drive_1", outputs=write)
    rig.run(1_700)
    return rig.end()


# -- what shall name nothing -------------------------------------------------------------------


def healthy(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.run(1_500)
    rig.recorder.request("just to see")
    rig.run(1_100)
    return rig.end()


def healthy_jitter(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.run(3_000, lambda now: (now // MS * 7919 % 100) * 1_000)
    rig.recorder.request("just to see")
    rig.run(1_100)
    return rig.end()


def healthy_after_a_loss(tmp: Path) -> Path:
    devices = ("el6910", "el1904", "el2904", "drive_1", "drive_2")
    steps = "".join(f"  - {{at_ms: 500, break: {d}}}\n" for d in devices)
    steps += "".join(f"  - {{at_ms: 502, heal: {d}}}\n" for d in devices)
    rig = Rig(network(CELL, tmp), tmp, steps=steps + "  - {at_ms: 300, press: reset}\n")
    rig.run(1_500)
    rig.recorder.request("just to see")
    rig.run(1_100)
    return rig.end()


# -- a bus that did not open -------------------------------------------------------------------


def subdevice(plan: Plan, number: int, found: str = "", detail: str = "", **more: Any) -> Any:
    """Return a SubDevice as `fsn-master` tells it."""
    sub = plan.subdevices[number]
    right = "the SubDevice of the plan"
    row = {
        "number": number,
        "name": sub.name,
        "alias": sub.alias,
        "position": sub.position,
        "known": True,
        "al": "none" if found == "does not answer" else "PREOP",
        "al_code": 0,
        "found_text": found or right,
        "detail": detail,
        "vendor_id": sub.vendor_id,
        "product_code": sub.product_code,
        "revision": sub.revision_low,
        "returns": 0,
        "stale_cycles": 0,
        "link": [],
        "link_lost": [],
        "rx_errors": [],
    }
    return row | more


def failed(
    tmp: Path,
    text: str,
    *wrong: tuple[int, str, str, dict[str, Any]],
    fsoe: Any = (),
) -> Path:
    """Write the file of a bus that did not open."""
    plan = compile_plan(network(CELL, tmp))
    data = plan.to_bytes()
    rows = [subdevice(plan, n) for n in range(len(plan.subdevices))]
    for number, found, detail, more in wrong:
        rows[number] = subdevice(plan, number, found, detail, **more)
    head = {
        "incident": 1,
        "utc": "2026-03-01T12:00:00.000Z",
        "version": "0.1.0",
        "interface": "eth1",
        "backend": "soem",
        "plan": base64.b64encode(data).decode(),
        "plan_file": "cell.fsnplan",
        "plan_sha256": hashlib.sha256(data).hexdigest(),
        "cycle_ns": 1_000_000,
        "trigger": {
            "kind": "bus_failed",
            "connection": None,
            "cycle": 0,
            "now_ns": 1,
            "text": text,
        },
        "statistics": {},
        "connections": [],
        "subdevices": rows,
        "events": [],
        "layout": None,
        "fsoe": list(fsoe),
    }
    path = tmp / "failed.fsnincident"
    path.write_text(json.dumps(head) + "\n" + '{"end":true,"cycles":0}\n', "utf-8")
    return path


def start(text: str, *wrong: Any, fsoe: Any = ()) -> Callable[[Path], Path]:
    def seed(tmp: Path) -> Path:
        return failed(tmp, text, *wrong, fsoe=fsoe)

    return seed


_OTHER = "found vendor 0x00000002 product 0x1afe3052 revision 0x00120000, the plan says ..."

# As fsn-master tells them when it knows nothing of any SubDevice any more.
_PLANNED = "the plan says 0x00000002 0x07703052 0x00000000 to 0xffffffff; compare the bus"
_TOLD = {
    "IDENTITY, swapped": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says: found "
        f"vendor 0x00000002 product 0x0b583052 revision 0x00000000, {_PLANNED}",
        "devices_swapped_places",
    ),
    "IDENTITY, revision": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says: found "
        f"vendor 0x00000002 product 0x07703052 revision 0x00120000, {_PLANNED}",
        "wrong_revision",
    ),
    "IDENTITY, foreign": (
        "IDENTITY: SubDevice 1 (el1904): a SubDevice is another one than the plan says: found "
        f"vendor 0x00000539 product 0x00000001 revision 0x00120000, {_PLANNED}",
        "wrong_device",
    ),
    "MISSING": (
        "MISSING: SubDevice 4 (drive_2): a SubDevice of the plan is missing: alias 0, position 5: "
        "5 SubDevices answer; check cable and power behind the last SubDevice found",
        "device_missing",
    ),
    "MAPPING": (
        "MAPPING: SubDevice 3 (drive_1): a SubDevice maps other process data than the plan says: "
        "SM2: 0x1c12:00 is 0x2, the plan says 0x3",
        "wrong_mapping",
    ),
    "ADDRESS": (
        "ADDRESS: SubDevice 3 (drive_1): a SubDevice has another FSoE address than the plan says: "
        "it has FSoE address 250, the plan says 201",
        "wrong_address",
    ),
    "ADDRESS, swapped": (
        "ADDRESS: SubDevice 3 (drive_1): a SubDevice has another FSoE address than the plan says: "
        "it has FSoE address 202, the plan says 201",
        "devices_swapped_places",
    ),
    "SDO": (
        "SDO: SubDevice 3 (drive_1): a SubDevice refuses a start-up SDO: 0x1c12:00: abort code "
        "0x06090030",
        "sdo_refused",
    ),
    "STATE": (
        "STATE: SubDevice 4 (drive_2): a SubDevice does not reach the state it was asked for: "
        "SAFEOP refused: AL status 0x12, code 0x001e",
        "state_refused",
    ),
    "BUSY": (
        "BUSY: another MainDevice is talking on this interface: near: 42 frames",
        "other_main_device",
    ),
    "SILENT": (
        "SILENT: no SubDevice answers on this interface: near has a link, but no EtherCAT "
        "SubDevice behind it answers",
        "bus_silent",
    ),
    "SILENT, link": (
        "SILENT: no SubDevice answers on this interface: near has no link: cable, power",
        "no_link",
    ),
}


def told(text: str) -> Callable[[Path], Path]:
    """Return a seed with the fault alone: the bus has let go of its SubDevices."""

    def seed(tmp: Path) -> Path:
        path = failed(tmp, f"the bus does not open: FSN_E_BUS_{text}")
        head, rest = path.read_text("utf-8").split("\n", 1)
        row = json.loads(head)
        names = ("number", "name", "alias", "position", "stale_cycles")
        row["subdevices"] = [
            {key: s[key] for key in names} | {"known": False} for s in row["subdevices"]
        ]
        path.write_text(json.dumps(row | {"statistics": None}) + "\n" + rest, "utf-8")
        return path

    return seed


SEEDS: dict[str, tuple[Callable[[Path], Path], str]] = {
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
    "single device unplugged": (unplugged, "device_lost"),
    "logic unplugged": (unplugged_main, "device_lost"),
    "cable cut between two": (cable_cut, "cable_cut"),
    "unplugged for a moment": (unplugged_for_a_moment, "device_interrupted"),
    "device power-cycled": (power_cycled, "device_restarted"),
    "logic restarted": (logic_restarted, "main_restarted"),
    "connection switched off in the program": (local_reset, "local_reset"),
    "slow device": (slow_device, "slow_device"),
    "safety part of a device stopped": (end_silent, "end_silent"),
    "MainInstance not running": (main_not_running, "main_not_running"),
    "SubInstance not commissioned": (sub_silent, "sub_silent"),
    "CRC damage of a device": (crc_damage, "frames_damaged"),
    "SRA checksum refused (11)": (parameters(11), "parameters_refused"),
    "watchdog refused (9)": (parameters(9), "parameters_refused"),
    "device-specific refusal (0x81)": (parameters(0x81), "parameters_refused"),
    "parameter length (10)": (parameter_length, "parameters_refused"),
    "error acknowledge missing": (failsafe, "failsafe"),
    "watchdog too tight from the start": (watchdog_tight, "watchdog_tight"),
    "watchdog too tight now and then": (watchdog_tight_in_data, "watchdog_tight"),
    "lost frames in bursts": (lost_bursts, "lost_frames"),
    "replies later than their cycle": (late_replies, "late_replies"),
    "stalled MainDevice": (stalled, "stalled_main_device"),
    "cycle overruns": (overruns, "cycle_overruns"),
    "second writer, outside": (second_writer_on_the_wire, "second_writer"),
    "second writer, in the image": (second_writer_in_the_image, "second_writer"),
    "foreign frames": (foreign_frames, "foreign_frames"),
    "two MainDevices at start": (
        start("another MainDevice is talking on this interface: eth1: 42 EtherCAT frames heard"),
        "other_main_device",
    ),
    "no link": (
        start("no SubDevice answers on this interface: eth1 has no link: cable"),
        "no_link",
    ),
    "nobody answers": (
        start("eth1 has a link, but no EtherCAT SubDevice behind it answers"),
        "bus_silent",
    ),
    "device missing at start": (
        start(
            "a SubDevice of the plan is missing: drive_2",
            (4, "does not answer", "alias 0, position 5: 5 SubDevices answer", {}),
        ),
        "device_missing",
    ),
    "wrong revision at start": (
        start(
            "a SubDevice is another one than the plan says: el2904",
            (2, "another device", "found vendor ... revision 0x00120000", {"revision": 0x120000}),
        ),
        "wrong_revision",
    ),
    "wrong device at start": (
        start(
            "a SubDevice is another one than the plan says: el1904",
            (1, "another device", _OTHER, {"vendor_id": 7, "product_code": 9}),
        ),
        "wrong_device",
    ),
    "mapping differs at start": (
        start(
            "a SubDevice maps other process data than the plan says: drive_1",
            (3, "other process data", "SM2: 0x1c12:00 is 0x2, the plan says 0x3", {}),
        ),
        "wrong_mapping",
    ),
    "SDO abort at start": (
        start(
            "a SubDevice refuses a start-up SDO: drive_1",
            (3, "refused a start-up SDO", "0x8010:01: abort code 0x06090030 value range", {}),
        ),
        "sdo_refused",
    ),
    "state refused at start": (
        start(
            "a SubDevice does not reach the state it was asked for: drive_2",
            (4, "refused a state", "SAFEOP refused: AL status 0x12", {"al_code": 0x1E}),
        ),
        "state_refused",
    ),
    "wrong FSoE address at start": (
        start(
            "a SubDevice has another FSoE address than the plan says: drive_1",
            (3, "another FSoE address", "it has FSoE address 250, the plan says 201", {}),
            fsoe=({"subdevice": "drive_1", "address": 250, "connections": []},),
        ),
        "wrong_address",
    ),
    "drives swapped at start": (
        start(
            "a SubDevice has another FSoE address than the plan says: drive_1",
            (3, "another FSoE address", "it has FSoE address 202, the plan says 201", {}),
            (4, "another FSoE address", "it has FSoE address 201, the plan says 202", {}),
            fsoe=(
                {"subdevice": "drive_1", "address": 202, "connections": []},
                {"subdevice": "drive_2", "address": 201, "connections": []},
            ),
        ),
        "devices_swapped_places",
    ),
}

SEEDS |= {f"told at start: {n}": (told(text), cause) for n, (text, cause) in _TOLD.items()}

NOTHING: dict[str, Callable[[Path], Path]] = {
    "healthy": healthy,
    "healthy with jitter": healthy_jitter,
    "healthy after two lost cycles": healthy_after_a_loss,
    "refused for an unknown reason": start("out of memory"),
}
