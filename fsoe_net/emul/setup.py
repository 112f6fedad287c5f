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
    used_ids = {c.facts.connection_id for c in rows if c.facts and c.facts.connection_id}
    used_addresses = {c.facts.address for c in rows if c.facts and c.facts.address is not None}
    ids = (n for n in range(1, 0x10000) if n not in used_ids)
    addresses = (n for n in range(1, 0x10000) if n not in used_addresses)
    setups = []
    for connection in rows:
        facts = connection.facts
        connection_id = facts.connection_id if facts else None
        address = facts.address if facts else None
        watchdog_ms = facts.watchdog_ms if facts else None
        chosen = [
            name
            for name, value in (
                ("connection_id", connection_id),
                ("address", address),
                ("watchdog_ms", watchdog_ms),
            )
            if value is None
        ]
        setups.append(
            ConnectionSetup(
                connection=connection,
                connection_id=next(ids) if connection_id is None else connection_id,
                address=next(addresses) if address is None else address,
                watchdog_ms=DEFAULT_WATCHDOG_MS if watchdog_ms is None else watchdog_ms,
                app_parameters=facts.app_parameters if facts else b"",
                chosen=tuple(chosen),
            )
        )
    return setups
