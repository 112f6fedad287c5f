"""Seeded failures of devices: gone, restarted, slow, or of another opinion."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any

from incident.rig import CELL, DRIVE, MS, Rig, Seed, config, edited, network
from incident.seeds_bus import all_of


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


def ring_opened(tmp: Path) -> Path:
    """A cable of a ring goes at 500 ms; the frames of 100 ms are lost with it."""
    rig = Rig(network(CELL, tmp), tmp, steps=all_of(500, "break") + all_of(600, "heal"))
    rig.run(1_700)
    place = "between el2904 (ring position 2, port 1) and drive_1 (ring position 3, port 0)"

    def ring(head: dict[str, Any]) -> None:
        event = {"event": "ring", "utc": "", "now_ns": head["trigger"]["now_ns"] - 50 * MS}
        head["ring"] = {"state": "open", "ways": [0, 0], "breaks": 1, "place": place}
        head["events"].append(event | head["ring"] | {"text": f"the ring is open: {place}"})

    return edited(rig.end(), ring)


def unplugged_for_a_moment(tmp: Path) -> Path:
    steps = "  - {at_ms: 500, break: drive_1}\n  - {at_ms: 900, heal: drive_1}\n"
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return rig.end()


def line_interrupted(order: tuple[str, ...]) -> Callable[[Path], Path]:
    """A cable is cut between two devices and joined again: all after it were gone.

    The connection that drops first is that of the last device: which end drops first says nothing
    about the place.
    """

    def seed(tmp: Path) -> Path:
        steps = "".join(f"  - {{at_ms: {500 + n}, break: {d}}}\n" for n, d in enumerate(order))
        steps += "".join(f"  - {{at_ms: 900, heal: {d}}}\n" for d in order)
        rig = Rig(
            network(CELL, tmp, ("connection_id: 4, watchdog_ms: 100", SHORT)), tmp, steps=steps
        )
        rig.run(1_900)
        return rig.end()

    return seed


SHORT = "connection_id: 4, watchdog_ms: 40"


def link_lost(tmp: Path) -> Path:
    """The first cable, or all devices without power: one gap of 400 ms for everything."""
    rig = Rig(network(CELL, tmp), tmp, steps=all_of(500, "break") + all_of(900, "heal"))
    rig.run(1_900)
    return rig.end()


def interface_down(tmp: Path, *, heal_ms: int = 560) -> Path:
    """The interface goes down for a moment: the kernel refuses to send (ENETDOWN)."""
    rig = Rig(
        network(
            CELL, tmp, ("connection_id: 1, watchdog_ms: 100", "connection_id: 1, watchdog_ms: 40")
        ),
        tmp,
        steps=all_of(500, "break") + all_of(heal_ms, "heal"),
    )
    rig.run(1_900)

    def unsent(head: dict[str, Any]) -> None:
        head["statistics"] |= {"unsent_frames": heal_ms - 500, "send_errno": errno.ENETDOWN}

    return edited(rig.end(), unsent)


def interface_stays_down(tmp: Path) -> Path:
    return interface_down(tmp, heal_ms=5_000)


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


DEVICES: dict[str, Seed] = {
    "single device unplugged": (unplugged, "device_lost"),
    "logic unplugged": (unplugged_main, "device_lost"),
    "cable cut between two": (cable_cut, "cable_cut"),
    "cable of a ring": (ring_opened, "ring_open"),
    "unplugged for a moment": (unplugged_for_a_moment, "device_interrupted"),
    "line cut and joined": (
        line_interrupted(("el2904", "drive_1", "drive_2")),
        "cable_interrupted",
    ),
    "line cut and joined, the last is missed first": (
        line_interrupted(("drive_2", "drive_1", "el2904")),
        "cable_interrupted",
    ),
    "first cable cut and joined": (link_lost, "main_link_lost"),
    "interface down for a moment": (interface_down, "main_link_lost"),
    "interface down": (interface_stays_down, "main_link_lost"),
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
}
