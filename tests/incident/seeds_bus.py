"""Seeded failures of bus and MainDevice, and runs in which there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from incident.rig import CELL, ESTOP, MS, Rig, Seed, changed_cycle, network

EVERYBODY = ("el6910", "el1904", "el2904", "drive_1", "drive_2")


def watchdog(ms: int) -> tuple[str, str]:
    return "watchdog_ms: 100", f"watchdog_ms: {ms}"


def all_of(at_ms: int, what: str) -> str:
    """Return steps that do it to every device at once."""
    return "".join(f"  - {{at_ms: {at_ms}, {what}: {d}}}\n" for d in EVERYBODY)


def watchdog_tight(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp, watchdog(2)), tmp)
    rig.run(1_500)
    return rig.end()


def watchdog_tight_in_data(tmp: Path) -> Path:
    rig = Rig(network(ESTOP, tmp, watchdog(4)), tmp)
    rig.runs("ek1914", lambda now: now < 500 * MS or now // MS % 8 < 4)
    rig.run(1_700)
    return rig.end()


def lost_bursts(tmp: Path) -> Path:
    steps = ""
    for start, end in ((400, 430), (500, 560), (575, 690)):
        steps += all_of(start, "break")
        steps += all_of(end, "heal")
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return rig.end()


def late_replies(tmp: Path) -> Path:
    steps = ""
    for start in range(400, 800, 20):
        steps += all_of(start, "break")
        steps += all_of(start + 17, "heal")
    rig = Rig(network(CELL, tmp, watchdog(16)), tmp, steps=steps)
    late = {"count": 0}

    def count(image: Any) -> Any:
        late["count"] += image.actual_wkc == 0
        return changed_cycle(
            image, lost_frames=late["count"], old_replies=max(0, late["count"] - 1)
        )

    rig.cycle_images(count)
    rig.run(1_700)
    return rig.end()


def stalled(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.run(1_700, lambda now: 250 * MS if 500 * MS <= now < 501 * MS else 0)
    return rig.end()


def overruns(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp, watchdog(15)), tmp)
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
    rig = Rig(network(ESTOP, tmp), tmp)

    def write(sm: int, data: bytes) -> bytes:
        return data[:1] + b"\xff" + data[2:] if rig.now_ns > 500 * MS and sm == 2 else data

    def torn(cycle: Any) -> Any:
        image = cycle.image
        if rig.now_ns > 500 * MS:
            image = image[:1] + b"\xff" + image[2:]
        return replace(cycle, image=image)

    rig.wire("ek1914", outputs=write)
    rig.cycle_images(torn)
    rig.run(1_700)
    return rig.end()


def foreign_frames(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.cycle_images(
        lambda g: changed_cycle(
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
    steps = all_of(500, "break")
    steps += all_of(502, "heal")
    rig = Rig(network(CELL, tmp), tmp, steps=steps + "  - {at_ms: 300, press: reset}\n")
    rig.run(1_500)
    rig.recorder.request("just to see")
    rig.run(1_100)
    return rig.end()


BUS: dict[str, Seed] = {
    "watchdog too tight from the start": (watchdog_tight, "watchdog_tight"),
    "watchdog too tight now and then": (watchdog_tight_in_data, "watchdog_tight"),
    "lost frames in bursts": (lost_bursts, "lost_frames"),
    "replies later than their cycle": (late_replies, "late_replies"),
    "stalled MainDevice": (stalled, "stalled_main_device"),
    "cycle overruns": (overruns, "cycle_overruns"),
    "second writer, outside": (second_writer_on_the_wire, "second_writer"),
    "second writer, in the image": (second_writer_in_the_image, "second_writer"),
    "foreign frames": (foreign_frames, "foreign_frames"),
}

HEALTHY = {
    "healthy": healthy,
    "healthy with jitter": healthy_jitter,
    "healthy after two lost cycles": healthy_after_a_loss,
}
