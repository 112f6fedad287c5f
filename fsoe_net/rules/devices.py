"""FSN4xx: contradictions within one device description."""

from __future__ import annotations

from collections import Counter

from fsoe_net.diag.diagnostic import Related, Severity
from fsoe_net.diag.words import counted
from fsoe_net.model.bus import Device, Direction, Entry, Pdo, SubDevice, Watchdog
from fsoe_net.model.layout import DeviceLayout, Placed, SmLayout
from fsoe_net.rules.context import Context, describe_sm

# 1500 bytes of Ethernet payload, less 2 of the EtherCAT header and 12 of the datagram.
MAX_DATAGRAM_BYTES = 1486
_MAX_SYNC_MANAGERS = 16
_PROFILE_AREA = 0x6000  # below it are objects of the manufacturer, some mapped as padding


def check_devices(ctx: Context) -> None:
    """Check every device description once."""
    for number, device, sub in ctx.devices():
        _pdo_groups(ctx, number, device)
        _pdo_lists(ctx, device)
        _sync_managers(ctx, number, device)
        for sm in device.layout.managers:
            _entries(ctx, sm)
            _sync_manager_size(ctx, sm, sub)
        _entries_twice(ctx, device.layout)
        if number not in ctx.exchanged:  # FSN401 has reported the cause
            _frame_objects(ctx, device.layout)
            _interfaces(ctx, device)
    _image_size(ctx)


def _pdo_groups(ctx: Context, number: int, device: Device) -> None:
    """FSN401: 0x16xx/0x17xx are RxPDOs and 0x1Axx/0x1Bxx TxPDOs on every device with CoE."""
    for group, pdos, foreign in (
        ("rpdo", device.rpdos, range(0x1A00, 0x1C00)),
        ("tpdo", device.tpdos, range(0x1600, 0x1800)),
    ):
        wrong = [p for p in pdos if p.index in foreign]
        if wrong:
            other = "tpdo" if group == "rpdo" else "rpdo"
            ctx.exchanged.add(number)
            ctx.add(
                "FSN401",
                wrong[0].at("index"),
                f"0x{wrong[0].index:04x} is in {group}, but its number belongs to {other}",
                hint=f"move it under {other}: (rpdo = MainDevice to SubDevice, 0x16xx; "
                "tpdo = SubDevice to MainDevice, 0x1axx)",
            )


def _pdo_lists(ctx: Context, device: Device) -> None:
    seen: dict[int, Pdo] = {}
    for pdo in (*device.rpdos, *device.tpdos):
        first = seen.setdefault(pdo.index, pdo)
        if first is not pdo:
            ctx.add(
                "FSN407",
                pdo.at("index"),
                f"PDO 0x{pdo.index:04x} is listed twice; the master finds the first by its "
                "number and fills it with the channels of the second",
                hint="merge the channels into one PDO, or correct the number",
                related=(Related(span=first.at("index"), message="first listed here"),),
            )
        if not pdo.entries:
            ctx.add(
                "FSN406",
                pdo.span,
                f"PDO 0x{pdo.index:04x} has no channels: the device's own mapping is used and "
                "the following offsets are not known offline",
                hint="list its entries, as `ethercat cstruct` or the ESI shows them",
            )


def _sync_managers(ctx: Context, number: int, device: Device) -> None:
    seen: set[int] = set()
    for sm in device.sync_managers:
        # SubDevice controllers have at most 16 sync managers.
        if sm.index >= _MAX_SYNC_MANAGERS or sm.index in seen:
            why = "given twice" if sm.index in seen else "above 15"
            ctx.add(
                "FSN412",
                sm.at("index"),
                f"sync manager {sm.index} is {why}",
                hint="use each number from 0 to 15 once, as the ESI or `ethercat pdos` shows them",
            )
        seen.add(sm.index)
        # RxPDOs are outputs of the MainDevice, TxPDOs its inputs.
        wanted = {"rpdo": Direction.OUTPUT, "tpdo": Direction.INPUT}.get(sm.carries or "")
        if wanted is not None and wanted is not sm.direction:
            # Frames of such a device have the wrong direction; findings about them would be
            # consequences.
            ctx.exchanged.add(number)
            ctx.add(
                "FSN410",
                sm.at("pdo"),
                f"{sm.carries} on SM{sm.index}, which is of type {sm.direction.value}; the FMMU "
                "would point the wrong way and the working counter stay incomplete",
                hint=f"write type: {wanted.value}, or pdo: "
                f"{'tpdo' if sm.carries == 'rpdo' else 'rpdo'}",
            )
    _carriers(ctx, number, device)
    _watchdogs(ctx, device.layout)


