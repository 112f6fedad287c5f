"""Results of a scan of the bus; ``None`` if a value was not readable."""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.words import identity_text
from fsoe_net.model.bus import Located, Pdo

# Error indication, bit 4 of the AL status register 0x0130 (ETG.1000.6).
_ERROR_FLAG = 0x10


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedSm(Located):
    """One sync manager.

    Attributes:
        index: Its number.
        kind: ``outputs``, ``inputs``, ``mailbox_out`` or ``mailbox_in``.
        start_byte: Start address in the memory of the SubDevice.
        size_bytes: Its length.
        source: Source of assignment and mapping: ``coe``, ``sii`` or empty.
        pdos: Assigned PDOs in order; ``None`` if they were not read.
        complete: Whether it was read completely, so that its length is known.
    """

    index: int
    kind: str
    start_byte: int | None = None
    size_bytes: int | None = None
    source: str = ""
    pdos: tuple[Pdo, ...] | None = None
    complete: bool = True

    @property
    def is_process_data(self) -> bool:
        """Whether it carries process data instead of mailbox messages."""
        return self.kind in ("outputs", "inputs")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedConnection(Located):
    """One FSoE connection as a device reports it: object 0x9nn1, 0xE9n1 or 0x6791.

    ``watchdog_ms`` in ms; ``state``: 100 Reset, 101 Session, 102 Connection, 103 Parameter,
    104 Data, 105 Data with FailSafeData.
    """

    object_index: int
    address: int | None = None
    connection_id: int | None = None
    watchdog_ms: int | None = None
    state: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedFsoe(Located):
    """FSoE addresses of a device (0xF980:01, …) and its report about its connections.

    Attributes:
        address: The first of ``addresses``; most devices have one.
        addresses: FSoE addresses of its SubInstances.
        connections: Connections of its MainInstances, and those with an unknown side.
        given: Connections of its SubInstances: values received from their MainInstances, 0 before.
    """

    address: int | None = None
    addresses: tuple[int, ...] = ()
    connections: tuple[ScannedConnection, ...] = ()
    given: tuple[ScannedConnection, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedPort(Located):
    """One port; counters count up to 255."""

    port: int
    link: bool | None = None
    link_lost: int = 0
    rx_errors: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedSubDevice(Located):
    """One SubDevice in ring order.

    ``al_code_text``: the AL status code in words, may be empty; ``problems``: unreadable data, in
    words.
    """

    position: int
    alias: int = 0
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str = ""
    al_status: int | None = None
    al: str = ""
    al_code: int | None = None
    al_code_text: str = ""
    mailbox: tuple[str, ...] = ()
    dc: bool | None = None
    ports: tuple[ScannedPort, ...] = ()
    sms: tuple[ScannedSm, ...] | None = None
    fsoe: ScannedFsoe | None = None
    planned: str | None = None
    problems: tuple[str, ...] = ()

    @property
    def is_silent(self) -> bool:
        """Whether a running ``fsn-master`` found it before, but it no longer answers."""
        return self.al_status == 0

    @property
    def in_error(self) -> bool:
        """Whether its AL status has the error flag."""
        return bool((self.al_status or 0) & _ERROR_FLAG)

    @property
    def al_error(self) -> str:
        """Its AL status code in words; empty without the error flag."""
        if not self.in_error:
            return ""
        words = f": {self.al_code_text}" if self.al_code_text else ""
        return f"AL status code 0x{self.al_code or 0:04x}{words}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for a person: its error, and unreadable data."""
        return tuple(text for text in (self.al_error, *self.problems) if text)

    @property
    def process_data(self) -> tuple[ScannedSm, ...]:
        """Return its non-empty sync managers of process data."""
        return tuple(s for s in self.sms or () if s.is_process_data and (s.size_bytes or s.pdos))

    @property
    def numbers(self) -> tuple[int, int] | None:
        """Vendor and product; ``None`` unless both were read."""
        if self.vendor_id is None or self.product_code is None:
            return None
        return self.vendor_id, self.product_code

    @property
    def identity(self) -> str:
        """``vendor 0x00000002, product 0x07703052``."""
        numbers = self.numbers
        return "an identity that could not be read" if numbers is None else identity_text(*numbers)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Located):
    """A whole bus at one moment, SubDevices in ring order.

    ``states_changed``: SubDevices were set to PREOP for reading.
    """

    interface: str
    backend: str = ""
    utc: str = ""
    states_changed: bool = False
    subdevices: tuple[ScannedSubDevice, ...] = ()
