"""The copy plan in memory: plain records, numbered as in the file.

Records are named tuples of the stored values, in their order: a large bus has hundreds of
thousands, and creating a frozen dataclass takes several times as long. They replace the `index`
method of tuples. Records that are stored in another form may be data classes.
"""

from __future__ import annotations

import os
import zlib
from typing import TYPE_CHECKING, NamedTuple

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.words import counted
from fsoe_net.errors import InputError, PlanFormatError
from fsoe_net.fsoe.parameters import FsoeParameters

if TYPE_CHECKING:
    from fsoe_net.plan.fingerprint import Fingerprint

NONE = 0xFFFFFFFF


class PlanSubDevice(NamedTuple):
    """One SubDevice; see the plan format for every field."""

    name: str
    alias: int
    position: int
    vendor_id: int
    product_code: int
    revision_low: int
    revision_high: int
    first_sm: int
    sm_count: int
    first_sdo: int
    sdo_count: int
    assign_activate: int
    in_copy: bool
    driver: str = ""


class PlanSyncManager(NamedTuple):
    """One sync manager; ``direction`` 1 output, 2 input; ``watchdog`` 0 unchanged, 1 on, 2 off."""

    subdevice: int
    index: int  # type: ignore[assignment]
    direction: int
    watchdog: int
    registered: bool
    bits: int
    first_pdo: int
    pdo_count: int

    @property
    def size_bytes(self) -> int:
        """Length of the process data, rounded up to bytes."""
        return (self.bits + 7) // 8

    @property
    def is_output(self) -> bool:
        """Whether the MainDevice writes it."""
        return self.direction == 1


class PlanPdo(NamedTuple):
    """One PDO."""

    index: int  # type: ignore[assignment]
    first_entry: int
    entry_count: int
    bit_offset: int


class PlanEntry(NamedTuple):
    """One entry; ``kind`` 0 bits, 1 bool, 2 signed, 3 unsigned, 4 floating point."""

    index: int  # type: ignore[assignment]
    subindex: int
    registered: bool
    bits: int
    kind: int
    bit_offset: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSdo:
    """One start-up SDO; ``value`` may be negative."""

    index: int
    subindex: int
    size_bytes: int
    value: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSymbol:
    """One named entry of ordinary process data.

    ``stop_value``: value of an output without a writer: raw bits, 0 for inputs. The value of an
    input is ``factor * raw + offset``; an output gets ``factor * value + offset`` as raw.
    """

    name: str
    sm: int
    bit_offset: int
    bits: int
    kind: int
    output: bool
    restart_relevant: bool
    stop_value: int = 0
    factor: float = 1.0
    offset: float = 0.0


class PlanBlock(NamedTuple):
    """One recognised FSoE frame."""

    sm: int
    byte_offset: int
    frame_bytes: int
    safe_bytes: int
    copied: bool


class PlanCopy(NamedTuple):
    """One copy; ``kind`` 1 FSoE frame, 2 standard data; ``connection`` may be `NONE`."""

    source_sm: int
    source_bit: int
    destination_sm: int
    destination_bit: int
    bits: int
    net: str
    kind: int
    connection: int

    @property
    def size_bytes(self) -> int:
        """Number of bytes copied."""
        return self.bits // 8


class PlanConnection(NamedTuple):
    """One FSoE connection: a pair of copies; ``None`` for facts that are not stated.

    ``app_parameters``: hex digits, empty if not stated.
    """

    name: str
    net: str
    main: int
    sub: int
    copy_to_sub: int
    copy_to_main: int
    connection_id: int | None
    address: int | None
    watchdog_ms: int | None
    safe_to_sub: int
    safe_to_main: int
    app_parameters: str = ""

    @property
    def parameters(self) -> FsoeParameters:
        """The stated parameters."""
        app = bytes.fromhex(self.app_parameters)
        return FsoeParameters(
            connection_id=self.connection_id,
            address=self.address,
            watchdog_ms=self.watchdog_ms,
            app_bytes=len(app) if app else None,
            app_crc=zlib.crc32(app) if app else None,
        )


class PlanBus(NamedTuple):
    """One of several buses: its SubDevices are consecutive. The cycle is in nanoseconds."""

    name: str
    cycle_ns: int
    first_subdevice: int
    subdevice_count: int