def _carriers(ctx: Context, number: int, device: Device) -> None:
    """FSN409, FSN413: each PDO group is on one sync manager."""
    for group, pdos in (("rpdo", device.rpdos), ("tpdo", device.tpdos)):
        carriers = [sm for sm in device.sync_managers if sm.carries == group]
        if pdos and not carriers:
            ctx.unassigned.add(number)
            ctx.add(
                "FSN409",
                device.at("sm"),
                f"no sync manager carries {group}; the master answers “PDO entry is not mapped”",
                # SM2 for outputs and SM3 for inputs is the convention of all devices with mailbox.
                hint=f"add pdo: {group} to SM{2 if group == 'rpdo' else 3}",
            )
        for extra in carriers[1:]:
            ctx.add(
                "FSN413",
                extra.at("pdo"),
                f"{group} is on SM{carriers[0].index} and on SM{extra.index}",
                hint="keep one of them; the format cannot split a group over two sync managers",
                related=(Related(span=carriers[0].at("pdo"), message="first"),),
            )


def _watchdogs(ctx: Context, layout: DeviceLayout) -> None:
    for sm in layout.managers:
        off = sm.sm.watchdog is Watchdog.DISABLE and sm.sm.direction is Direction.OUTPUT
        if off and sm.blocks:
            ctx.add(
                "FSN411",
                sm.sm.at("watchdog"),
                f"the watchdog of SM{sm.sm.index} is off; a silent MainDevice is then noticed by "
                "the FSoE watchdog alone",
                hint="watchdog: enable also stops the standard outputs of this SubDevice",
            )


def _entries(ctx: Context, sm: SmLayout) -> None:
    for placed in sm.placed:
        entry = placed.entry
        used = entry.command_interface or entry.state_interface or entry.default is not None
        is_bits = entry.type_name == "bool" or entry.type_name.startswith("bit")
        # With data_mapping the driver reads the bits itself.
        if not is_bits or entry.is_gap or "data_mapping" in entry.fields:
            continue
        if entry.bits > 8 and used:
            ctx.add(
                "FSN427",
                entry.at("type"),
                f"{entry.address} of type {entry.type_name} has an interface; the driver reads "
                "and writes only one byte of such a type",
                hint="use uint16 … uint64, or bitN only for padding",
            )
        elif used or entry.mask is not None:
            _mask(ctx, placed)


def _mask(ctx: Context, placed: Placed) -> None:
    """FSN405: the driver ignores the bit position, so the mask must select the bits."""
    entry = placed.entry
    shift = placed.bit_offset % 8
    bits = (((1 << entry.bits) - 1) << shift) & 0xFF
    mask = 0xFF if entry.mask is None else entry.mask
    # A bool needs exactly its bit; a wider type may use some of its bits.
    good = mask == bits if entry.bits == 1 else mask != 0 and mask & ~bits == 0
    if good:
        return
    said = "no mask" if entry.mask is None else f"mask {entry.mask}"
    ctx.add(
        "FSN405",
        entry.at("mask"),
        f"{entry.address} lies at bit {shift} of its byte but has {said}; "
        "the driver would use other bits",
        hint=f"write mask: {bits}",
    )


def _sync_manager_size(ctx: Context, sm: SmLayout, sub: SubDevice) -> None:
    # Only for devices with frames: other devices may end within a byte.
    if sm.blocks and sm.complete and sm.bits % 8:
        over = sm.bits % 8
        ctx.add(
            "FSN419",
            sm.placed[-1].entry.at("type"),
            f"{describe_sm(sm)}: the entries add up to {counted(sm.bits, 'bit')}, which is "
            "not a whole number of bytes; a device with FSoE frames maps whole bytes",
            hint=f"padding here is {counted(over, 'bit')} too long or {8 - over} too short; "
            "compare with `ethercat pdos`",
        )
    if sm.size_bytes > MAX_DATAGRAM_BYTES:
        ctx.add(
            "FSN420",
            sm.sm.span if sm.sm.declared else sub.span,
            f"{describe_sm(sm)}: {sm.size_bytes} bytes of process data; one datagram carries "
            f"{MAX_DATAGRAM_BYTES}",
            hint="map fewer entries",
        )


