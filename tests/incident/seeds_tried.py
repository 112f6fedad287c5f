"""Seeded failures as they were tried on a wire, with repeated types and a second MainDevice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from incident.rig import CELL, FOUND, MS, Rig, Seed, changed_cycle, edited, found, network
from incident.seeds_bus import EVERYBODY, all_of, watchdog
from incident.seeds_start import failed
from networks import resolved, write_big_network

from fsoe_net.model.resolve import Resolution

FIVE = [f"s{n}" for n in range(1, 6)]


def five_equal(tmp: Path) -> Resolution:
    """Return a logic and five terminals of one type."""
    folder = tmp / "five"
    folder.mkdir()
    path = write_big_network(folder, 6, 10)
    rows = [
        f"      - {{main: s0, sub: s{n}, address: {100 + n}, connection_id: {n}, watchdog_ms: 100}}"
        for n in range(1, 6)
    ]
    text = path.read_text("utf-8") + "    connections:\n" + "\n".join(rows) + "\n"
    path.write_text(text, "utf-8")
    return resolved(path)


def swapped(**addresses: int) -> Callable[[Path], Path]:
    """Return a seed in which some of five equal devices have other addresses from the start."""

    def seed(tmp: Path) -> Path:
        rig = Rig(five_equal(tmp), tmp)
        for name, address in addresses.items():
            rig.session.network.set_address(name, address)
        rig.run(1_500)
        return rig.end()

    return seed


def away_and_back(tmp: Path, *names: str, resolution: Resolution | None = None) -> Rig:
    """Let some devices be away from the bus for a moment."""
    steps = "".join(
        f"  - {{at_ms: {at}, {what}: {name}}}\n"
        for at, what in ((500, "break"), (700, "heal"))
        for name in names
    )
    rig = Rig(resolution or network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return rig


def refused_address(path: Path, name: str, has: int, planned: int) -> Path:
    detail = f"it has FSoE address {has}, the plan has {planned}"
    text = "another FSoE address"
    return found(path, name, al="PREOP", found_text=text, detail=detail, fsoe_address=has)


def swapped_while_running(tmp: Path) -> Path:
    """Both left the bus and came back; the incident is that of a neighbour behind them."""
    rig = away_and_back(tmp, "s2", "s3", "s4", "s5", resolution=five_equal(tmp))
    path = refused_address(rig.end(), "s2", 104, 102)
    return edited(refused_address(path, "s4", 102, 104), lambda head: head.update(fsoe=[]))


def switches_of_two_types(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp)
    rig.session.network.set_address("el1904", 102)
    rig.session.network.set_address("el2904", 101)
    rig.run(1_500)
    return rig.end()


def switches_while_running(tmp: Path) -> Path:
    """Two of one type that never left the bus: only one was switched off and on."""
    path = refused_address(away_and_back(tmp, "drive_1").end(), "drive_1", 202, 201)
    path = refused_address(path, "drive_2", 201, 202)
    return edited(path, lambda head: head.update(fsoe=[]))


def wrong_while_running(tmp: Path) -> Path:
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, break: drive_2}\n")
    rig.run(1_700)
    return found(
        rig.end(),
        "drive_2",
        found_text="another device",
        detail="found vendor 0x00000002 product 0x00000003 revision 0x00000000, the plan has ...",
        vendor_id=2,
        product_code=3,
    )


def wrong_in_the_middle(tmp: Path) -> Path:
    """Those behind it are gone with it."""
    steps = "".join(f"  - {{at_ms: 500, break: {d}}}\n" for d in ("el2904", "drive_1", "drive_2"))
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    return found(
        rig.end(),
        "el2904",
        found_text="another device",
        detail="found vendor 0x00000002 product 0x00000003 revision 0x00000000, the plan has ...",
        vendor_id=2,
        product_code=3,
    )


def every_reply_late(answers: bool) -> Callable[[Path], Path]:
    """Return a seed with a delay of 1.5 cycles on every reply from half a second on.

    Args:
        answers: Whether the SubDevices are seen beside the cycle, where frames may take longer.
    """

    def seed(tmp: Path) -> Path:
        steps = "" if answers else all_of(500, "break")
        rig = Rig(network(CELL, tmp, watchdog(50)), tmp, steps=steps)

        def late(glance: Any) -> Any:
            cycles = max(0, rig.now_ns // MS - 500)
            wkc = 0 if cycles else glance.actual_wkc
            return changed_cycle(
                glance, actual_wkc=wkc, lost_frames=cycles, old_replies=max(0, cycles - 2)
            )

        rig.cycle_images(late)
        for name in EVERYBODY:
            rig.runs(name, lambda now: now < 500 * MS)
        rig.run(1_700)
        return rig.end()

    return seed


def second_main_device(frames_per_s: int, what: str) -> Callable[[Path], Path]:
    """Return a seed with frames of another MainDevice during OP."""

    def seed(tmp: Path) -> Path:
        rig = Rig(network(CELL, tmp), tmp, steps=what)
        rig.cycle_images(
            lambda g: changed_cycle(
                g, foreign_frames=max(0, rig.now_ns // MS - 450) * frames_per_s // 1000
            )
        )
        rig.run(1_700)
        return rig.end()

    return seed


def refused(name: str, number: int, kind: str, detail: str, **more: Any) -> Callable[[Path], Path]:
    """Return a seed with a SubDevice that is asked again and again; just now it was asked."""

    def seed(tmp: Path) -> Path:
        rig = Rig(network(CELL, tmp), tmp, steps=f"  - {{at_ms: 10, break: {name}}}\n")
        rig.run(1_500)
        path = found(rig.end(), name, al="PREOP", **more)

        def change(head: dict[str, Any]) -> None:
            text = f"SubDevice {name}: {kind}: {detail}"
            event = {"event": "subdevice", "level": "warning", "text": text, "subdevice": name}
            event |= {"now_ns": head["trigger"]["now_ns"], "found": kind, "detail": detail}
            event |= {"found_code": FOUND[kind]}
            head["events"].append(event | {"number": number})
            head["trigger"] |= {"kind": "refused", "connection": None, "subdevice": name}
            head["trigger"] |= {"text": text}

        return edited(path, change)

    return seed


def found_at_start(*rows: tuple[str, int, int]) -> Callable[[Path], Path]:
    """Return a seed with other devices in several places: name, vendor and product found there."""

    def seed(tmp: Path) -> Path:
        wrong = [
            (
                EVERYBODY.index(name),
                "another device",
                f"found vendor 0x{vendor:08x} product 0x{product:08x} revision 0x00000000, ...",
                {"vendor_id": vendor, "product_code": product},
            )
            for name, vendor, product in rows
        ]
        number, _, detail, _ = wrong[0]
        text = f"FSN_E_BUS_IDENTITY: SubDevice {number} ({rows[0][0]}): {detail}"
        return failed(tmp, "IDENTITY", text, *wrong)

    return seed


TRIED: dict[str, Seed] = {
    "second and fourth of five swapped": (swapped(s2=104, s4=102), "devices_swapped"),
    "last two of five swapped": (swapped(s4=105, s5=104), "devices_swapped"),
    "three of five moved on by one": (swapped(s1=103, s3=105, s5=101), "devices_swapped"),
    "two of five swapped while running": (swapped_while_running, "devices_swapped"),
    "address switches of two types exchanged": (switches_of_two_types, "addresses_swapped"),
    "address switches exchanged while running": (switches_while_running, "addresses_swapped"),
    "another device while running": (wrong_while_running, "wrong_device"),
    "another device in the middle of the line": (wrong_in_the_middle, "wrong_device"),
    "every reply 1.5 cycles late": (every_reply_late(answers=True), "late_replies"),
    "every reply late, nobody seen": (every_reply_late(answers=False), "late_replies"),
    "second MainDevice, a device drops": (
        second_main_device(40, "  - {at_ms: 500, break: el2904}\n"),
        "other_main_device",
    ),
    "second MainDevice, all drop": (
        second_main_device(1000, all_of(500, "break")),
        "other_main_device",
    ),
    "SAFEOP refused": (
        refused("el2904", 2, "refused a state", "SAFEOP refused: AL status 0x12, code 0x001d: ..."),
        "state_refused",
    ),
    "start-up SDO refused after a return": (
        refused("drive_1", 3, "refused a start-up SDO", "0x8010:01: abort code 0x06090030 ..."),
        "sdo_refused",
    ),
    "e-stop and a drive swapped at start": (
        found_at_start(("el1904", 0x22D2, 0x302), ("drive_2", 2, 0x07703052)),
        "devices_swapped_places",
    ),
    "a spare of a known type at start": (
        found_at_start(("el1904", 0x22D2, 0x302)),
        "wrong_device",
    ),
}

# The right ones are named: the first text of the likely cause.
NAMED = {
    "line cut and joined": ("el2904", ""),
    "line cut and joined, the last is missed first": ("el2904", ""),
    "second and fourth of five swapped": ("s2", "s4"),
    "last two of five swapped": ("s4", "s5"),
    "three of five moved on by one": ("s1", "s3, s5"),
    "two of five swapped while running": ("s2", "s4"),
    "address switches of two types exchanged": ("el1904", "el2904"),
    "address switches exchanged while running": ("drive_1", "drive_2"),
    "another device while running": ("drive_2", ""),
    "another device in the middle of the line": ("el2904", ""),
    "SAFEOP refused": ("el2904", ""),
    "start-up SDO refused after a return": ("drive_1", ""),
    "e-stop and a drive swapped at start": ("el1904", "drive_2"),
    "a spare of a known type at start": ("el1904", ""),
}
