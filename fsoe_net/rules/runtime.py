"""Rules that apply only to some current runtimes (FSN460 … FSN469).

``fsn`` is this project's own runtime, ``lcec`` linuxcnc-ethercat. The others are versions of
ethercat_driver_ros2: ``ros2-2025`` has transfers since PR 187/188, ``ros2-2026-06`` is the first
with the bus manager (PR 223), ``ros2-2026-08`` with master plugins (PR 236/238), ``ros2-newest``
clears its transfers on deactivation and supports ``required: false``.
"""

from __future__ import annotations

import enum

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Direction, SubDevice
from fsoe_net.model.drives import CIA402_PLUGIN
from fsoe_net.model.network import NetworkConfig, TransferKind
from fsoe_net.model.transfer_ends import ResolvedTransfer
from fsoe_net.rules.context import Context, few


class Runtime(enum.Enum):
    """The program that will copy, or copies today."""

    FSN = "fsn"
    ROS2_2025 = "ros2-2025"
    ROS2_2026_06 = "ros2-2026-06"
    ROS2_2026_08 = "ros2-2026-08"
    ROS2_NEWEST = "ros2-newest"
    LCEC = "lcec"


# Versions of ethercat_driver_ros2, oldest first.
ROS2 = (Runtime.ROS2_2025, Runtime.ROS2_2026_06, Runtime.ROS2_2026_08, Runtime.ROS2_NEWEST)

# Keys not supported by every version: the first version with the key, and whether copying depends
# on it.
_NEW_KEYS = {
    "transfer_config": (Runtime.ROS2_2026_06, True),
    "transfer_modules": (Runtime.ROS2_2026_06, True),
    "transfer_master": (Runtime.ROS2_2026_06, False),
    "master_plugin": (Runtime.ROS2_2026_08, False),
    "readiness_timeout_s": (Runtime.ROS2_NEWEST, False),
    "required": (Runtime.ROS2_NEWEST, False),
    "sdo_check": (Runtime.ROS2_NEWEST, False),
    "factor_from_sdo": (Runtime.ROS2_NEWEST, False),
    "for": (Runtime.ROS2_NEWEST, True),
}


def check_runtime(ctx: Context, runtime: Runtime) -> None:
    """Add findings that apply only to the chosen runtime."""
    if runtime in ROS2:
        _ros2(ctx, runtime)
    elif runtime is Runtime.LCEC:
        _lcec(ctx)


# -- ethercat_driver_ros2 -------------------------------------------------------------------------


def _ros2(ctx: Context, runtime: Runtime) -> None:
    network = ctx.resolution.network
    nets = [n for n in network.nets if any(t.kind is TransferKind.FSOE for t in n.transfers)]
    for net in nets:
        # Fixed only in the newest version.
        if runtime is not Runtime.ROS2_NEWEST:
            ctx.add(
                "FSN461",
                net.span,
                "versions up to 2026-08 add all transfers once more with each activation, the old "
                "pointers among them",
                hint="restart the process instead of re-activating",
            )
        if runtime is not Runtime.ROS2_2025:
            ctx.add(
                "FSN462",
                net.span,
                "a driver built with PR 228 writes the default of every RxPDO entry each cycle, "
                "also inside the copied frames",
                hint="do not use that branch for safety networks",
            )
    # Only this branch sorts the image in another order.
    if nets and runtime is Runtime.ROS2_2025:
        ctx.add(
            "FSN468",
            nets[0].span,
            "the branch humble-issue-147 registers tpdo before rpdo: its log shows other offsets "
            "than `fsoe-net plan --show`; the copies are the same",
            hint="compare addresses (index and subindex), not offsets, when you use that branch",
        )
    if runtime is Runtime.ROS2_2026_08:
        _drives(ctx)
    if runtime in (Runtime.ROS2_2026_08, Runtime.ROS2_NEWEST):
        _aliases(ctx)
    _new_keys(ctx, network, runtime)
    if runtime is not Runtime.ROS2_NEWEST:
        _several_components(ctx, runtime)


def _drives(ctx: Context) -> None:
    for sub in ctx.resolution.network.subdevices:
        if sub.plugin == CIA402_PLUGIN:
            ctx.add(
                "FSN460",
                sub.at("plugin"),
                f"{sub.name}: this version does not copy while it waits for OP; a drive that "
                "waits for STO release then never gets ready",
                hint="use a version whose activation runs the copies (readiness_timeout_s exists)",
            )


def _several_components(ctx: Context, runtime: Runtime) -> None:
    for sub in ctx.resolution.network.subdevices:
        if len(sub.components) > 1:
            ctx.add(
                "FSN134",
                sub.at("name"),
                f"{runtime.value} configures {sub.name} once for each of "
                f"{few([c.name for c in sub.components])}; each time it writes all its outputs",
                hint="use the newest driver, or one joint",
            )


def _aliases(ctx: Context) -> None:
    for sub in ctx.resolution.network.subdevices:
        if sub.alias:
            ctx.add(
                "FSN469",
                sub.at("alias"),
                f"{sub.name} has alias {sub.alias}: the driver compares vendor and product with "
                "the bus only for SubDevices with alias 0",
                hint="`fsoe-net check NETWORK --interface IF` compares it too",
            )