def _entries_twice(ctx: Context, layout: DeviceLayout) -> None:
    first: dict[tuple[int, int], tuple[SmLayout, Placed]] = {}
    idle: dict[str, Entry] = {}
    twice: dict[tuple[int, ...], list[tuple[Placed, Placed]]] = {}  # by both PDOs
    for sm in layout.managers:
        for placed in sm.placed:
            entry = placed.entry
            if entry.is_gap:
                continue
            known_sm, known = first.setdefault((entry.index, entry.subindex), (sm, placed))
            if known is placed:
                continue
            used = entry.command_interface or entry.state_interface or entry.default is not None
            if known_sm.sm.carries == sm.sm.carries and known_sm is not sm:
                continue  # one group on two sync managers is FSN413
            # Input and output of a drive often have the same object.
            if not used and known_sm is not sm:
                continue  # drives map the same object as command and as status
            # Manufacturer objects that are mapped twice without use serve as padding.
            if not used and entry.index < _PROFILE_AREA:
                idle.setdefault(entry.address, entry)
                continue
            pdos = (sm.number, placed.pdo_number, known_sm.number, known.pdo_number)
            twice.setdefault(pdos, []).append((placed, known))
    for rows in twice.values():
        _mapped_twice(ctx, rows)
    if idle:
        ctx.add(
            "FSN408",
            next(iter(idle.values())).at("index"),
            f"mapped more than once, probably as padding: {', '.join(sorted(idle))}",
            severity=Severity.INFO,
            hint="index 0x0000 marks padding clearly",
        )


def _mapped_twice(ctx: Context, rows: list[tuple[Placed, Placed]]) -> None:
    """FSN408 for entries of one PDO that occur twice, in it or another: once for a whole PDO."""
    here, there = rows[0][0].pdo, rows[0][1].pdo
    # PDOs of the same number are reported by another rule.
    if here is not there and here.index == there.index:
        return  # FSN407 has reported the PDO
    # If all entries of a PDO are duplicates, that is one mistake, not one per entry.
    if here is not there and len(rows) == sum(not e.is_gap for e in here.entries) > 1:
        ctx.add(
            "FSN408",
            here.at("index"),
            f"PDO 0x{here.index:04x} maps only entries that PDO 0x{there.index:04x} has; a driver "
            "always gets the first place",
            hint="delete one of the two PDOs, or correct its entries",
            related=(Related(span=there.at("index"), message="first mapped here"),),
        )
        return
    for placed, known in rows:
        ctx.add(
            "FSN408",
            placed.entry.at("index"),
            f"{placed.entry.address} is mapped a second time; a driver always gets the first place",
            hint="use another entry here, or move the interface to the first",
            related=(Related(span=known.entry.span, message="first mapped here"),),
        )


def _frame_objects(ctx: Context, layout: DeviceLayout) -> None:
    """FSN424: a device sends 0x6nnn objects and receives 0x7nnn, if it has both."""
    commands: dict[Direction, list[Entry]] = {Direction.OUTPUT: [], Direction.INPUT: []}
    for sm in layout.managers:
        for block in sm.blocks:
            commands[block.direction].append(block.command)
    taken, sent = commands[Direction.OUTPUT], commands[Direction.INPUT]
    if not taken or not sent:
        return
    # Both exchanged: a single one may be a device with other objects.
    if all(e.index >> 12 == 6 for e in taken) and all(e.index >> 12 == 7 for e in sent):
        ctx.add(
            "FSN424",
            taken[0].at("index"),
            f"the frame at {taken[0].address} stands under rpdo and the one at {sent[0].address} "
            "under tpdo; 0x6nnn objects are what a device sends, 0x7nnn what it takes",
            hint="exchange the channels of rpdo and tpdo; compare with `ethercat pdos` or the ESI",
            related=(Related(span=sent[0].at("index"), message="the other frame"),),
        )


def _interfaces(ctx: Context, device: Device) -> None:
    for group, pdos, key, own in (
        ("tpdo", device.tpdos, "command_interface", "state_interface"),
        ("rpdo", device.rpdos, "state_interface", "command_interface"),
    ):
        for pdo in pdos:
            for entry in pdo.entries:
                # even an empty command of an input stops the driver
                empty = group == "tpdo" and key in entry.fields
                if getattr(entry, key) is None and not empty:
                    continue
                effect = "newer drivers stop with an exception, older ones ignore it"
                ctx.add(
                    "FSN429",
                    entry.at(key),
                    f"{key} on {entry.address}, an entry of a {group}; "
                    + (effect if group == "tpdo" else "the driver ignores it"),
                    severity=None if group == "tpdo" else Severity.INFO,
                    hint=f"use {own} here",
                )


def _image_size(ctx: Context) -> None:
    alike = Counter(ctx.resolution.device_numbers)
    total = sum(
        alike[number] * sm.size_bytes
        for number, device, _ in ctx.devices()
        for sm in device.layout.managers
        if sm.registered
    )
    network = ctx.resolution.network
    if total > MAX_DATAGRAM_BYTES and network.nets:
        ctx.add(
            "FSN421",
            network.span,
            f"the process image has {total} bytes, so it travels in several datagrams with a "
            "working counter each",
            hint="nothing to do; frames are never split, since datagrams are cut between "
            "sync managers",
        )
