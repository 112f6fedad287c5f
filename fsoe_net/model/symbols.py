"""Names for the ordinary process data of a device: a symbol for each value for programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Direction, Entry, EntryView
from fsoe_net.model.layout import DeviceLayout, SmLayout
from fsoe_net.model.names import Names

_MOST_BITS = 64
_SIDES = {False: "in", True: "out"}


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceSymbol:
    """A value outside FSoE frames that a driver registers.

    ``sm`` is the number of the sync manager in the layout, ``bit_offset`` counts from its first
    bit. ``view`` is the type of the bits; for an entry without ``data_mapping``, the whole entry.
    """

    name: str
    sm: int
    is_output: bool
    entry: Entry
    view: EntryView
    bit_offset: int

    @property
    def stated(self) -> str:
        """Return the interface in the slave YAML, or else the name of the entry; may be empty."""
        return _stated(self.entry, self.view)

    @property
    def is_whole(self) -> bool:
        """Whether the symbol is the entry itself, not a part of it."""
        return not self.entry.views


def device_symbols(layout: DeviceLayout) -> tuple[DeviceSymbol, ...]:
    """Return the symbols of a device, by sync manager and place.

    A name is the interface in the slave YAML, or else the name of the entry, or else its address,
    such as ``0x6041:00``. It is unique among the inputs or among the outputs: the command and the
    state of an axis share the interface ``position``, and both keep it.
    """
    found: list[DeviceSymbol] = []
    taken = (Names(between="-"), Names(between="-"))  # of inputs, of outputs
    for manager in layout.managers:
        is_output = manager.sm.direction is Direction.OUTPUT
        for entry, view, bit_offset in _values(manager):
            stated = _stated(entry, view)
            name = taken[is_output].add(*([stated] if stated else []), entry.address)
            found.append(
                DeviceSymbol(
                    name=name,
                    sm=manager.number,
                    is_output=is_output,
                    entry=entry,
                    view=view,
                    bit_offset=bit_offset,
                )
            )
    return tuple(found)


def directed_names(symbols: Sequence[tuple[bool, str]]) -> list[str]:
    """Return a name for each pair of *is output* and name that is unique over both directions.

    This is the name itself, or ``in:NAME`` and ``out:NAME`` if an input and an output share it.
    """
    known = set(symbols)
    shared = {name for is_output, name in symbols if (not is_output, name) in known}
    return [
        f"{_SIDES[is_output]}:{name}" if name in shared else name for is_output, name in symbols
    ]


def _stated(entry: Entry, view: EntryView) -> str:
    return view.command_interface or view.state_interface or entry.name


def _values(manager: SmLayout) -> Iterator[tuple[Entry, EntryView, int]]:
    for placed in manager.placed:
        entry = placed.entry
        first, last = placed.bit_offset, max(placed.bit_offset, placed.end_bit - 1)
        # An entry may begin before a frame and end inside of it.
        in_frame = manager.block_at(first) is not None or manager.block_at(last) is not None
        # Bytes of a frame belong to FSoE: writing them from a program would break the connection.
        if not entry.registered or in_frame or not 0 < entry.bits <= _MOST_BITS:
            continue
        for view in entry.views or (_whole(entry),):
            yield entry, view, first + view.bit


def _whole(entry: Entry) -> EntryView:
    # If no symbol can represent the items of a data_mapping, its interfaces are not those of the
    # channel.
    own = "data_mapping" not in entry.fields
    return EntryView(
        bit=0,
        bits=entry.bits,
        type_name=entry.type_name,
        command_interface=entry.command_interface if own else None,
        state_interface=entry.state_interface if own else None,
        default=entry.default,
        factor=entry.factor,
        offset=entry.offset,
    )
