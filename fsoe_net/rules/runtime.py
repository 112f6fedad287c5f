"""What the user's *present* runtime does today with a mistake, and what only some runtimes mind.

``fsn`` is this project's own runtime. ``ros2-2025`` is ethercat_driver_ros2 as of PR 187/188,
``ros2-2026`` its newest versions with the bus manager, ``lcec`` linuxcnc-ethercat.
"""

from __future__ import annotations

import enum

from fsoe_net.model import TransferKind
from fsoe_net.rules.context import Context

__all__ = ["Runtime", "check_runtime", "effect_today"]


class Runtime(enum.Enum):
    """The program that will copy, or copies today."""

    FSN = "fsn"
    ROS2_2025 = "ros2-2025"
    ROS2_2026 = "ros2-2026"
    LCEC = "lcec"


_CRASH = "copies through an uninitialised pointer each cycle: crash or silent memory corruption"
_NOTHING = "starts, copies nothing, reports nothing"
_NEVER = "starts and copies; the connection never reaches Data, no message"
_EXCEPTION = "stops with an uncaught exception at start"
_LAYOUT = "starts with wrong offsets: other bytes are copied and shown"

_ROS2_EFFECT = {
    "FSN105": "reads the first document only",
    "FSN106": "takes the first of the two values",
    "FSN107": _EXCEPTION,
    "FSN108": "does not find the key",
    "FSN109": "ignores the key",
    "FSN110": _EXCEPTION,
    "FSN112": "reads another number, then " + _CRASH,
    "FSN114": "reads octal in slave YAML, decimal in transfer YAML",
    "FSN120": _EXCEPTION,
    "FSN121": "skips the module; every later module is addressed as its neighbour",
    "FSN123": _EXCEPTION,
    "FSN124": _NOTHING,
    "FSN125": _NOTHING,
    "FSN127": "never exports the interface; the output stays 0",
    "FSN201": _EXCEPTION,
    "FSN202": _CRASH,
    "FSN203": _NEVER,
    "FSN204": "lets the last transfer win",
    "FSN205": _NEVER,
    "FSN206": _CRASH,
    "FSN207": _CRASH,
    "FSN208": "copies a wrong length: CRC errors and an endless reset loop",
    "FSN209": "overwrites what lies behind the frame; past the image it crashes",
    "FSN210": "copies a wrong length: CRC errors and an endless reset loop",
    "FSN211": "copies a shifted frame; the connection never reaches Data",
    "FSN212": "copies other data inside the frame",
    "FSN213": "copies the neighbouring bits too",
    "FSN214": "overwrites the copied frame: CRC errors",
    "FSN215": _NEVER,
    "FSN216": _NEVER,
    "FSN217": "copies in file order, one cycle late or not",
    "FSN218": "ignores the name",
    "FSN222": "copies nothing for this transfer",
    "FSN223": _NOTHING,
    "FSN225": _NEVER,
    "FSN230": _CRASH,
    "FSN401": "starts with kernel warnings or AL error 0x001d/0x001e",
    "FSN402": _LAYOUT,
    "FSN403": _LAYOUT,
    "FSN404": _LAYOUT,
    "FSN405": "reads and writes other bits",
    "FSN407": "maps the second list into the first PDO; all offsets are wrong",
    "FSN409": "stops: PDO entry is not mapped",
    "FSN410": "starts; the working counter stays incomplete",
    "FSN412": "stops at configuration",
    "FSN414": "reconfigures the first or refuses the second",
    "FSN415": "configures the SubDevice twice",
}


def effect_today(code: str, runtime: Runtime) -> str:
    """Return what a runtime does with files that raise this code, or an empty text."""
    if runtime in (Runtime.ROS2_2025, Runtime.ROS2_2026):
        return _ROS2_EFFECT.get(code, "")
    return ""


# Product codes with FSoE support in linuxcnc-ethercat: EL1904, EL2904, EL6900, EL1918, AX5805.
_LCEC_PRODUCTS = {0x07703052, 0x0B583052, 0x1AF43052, 0x077E3052, 0x16AD6012}


def check_runtime(ctx: Context, runtime: Runtime) -> None:
    """Add what only the chosen runtime minds (FSN460 … FSN465)."""
    if runtime is Runtime.FSN:
        return
    for net in ctx.resolution.network.nets:
        if not any(t.kind is TransferKind.FSOE for t in net.transfers):
            continue
        if runtime in (Runtime.ROS2_2025, Runtime.ROS2_2026):
            ctx.add(
                "FSN461",
                net.span,
                "versions up to 2026-08 add all transfers once more with each activation, the old "
                "pointers among them",
                hint="restart the process instead of re-activating",
            )
        if runtime is Runtime.ROS2_2026:
            ctx.add(
                "FSN462",
                net.span,
                "a driver built with PR 228 writes the default of every RxPDO entry each cycle, "
                "also inside the copied frames",
                hint="do not use that branch for safety networks",
            )
    if runtime is Runtime.ROS2_2026:
        _drives(ctx)
    if runtime is Runtime.LCEC:
        _lcec(ctx)


def _drives(ctx: Context) -> None:
    for sub in ctx.resolution.network.subdevices:
        if sub.plugin == "ethercat_generic_plugins/EcCiA402Drive":
            ctx.add(
                "FSN460",
                sub.at("plugin"),
                f"{sub.name}: versions of mid 2026 do not copy while they wait for OP; a drive "
                "that waits for STO release then never gets ready",
                hint="use a version whose activation runs the copies (readiness_timeout_s exists)",
            )


def _lcec(ctx: Context) -> None:
    touched = {
        end.subdevice.name
        for row in ctx.resolution.transfers
        for end in (row.source, row.destination)
        if end.subdevice is not None and row.transfer.kind is TransferKind.FSOE
    }
    for sub in ctx.resolution.network.subdevices:
        if sub.name not in touched or sub.device is None:
            continue
        if sub.device.product_code not in _LCEC_PRODUCTS:
            ctx.add(
                "FSN465",
                sub.span,
                f"{sub.name} (product 0x{sub.device.product_code:08x}) has no FSoE support in "
                "linuxcnc-ethercat",
                hint="supported: EL1904, EL2904, EL6900, EL1918 logic, AX5805",
            )