def _new_keys(ctx: Context, network: NetworkConfig, runtime: Runtime) -> None:
    """FSN463: keys not supported by this version, each once."""
    rows = [network, *network.nets, *network.subdevices]
    rows += [sub.device for sub in network.subdevices if sub.device is not None]
    for _, device, _ in ctx.devices():
        for pdo in (*device.rpdos, *device.tpdos):
            rows += [pdo, *pdo.entries]
    for key, (since, needed) in _NEW_KEYS.items():
        # From this version on, the key is supported.
        if ROS2.index(since) <= ROS2.index(runtime):
            continue
        places = [row.at(key) for row in rows if key in row.fields]
        # These SubDevices come from a section, not from a key of their own.
        if key == "transfer_modules":
            places = [s.span for s in network.subdevices if s.origin == key]
        if not places:
            continue
        ctx.add(
            "FSN463",
            min(places),
            f"{key} is known since {since.value}; {runtime.value} ignores it"
            + _WITHOUT.get(key, ""),
            severity=Severity.WARNING if needed else Severity.INFO,
            hint=_OLD_KEYS.get(key, "leave it out, or use a newer version"),
        )


_WITHOUT = {
    "transfer_config": ", and copies nothing",
    "master_plugin": ", and reads master_id as the number of an IgH master",
    "for": ", and binds an interface to every joint that has one of that name",
}
_OLD_KEYS = {
    "transfer_config": "its name there is fsoe_config",
    "transfer_modules": "its name there is safety_modules",
    "transfer_master": "its name there is safety_master",
    "for": "use the newest driver: no other can tell the joints of one SubDevice apart",
}


# -- linuxcnc-ethercat ----------------------------------------------------------------------------

# Beckhoff product codes for which linuxcnc-ethercat supports FSoE.
_LCEC_MAINS = {0x1AF43052, 0x077E3052}  # EL6900, EL1918
_LCEC_SUBS = {0x07703052: "EL1904", 0x0B583052: "EL2904", 0x16AD6012: "AX5805"}
# Of sittner's own tree and of forks, by whether the type is a MainInstance.
_LCEC_FORKS = {
    True: {0x1AFE3052: "EL6910"},
    False: {0x077A2C52: "EK1914", 0x077E3052: "EL1918"},
}
_LCEC_FRAME_BYTES = {"EL1904": (6,), "EL2904": (6,), "AX5805": (7, 11)}


def _lcec(ctx: Context) -> None:
    rows = [r for r in ctx.resolution.transfers if r.transfer.kind is TransferKind.FSOE]
    mains = {c.main.name for c in ctx.resolution.connections}
    mains |= {net.safety_master for net in ctx.resolution.network.nets if net.safety_master}
    seen: set[str] = set()
    for row in rows:
        for end in (row.source, row.destination):
            sub = end.subdevice
            if sub is not None and sub.name not in seen:
                seen.add(sub.name)
                _lcec_type(ctx, sub, is_main=sub.name in mains)
    _lcec_order(ctx, rows, mains)
    _lcec_lengths(ctx, rows)


def _lcec_type(ctx: Context, sub: SubDevice, *, is_main: bool) -> None:
    if sub.device is None:
        return
    # This type is supported in this role.
    if sub.device.product_code in (_LCEC_MAINS if is_main else _LCEC_SUBS):
        return
    role = "MainInstance" if is_main else "SubInstance"
    fork = _LCEC_FORKS[is_main].get(sub.device.product_code)
    ctx.add(
        "FSN465",
        sub.span,
        f"{sub.name} (product 0x{sub.device.product_code:08x}) has no FSoE support as {role} in "
        "linuxcnc-ethercat 1.42" + (f"; forks have a driver for {fork}" if fork else ""),
        hint="MainInstances: EL6900, EL1918 logic; SubInstances: EL1904, EL2904, AX51xx and AX52xx "
        "with AX5805; `lcec_devices` lists what your version has",
    )


def _lcec_order(ctx: Context, rows: list[ResolvedTransfer], mains: set[str]) -> None:
    """FSN466: the n-th fsoeSlaveIdx of a logic gets its n-th slot, independent of the network."""
    for name in sorted(mains):
        taken: list[tuple[int, ResolvedTransfer]] = []
        for row in rows:
            end = row.destination
            if end.subdevice is None or end.subdevice.name != name or end.layout is None:
                continue
            blocks = [b for sm in end.layout.managers for b in sm.blocks]
            slots = [b.key for b in blocks if b.direction is Direction.OUTPUT]
            if end.block is not None and end.block.key in slots:
                taken.append((slots.index(end.block.key), row))
        taken.sort(key=lambda item: item[0])
        # Slots are assigned in order: the first gap shifts all following ones.
        wrong = next((n for n, (slot, _) in enumerate(taken) if slot > n), None)
        if wrong is None:
            continue
        slot, row = taken[wrong]
        ctx.add(
            "FSN466",
            row.transfer.destination.at("index"),
            f"{row.transfer.source.module} is connected to slot {slot} of {name}; as its "
            f"fsoeSlaveIdx number {wrong + 1}, linuxcnc-ethercat would connect it to slot {wrong}",
            hint="fill the slots of the safety project from the first on, without a gap",
        )


def _lcec_lengths(ctx: Context, rows: list[ResolvedTransfer]) -> None:
    """FSN464: the frame length of a type is built in."""
    for row in rows:
        for end in (row.source, row.destination):
            sub = end.subdevice
            if sub is None or sub.device is None or end.block is None:
                continue
            kind = _LCEC_SUBS.get(sub.device.product_code)
            # The lengths are built into linuxcnc-ethercat.
            if kind is None or end.block.frame_bytes in _LCEC_FRAME_BYTES[kind]:
                continue
            lengths = " or ".join(str(n) for n in _LCEC_FRAME_BYTES[kind])
            ctx.add(
                "FSN464",
                end.endpoint.at("index"),
                f"{end.endpoint} starts a frame of {counted(end.block.frame_bytes, 'byte')}; "
                f"linuxcnc-ethercat copies {lengths} bytes for an {kind}",
                hint=f"correct the PDO of {sub.name}, if the device does send {lengths} bytes",
            )
