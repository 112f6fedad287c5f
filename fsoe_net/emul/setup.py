"""The FSoE facts an emulated connection runs with; what nobody stated is chosen and said so."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.model.resolve import Connection, Resolution

__all__ = ["ConnectionSetup", "choose_setups"]

DEFAULT_WATCHDOG_MS = 100  # what TwinSAFE starts with


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionSetup:
    """A connection with all its facts. ``chosen`` names those that no file states."""

    connection: Connection
    connection_id: int
    address: int
    watchdog_ms: int
    app_parameters: bytes
    chosen: tuple[str, ...]


def choose_setups(resolution: Resolution) -> list[ConnectionSetup]:
    """Complete the facts of every connection: lowest free numbers, in the order of connections."""
    rows = resolution.connections
    used_ids = {c.stated.connection_id for c in rows}
    used_addresses = {c.stated.address for c in rows}
    ids = (n for n in range(1, 0x10000) if n not in used_ids)
    addresses = (n for n in range(1, 0x10000) if n not in used_addresses)
    setups = []
    for connection in rows:
        stated = connection.stated
        connection_id, address = stated.connection_id, stated.address
        watchdog_ms = stated.watchdog_ms
        names = ("connection_id", "address", "watchdog_ms")
        setups.append(
            ConnectionSetup(
                connection=connection,
                connection_id=next(ids) if connection_id is None else connection_id,
                address=next(addresses) if address is None else address,
                watchdog_ms=DEFAULT_WATCHDOG_MS if watchdog_ms is None else watchdog_ms,
                app_parameters=stated.app_parameters,
                chosen=tuple(name for name in names if getattr(stated, name) is None),
            )
        )
    return setups
