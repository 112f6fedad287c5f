"""Failures made from what recovery pages say somebody sees, with a cause that page names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from incident.rig import CELL, DRIVE, MS, Rig, Seed, changed_cycle, config, edited, found, network
from incident.seeds_bus import EVERYBODY, all_of, watchdog


def slot_not_assigned(tmp: Path) -> Path:
    """Bus in OP, one connection never leaves Reset: its slot in the logic has nothing behind it."""
    rig = Rig(network(CELL, tmp), tmp)
    rig.wire("el6910", inputs=lambda _, data: bytes(6) + data[6:])
    rig.run(1_500)
    return rig.end()


def factory_address(tmp: Path) -> Path:
    """Nothing works after a device was exchanged: the new one has the address of the factory."""
    rig = Rig(network(CELL, tmp), tmp)
    rig.session.network.set_address("el2904", 65535)
    rig.run(1_500)
    return rig.end()


def checksum_after_download(tmp: Path) -> Path:
    """Another connection goes on; this one starts anew again and again with code 11."""
    rig = Rig(network(CELL, tmp), tmp)
    config(rig.ports("el6910-drive_2")[1], verify=lambda _: 11)
    rig.run(1_500)
    return rig.end()


def written_in_pieces(tmp: Path) -> Path:
    """CRC errors in bursts: firmware that writes the front of its frame one cycle late."""
    rig = Rig(network(CELL, tmp), tmp)
    before = {"data": b""}

    def torn(sm: int, data: bytes) -> bytes:
        old, before["data"] = before["data"] or data, data
        late = rig.now_ns > 500 * MS and sm == 3
        return old[:60] + data[60:] if late else data

    rig.wire("drive_1", inputs=torn)
    rig.run(1_700)
    return rig.end()


def coalesced(tmp: Path) -> Path:
    """After hours it trips: the network card hands out replies in handfuls."""
    rig = Rig(network(CELL, tmp, watchdog(12)), tmp)

    def handfuls(glance: Any) -> Any:
        cycles = max(0, rig.now_ns // MS - 500)
        whole, rest = divmod(cycles, 16)
        held = rest < 15 and cycles > 0
        return changed_cycle(
            glance,
            actual_wkc=0 if held else glance.actual_wkc,
            lost_frames=whole * 15 + min(rest, 15),
            old_replies=whole * 15,
        )

    rig.cycle_images(handfuls)
    for name in EVERYBODY:
        rig.runs(name, lambda now: now < 500 * MS or now // MS % 16 == 15)
    rig.run(2_000)
    return rig.end()


def gone_and_nobody_noticed(tmp: Path) -> Path:
    """The machine goes on with old inputs; somebody presses the button that keeps the window."""
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, break: el1904}\n")
    rig.run(900)
    rig.recorder.request("outputs went off, no alarm")
    rig.run(1_100)
    return rig.end()


def safeop_with_error(tmp: Path) -> Path:
    """A SubDevice in SAFEOP with ERR, AL status code 0x001B; the others go on."""
    rig = Rig(network(CELL, tmp), tmp)
    rig.runs("el2904", lambda now: now < 500 * MS)
    rig.run(1_700)
    return found(rig.end(), "el2904", al="SAFEOP+ERROR", al_code=0x1B)


def two_programs(tmp: Path) -> Path:
    """Connections of two safety programs, each numbered from 1, meet on one bus."""
    ids = ("address: 201, connection_id: 3", "address: 201, connection_id: 1")
    rig = Rig(network(CELL, tmp, ids), tmp, plan=network(CELL, tmp))
    rig.run(1_000)
    rig.recorder.request("they disturb each other")
    rig.run(1_100)
    return rig.end()


def backup_at_night(tmp: Path) -> Path:
    """All connections at the same moment, now and then: another program took the processor."""
    rig = Rig(network(CELL, tmp), tmp)
    rig.run(2_000, lambda now: 180 * MS if 900 * MS <= now < 901 * MS else 0)
    return rig.end()


def moved_cable(tmp: Path) -> Path:
    """Bursts without data whenever an axis moves; error counters rise at one port."""
    steps = "".join(
        all_of(at, "break") + all_of(at + ms, "heal")
        for at, ms in ((400, 60), (520, 60), (640, 115))
    )
    rig = Rig(network(CELL, tmp), tmp, steps=steps)
    rig.run(1_700)
    errors = [0, 37, 0, 0]
    return found(rig.end(), "el2904", rx_errors=errors)


def commissioning_laptop(tmp: Path) -> Path:
    """States change by themselves after somebody plugged in a laptop with the maker's tool."""
    rig = Rig(network(CELL, tmp), tmp)
    rig.runs("drive_1", lambda now: now < 500 * MS)
    rig.cycle_images(
        lambda g: changed_cycle(g, foreign_frames=max(0, rig.now_ns // MS - 300) // 10)
    )
    rig.run(1_700)
    return found(rig.end(), "drive_1", al="PREOP")


def older_firmware(tmp: Path) -> Path:
    """After an exchange the drive stays in PREOP: its release maps other process data."""
    rig = Rig(network(CELL, tmp), tmp, steps="  - {at_ms: 500, break: drive_2}\n")
    rig.run(1_700)
    detail = "PDO 0x1a00 has 3 entries, the plan has 4"
    return found(rig.end(), "drive_2", al="PREOP", found_text="other process data", detail=detail)


def motion_group_stopped(tmp: Path) -> Path:
    """Everything in Data, and the outputs stay off: nobody pressed reset."""
    rig = Rig(network(CELL, tmp), tmp, steps=f"  - {{at_ms: 9000, local_reset: {DRIVE}}}\n")
    rig.run(1_500)
    rig.recorder.request("no torque")
    rig.run(1_100)
    return edited(rig.end(), lambda head: head.update(fsoe=[]))


SYMPTOMS: dict[str, Seed] = {
    "slot of the logic not assigned": (slot_not_assigned, "main_not_running"),
    "new device with the address of the factory": (factory_address, "wrong_address"),
    "checksum differs after a download": (checksum_after_download, "parameters_refused"),
    "frame written in pieces": (written_in_pieces, "frames_damaged"),
    "network card that coalesces": (coalesced, "late_replies"),
    "gone and the machine goes on": (gone_and_nobody_noticed, "device_lost"),
    "SAFEOP with sync manager watchdog": (safeop_with_error, "device_state"),
    "two safety programs on one bus": (two_programs, "duplicate_connection_id"),
    "processor taken away for 180 ms": (backup_at_night, "stalled_main_device"),
    "cable that moves with an axis": (moved_cable, "lost_frames"),
    "commissioning laptop": (commissioning_laptop, "other_main_device"),
    "device with an older firmware": (older_firmware, "wrong_mapping"),
    "reset was not pressed": (motion_group_stopped, "failsafe"),
}
