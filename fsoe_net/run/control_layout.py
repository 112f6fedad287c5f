"""Where everything lies in the process image; made from the reply ``layout``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["Layout", "LayoutConnection", "LayoutCopy", "LayoutDatagram", "LayoutSm", "read_layout"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutSm:
    """A sync manager's place in the image."""

    subdevice: str
    sm: int
    is_output: bool
    offset_bytes: int
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutDatagram:
    """A datagram's place in the image; ``expected_wkc`` is ``None`` while unknown."""

    offset_bytes: int
    size_bytes: int
    expected_wkc: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutCopy:
    """Bytes that are moved each cycle; ``name`` may be empty."""

    name: str
    source_byte: int
    destination_byte: int
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutConnection:
    """An FSoE connection and the copies of its frames; ``None`` for what nobody stated."""

    name: str
    main: str
    sub: str
    address: int | None
    connection_id: int | None
    watchdog_ms: int | None
    to_sub: LayoutCopy
    to_main: LayoutCopy


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The process image of the running plan."""

    image_bytes: int
    sms: tuple[LayoutSm, ...]
    datagrams: tuple[LayoutDatagram, ...]
    copies: tuple[LayoutCopy, ...]
    connections: tuple[LayoutConnection, ...]


def read_layout(reply: Mapping[str, Any]) -> Layout:
    """Return the values of a ``layout`` reply.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: The reply has not the form it should have.
    """
    return Layout(
        image_bytes=int(reply["image_bytes"]),
        sms=tuple(
            LayoutSm(
                subdevice=str(row["subdevice"]),
                sm=int(row["sm"]),
                is_output=row["direction"] == "output",
                offset_bytes=int(row["byte"]),
                size_bytes=int(row["bytes"]),
            )
            for row in reply["sms"]
        ),
        datagrams=tuple(
            LayoutDatagram(
                offset_bytes=int(row["byte"]),
                size_bytes=int(row["bytes"]),
                expected_wkc=_number(row.get("expected_wkc")),
            )
            for row in reply["datagrams"]
        ),
        copies=tuple(_copy(row) for row in reply["copies"]),
        connections=tuple(_connection(row) for row in reply["connections"]),
    )


def _copy(row: Mapping[str, Any]) -> LayoutCopy:
    return LayoutCopy(
        name=str(row.get("name") or ""),
        source_byte=int(row["source_byte"]),
        destination_byte=int(row["destination_byte"]),
        size_bytes=int(row["bytes"]),
    )


def _connection(row: Mapping[str, Any]) -> LayoutConnection:
    return LayoutConnection(
        name=str(row["name"]),
        main=str(row["main"]),
        sub=str(row["sub"]),
        address=_number(row["address"]),
        connection_id=_number(row["connection_id"]),
        watchdog_ms=_number(row["watchdog_ms"]),
        to_sub=_copy(row["to_sub"]),
        to_main=_copy(row["to_main"]),
    )


def _number(value: Any) -> int | None:
    return None if value is None else int(value)
