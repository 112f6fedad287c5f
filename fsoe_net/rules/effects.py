"""How each of the current runtimes of users handles a mistake today."""

from __future__ import annotations

from fsoe_net.rules.runtime import ROS2, Runtime

_CRASH = "copies through an uninitialised pointer each cycle: crash or silent memory corruption"
_NOTHING = "starts, copies nothing, reports nothing"
_NEVER = "starts and copies; the connection never reaches Data, no message"
_EXCEPTION = "stops with an uncaught exception at start"
_LAYOUT = "starts with wrong offsets: other bytes are copied and shown"
_IGNORED = "ignores the key"

# Every version of ethercat_driver_ros2 with transfers.
_ROS2_EFFECT = {
    "FSN102": "stops at start",
    "FSN104": "stops when it is empty; else " + _NOTHING,
    "FSN105": "reads the first document only",
    "FSN106": "takes the first of the two values (of a param in the URDF the last)",
    "FSN107": _EXCEPTION,
    "FSN108": "does not find the key",
    "FSN109": _IGNORED,
    "FSN110": _EXCEPTION + "; skips an incomplete sm or sdo",
    "FSN111": _EXCEPTION,
    "FSN112": "reads another number, then " + _CRASH,
    "FSN113": "cuts an index to 16 bits; a subindex above 255 is never found, then " + _CRASH,
    "FSN114": "reads octal in slave YAML, decimal in transfer YAML",
    "FSN115": "reads it as a decimal number",
    "FSN116": "treats an unknown word as absent, and also a sync manager of an unknown type; sends "
    "an SDO of an unknown type with a random length",
    "FSN120": _EXCEPTION,
    "FSN121": "skips the module; every later module is addressed as its neighbour",
    "FSN122": "does not find the class and does not start",
    "FSN123": _EXCEPTION,
    "FSN124": _NOTHING,
    "FSN125": _NOTHING,
    "FSN126": "looks for the file in the folder it is started in",
    "FSN127": "never exports the interface; the output stays 0",
    "FSN128": "adds the modules of both components to both masters",
    "FSN129": "does not find the other module, or uses one with the same name",
    "FSN130": "divides by the frequency: the cycle time is undefined",
    "FSN131": "reads the decimal digits before the first other character",
    "FSN133": "stops at start",
    "FSN134": "uses the first of them for every transfer",
    "FSN168": "does not read the module; transfers that name it end in an uncaught exception",
    "FSN201": _EXCEPTION,
    "FSN202": _CRASH,
    "FSN203": _NEVER,
    "FSN204": "lets the last transfer win",
    "FSN205": _NEVER,
    "FSN206": _CRASH,
    "FSN207": _CRASH,
    "FSN208": "copies a wrong length: CRC errors and an endless reset loop",
    "FSN209": "overwrites the bytes after the frame; beyond the image it crashes",
    "FSN210": "copies a wrong length: CRC errors and an endless reset loop",
    "FSN211": "copies a shifted frame; the connection never reaches Data",
    "FSN212": "copies other data inside the frame",
    "FSN213": "also copies the neighbouring bits",
    "FSN214": "overwrites the copied frame: CRC errors",
    "FSN215": _NEVER,
    "FSN216": _NEVER,
    "FSN217": "copies in file order, one cycle late or not",
    "FSN218": "ignores the name",
    "FSN219": "ignores the name",
    "FSN222": "copies nothing for this transfer",
    "FSN223": _NOTHING,
    "FSN224": "copies both nets",
    "FSN225": _NEVER,
    "FSN227": "does not support connections and ignores them",
    "FSN228": "reads transfer_master but does not use it",
    "FSN230": "ignores required: false and always adds the module",
    "FSN233": "does not support kind and copies the bytes",
    "FSN401": "starts with kernel warnings or AL error 0x001d/0x001e",
    "FSN402": "continues with a random length; all following offsets are wrong",
    "FSN403": "uses a different length; all following offsets are wrong",
    "FSN404": _LAYOUT,
    "FSN405": "reads and writes other bits",
    "FSN406": "uses the device's own mapping and registers nothing of this PDO",
    "FSN407": "maps the second list into the first PDO; all offsets are wrong",
    "FSN408": "always reads and writes the first place",
    "FSN409": "stops: PDO entry is not mapped",
    "FSN410": "starts; the working counter stays incomplete",
    "FSN412": "stops at configuration",
    "FSN413": "maps the whole group on both sync managers",
    "FSN414": "reconfigures the first or refuses the second",
    "FSN415": "configures the SubDevice twice",
    "FSN417": "sends the SDOs to the ring position instead of the alias",
    "FSN418": "sends other bytes; above 0x7fffffff it stops with an exception",
    "FSN420": "stops: the domain cannot be configured",
    "FSN422": "reads or writes bytes after the channel, or unassigned bits",
    "FSN423": _EXCEPTION,
    "FSN424": "starts with kernel warnings or AL error 0x001d/0x001e",
    "FSN425": "loses OP (AL status 0x001b) whenever a cycle takes that long",
    "FSN429": "stops with an exception for a command on a tpdo",
    "FSN451": "reads an empty text as `null`, and an empty list or a word in place of a list as no "
    "rows, without a message",
    "FSN475": "never writes the target position; the axis runs to 0 when the drive is enabled",
    "FSN476": "exports the interface without connecting it",
    "FSN481": "never writes the output",
    "FSN482": "writes each command to all of the channels; of states the last one read remains",
    "FSN483": "never sees the other tags",
    "FSN484": "waits without end at its start, and moves no other axis meanwhile",
    "FSN485": "sends no mode of operation, or mode 0",
    "FSN486": "scales as written; the axis runs away from its target",
    "FSN487": "scales as written",
    "FSN488": "sends the SDO as written, and frames at its own rate",
    "FSN489": "sends the SDO; the IgH master then writes rpdo and tpdo, or warns in the kernel log",
    "FSN490": "casts the scaled command to the type of the channel without a check",
    "FSN601": "starts; the FSoE watchdog expires without any fault",
}