class PlanGroup(NamedTuple):
    """Consecutive SubDevices that may be absent; groups of one place exclude each other.

    ``place`` is empty without alternatives.
    """

    name: str
    place: str
    first_subdevice: int
    subdevice_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """All records of a plan, in file order.

    ``safety_sha256``: hash of the safety functions in hex, empty if none is stated. ``buses``: at
    least two, or none for a single bus without a name. ``cycle_ns`` is that of the first.
    """

    cycle_ns: int
    subdevices: tuple[PlanSubDevice, ...]
    sync_managers: tuple[PlanSyncManager, ...]
    pdos: tuple[PlanPdo, ...]
    entries: tuple[PlanEntry, ...]
    sdos: tuple[PlanSdo, ...]
    symbols: tuple[PlanSymbol, ...]
    blocks: tuple[PlanBlock, ...]
    copies: tuple[PlanCopy, ...]
    connections: tuple[PlanConnection, ...]
    safety_sha256: str = ""
    buses: tuple[PlanBus, ...] = ()
    groups: tuple[PlanGroup, ...] = ()

    def __repr__(self) -> str:
        """Return one line: the cycle and the number of SubDevices, connections and copies."""
        sizes = (
            counted(len(self.subdevices), "SubDevice"),
            counted(len(self.connections), "connection"),
            counted(len(self.copies), "copy"),
        )
        return f"<Plan: cycle {self.cycle_ns / 1e6:g} ms, {', '.join(sizes)}>"

    @property
    def format(self) -> str:
        """Required version of the plan format."""
        if self.groups:
            return "1.3"
        if self.buses:
            return "1.2"
        return "1.1" if self.safety_sha256 else "1.0"

    def bus_number(self, subdevice: int) -> int:
        """Return the number of the bus of a SubDevice."""
        ends = (b.first_subdevice + b.subdevice_count for b in self.buses)
        return next((number for number, end in enumerate(ends) if subdevice < end), 0)

    def way_cycle_ns(self, main: int, sub: int) -> int:
        """Return the longest bus cycle between two SubDevices; the first bus has the shortest."""
        cycles = [self.buses[self.bus_number(n)].cycle_ns for n in (main, sub) if self.buses]
        return max(cycles, default=self.cycle_ns)

    def group_number(self, subdevice: int) -> int | None:
        """Return the number of the group of a SubDevice, or ``None`` if it is always present."""
        for number, group in enumerate(self.groups):
            if 0 <= subdevice - group.first_subdevice < group.subdevice_count:
                return number
        return None

    def is_first_choice(self, group: PlanGroup) -> bool:
        """Return whether an emulation starts with it: the first of its place, or without one."""
        return not group.place or group == next(g for g in self.groups if g.place == group.place)

    def to_bytes(self) -> bytes:
        """Return the bytes of the `.fsnplan` file; equal plans give equal bytes."""
        from fsoe_net.plan.codec import encode_plan

        return encode_plan(self)

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the `.fsnplan` file, completely or not at all.

        Raises:
            InputError: The file exists and must not be replaced.
            EnvironmentFault: The file cannot be written; the existing content is unchanged.
        """
        from fsoe_net.formats.shared.write_files import write_whole

        write_whole(path, self.to_bytes(), overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Plan:
        """Read a `.fsnplan` file, and check that its tables are consistent.

        Raises:
            InputError: The file cannot be read.
            PlanFormatError: The file is not a valid plan.
        """
        from fsoe_net.formats.shared.files import Collector, read_bytes
        from fsoe_net.formats.shared.limits import MAX_PLAN_BYTES
        from fsoe_net.plan.codec import decode_plan

        name, out = os.fspath(path), Collector()
        data = read_bytes(name, out, most=MAX_PLAN_BYTES)
        if data is None:
            raise InputError(f"{name} cannot be read", out.diagnostics)
        try:
            return decode_plan(data)
        except PlanFormatError as exc:
            raise PlanFormatError(f"{name}: {exc}") from exc

    def show(self) -> str:
        """Return its connections and copies as tables with names, offsets and lengths."""
        from fsoe_net.plan.show import plan_text

        return plan_text(self)

    @property
    def fingerprint(self) -> Fingerprint:
        """The fingerprint of everything safety-relevant in the plan."""
        from fsoe_net.plan.fingerprint import fingerprint_of

        return fingerprint_of(self)
