"""Single commands of an ENI: registers of a SubDevice, start-up SDOs."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape

from fsoe_net.model.bus import Pdo, Sdo

APWR, FPRD, FPWR, BRD, BWR = 2, 4, 5, 7, 8
_NOT_XML = dict.fromkeys(
    (*range(0x09), 0x0B, 0x0C, *range(0x0E, 0x20), 0xFFFE, 0xFFFF, *range(0xD800, 0xE000)), " "
)
_AL_CONTROL, _AL_STATUS = 0x0120, 0x0130
_STATES = {
    "IP": ("PREOP", 0x02, 3000),
    "PS": ("SAFEOP", 0x04, 10_000),
    "SO": ("OP", 0x08, 10_000),
}


def plain_text(text: str) -> str:
    """Return text for XML, without invalid characters."""
    return escape(text.translate(_NOT_XML))


def register(
    transition: str,
    code: int,
    address: int,
    ado: int,
    data: bytes,
    *,
    comment: str,
    before: bool = False,
    more: str = "",
) -> str:
    """Return one ``InitCmd``.

    Args:
        transition: Two letters, such as ``IP``.
        code: Command.
        address: Auto-increment or station address.
        ado: Register.
        data: Data to write, or as many zeros as bytes to read.
        comment: Text for people.
        before: Whether it is sent before the commands of the SubDevices.
        more: Elements at its end.
    """
    counter = "" if before else "<Cnt>1</Cnt>"
    first = "<BeforeSlave>true</BeforeSlave>" if before else ""
    return (
        f"<InitCmd><Transition>{transition}</Transition>{first}<Comment>{comment}</Comment>"
        f"<Requires>cycle</Requires><Cmd>{code}</Cmd>"
        f"<Adp>{address}</Adp><Ado>{ado}</Ado><Data>{data.hex()}</Data>{counter}"
        f"<Retries>3</Retries>{more}</InitCmd>"
    )


def al_state(transition: str, station: int) -> Iterator[str]:
    """Request the state of a transition, then wait until it is reached."""
    name, state, timeout_ms = _STATES[transition]
    data = state.to_bytes(2, "little")
    yield register(transition, FPWR, station, _AL_CONTROL, data, comment=f"request {name}")
    validate = (
        f"<Validate><Data>{data.hex()}</Data><DataMask>0f00</DataMask>"
        f"<Timeout>{timeout_ms}</Timeout></Validate>"
    )
    yield register(
        transition, FPRD, station, _AL_STATUS, bytes(2), comment=f"wait for {name}", more=validate
    )


def download(sdo: Sdo, comment: str = "") -> str:
    """Return a start-up SDO."""
    data = sdo.raw.to_bytes(sdo.size_bytes, "little").hex()
    said = f"<Comment>{comment}</Comment>" if comment else ""
    return (
        f"<InitCmd><Transition>PS</Transition>{said}<Timeout>3000</Timeout><Ccs>1</Ccs>"
        f"<Index>{sdo.index}</Index><SubIndex>{sdo.subindex}</SubIndex>"
        f"<Data>{data}</Data></InitCmd>"
    )


def _list(index: int, values: list[int], size_bytes: int, what: str) -> Iterator[str]:
    """Yield commands that clear an object with a list, fill it and then set its length."""
    yield download(Sdo(index=index, subindex=0, size_bytes=1, value=0), f"clear {what}")
    for number, value in enumerate(values, 1):
        yield download(Sdo(index=index, subindex=number, size_bytes=size_bytes, value=value))
    count = Sdo(index=index, subindex=0, size_bytes=1, value=len(values))
    yield download(count, f"length of {what}")


def pdo_mapping(pdo: Pdo) -> Iterator[str]:
    """Write the entries of a PDO: index, subindex and bits of each in 4 bytes."""
    # ETG.1000.6: padding is mapped as subindex 0 of its index, with its length in bits.
    entries = [e.index << 16 | (0 if e.is_gap else e.subindex << 8) | e.bits for e in pdo.entries]
    yield from _list(pdo.index, entries, 4, f"PDO 0x{pdo.index:04x}")


def pdo_assignment(sm: int, pdos: tuple[Pdo, ...]) -> Iterator[str]:
    """Write the PDOs that a sync manager carries."""
    yield from _list(0x1C10 + sm, [p.index for p in pdos], 2, f"PDOs of SM{sm}")