# Versions that differ from the others.
_VERSION_EFFECT: dict[Runtime, dict[str, str]] = {
    Runtime.ROS2_2025: {
        "FSN450": "does not read the default; the output stays 0",
        "FSN123": "reads fsoe_config and ignores transfer_config",
        "FSN132": "supports only this name: nothing to fix",
        "FSN228": "reads safety_master but does not use it",
    },
    Runtime.ROS2_2026_06: {"FSN132": "reads the file and logs a warning"},
    Runtime.ROS2_2026_08: {"FSN132": "reads the file and logs a warning"},
    Runtime.ROS2_NEWEST: {
        "FSN132": "reads the file and logs a warning",
        "FSN123": "logs an error and does not start",
        "FSN484": "does not start: it gives up after readiness_timeout_s",
        "FSN230": "leaves the module out when it is absent, then " + _CRASH,
    },
}

_NOT_STATED = "copies by device type: its configuration states neither size nor direction"
_LCEC_EFFECT = {
    **dict.fromkeys(
        ("FSN203", "FSN205", "FSN208", "FSN209", "FSN211", "FSN213", "FSN216", "FSN217"),
        _NOT_STATED,
    ),
    "FSN210": "gives the slot the length of the SubDevice's type",
    "FSN215": "copies both directions of each fsoeSlaveIdx",
    "FSN222": _NOT_STATED,
    "FSN225": "gives the n-th fsoeSlaveIdx the n-th slot in both directions",
    "FSN301": "does not know FSoE addresses",
    "FSN302": "does not know connection IDs",
}


def effect_today(code: str, runtime: Runtime) -> str:
    """Return the behaviour of a runtime with files that raise this code, or an empty text."""
    if runtime in ROS2:
        return _VERSION_EFFECT[runtime].get(code) or _ROS2_EFFECT.get(code, "")
    if runtime is Runtime.LCEC:
        return _LCEC_EFFECT.get(code, "")
    return ""


def effects_today(code: str) -> list[tuple[tuple[Runtime, ...], str]]:
    """Return the behaviour of all other runtimes, grouped by effect; empty if unknown."""
    rows: dict[str, list[Runtime]] = {}
    for runtime in Runtime:
        text = effect_today(code, runtime)
        if text:
            rows.setdefault(text, []).append(runtime)
    return [(tuple(runtimes), text) for text, runtimes in rows.items()]
