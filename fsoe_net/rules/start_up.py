"""FSN489: start-up SDOs that assign or map other PDOs than the lists of the same file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fsoe_net.diag.diagnostic import Related
from fsoe_net.model.bus import Device, Located, Sdo
from fsoe_net.rules.context import Context

_ASSIGNMENT = 0x1C10  # of sync manager 0; subindex 0 is the number of PDOs


def check_start_up(ctx: Context) -> None:
    """Check the start-up SDOs of each device type once."""
    for _, device, _ in ctx.devices():
        written: dict[int, dict[int, Sdo]] = {}
        for sdo in device.sdos:
            # Of several downloads the last one counts: lists are cleared before they are filled.
            written.setdefault(sdo.index, {})[sdo.subindex] = sdo
        for index, name, place, values in _lists(device):
            # Subindex 0 holds the length of the list.
            _compare(ctx, written.get(index, {}), (name, place), [len(values), *values])


def _lists(device: Device) -> Iterator[tuple[int, str, Located, list[int]]]:
    """Yield the objects that the MainDevice writes: index, name, place, values from subindex 1."""
    for sm in device.sync_managers:
        if sm.carries is not None:
            pdos = device.pdos_of(sm)
            place = pdos[0] if pdos else sm
            yield _ASSIGNMENT + sm.index, sm.carries, place, [p.index for p in pdos]
    for pdo in (*device.rpdos, *device.tpdos):
        # Without channels the mapping of the device is used.
        if pdo.entries:
            mapping = [e.index << 16 | e.subindex << 8 | e.bits for e in pdo.entries]
            yield pdo.index, f"PDO 0x{pdo.index:04x}", pdo, mapping


def _compare(
    ctx: Context, sdos: Mapping[int, Sdo], owner: tuple[str, Located], values: Sequence[int]
) -> None:
    for subindex, sdo in sorted(sdos.items()):
        if subindex < len(values) and sdo.raw != values[subindex]:
            name, place = owner
            ctx.add(
                "FSN489",
                sdo.at("value"),
                f"0x{sdo.index:04x}:{subindex:02x} gets 0x{sdo.raw:x}, {name} has "
                f"0x{values[subindex]:x} there: only one of both can take effect",
                hint=f"delete the start-up SDOs of 0x{sdo.index:04x}, or correct {name}",
                related=(Related(span=place.span, message=name),),
            )
            return
