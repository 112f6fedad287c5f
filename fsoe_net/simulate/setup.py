"""The FSoE facts of an emulated connection; missing ones are selected and reported."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.pdu import safe_data_length
from fsoe_net.model.resolve import Connection, Resolution

DEFAULT_WATCHDOG_MS = 100  # the default of TwinSAFE


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeSetup:
    """Configuration of both ends of a connection.

    ``main`` configures its MainInstance; ``chosen`` names the facts that no file states.
    """

    connection: Connection
    main: MainConfig
    chosen: tuple[str, ...]

    @property
    def sub(self) -> SubConfig:
        """Configuration of its SubInstance."""
        return SubConfig(
            address=self.main.address,
            safe_out_bytes=self.main.safe_out_bytes,
            safe_in_bytes=self.main.safe_in_bytes,
            app_parameter_bytes=len(self.main.app_parameters),
        )


def choose_setups(resolution: Resolution) -> list[FsoeSetup]:
    """Complete the facts of every connection: lowest free numbers, in the order of connections.

    Raises:
        ConfigError: A fact is outside its range.
        PduSizeError: A frame has an invalid length.
    """
    rows = resolution.connections
    # Stated numbers are reserved first, because a later connection may state a low one.
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
            FsoeSetup(
                connection=connection,
                main=MainConfig(
                    connection_id=next(ids) if connection_id is None else connection_id,
                    address=next(addresses) if address is None else address,
                    watchdog_ms=DEFAULT_WATCHDOG_MS if watchdog_ms is None else watchdog_ms,
                    safe_out_bytes=safe_data_length(connection.to_sub.transfer.size_bytes),
                    safe_in_bytes=safe_data_length(connection.to_main.transfer.size_bytes),
                    app_parameters=stated.app_parameters,
                ),
                # Selected values are reported, because the real device has others.
                chosen=tuple(name for name in names if getattr(stated, name) is None),
            )
        )
    return setups
