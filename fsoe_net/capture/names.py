"""Names for captured items: the connection that a ConnID belongs to, the meaning of its bits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.capture.wire import LogicalImage
from fsoe_net.core.scan import FoundConnection
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.signals import Signal, connection_signals


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionNames:
    """Names of one connection of a network, for readers.

    Attributes:
        name: Name of the connection.
        ends: Names of the SubDevices: MainInstance, SubInstance.
        signals: Safe data by direction: 0 main to sub, 1 sub to main.
        frame_bytes: Length of the frames by direction.
        connection_id: As stated in the files, or ``None``.
        addresses: Logical addresses of its frames by direction, at the IgH MainDevice.
    """

    name: str
    ends: tuple[str, str]
    signals: tuple[tuple[Signal, ...], tuple[Signal, ...]]
    frame_bytes: tuple[int, int]
    connection_id: int | None
    addresses: tuple[frozenset[int], frozenset[int]]

    def values(self, direction: int, safe_data: bytes) -> str:
        """Return the named values of some safe data, e.g. ``STO=1 SS1=0``."""
        return " ".join(
            f"{s.label or s.address}={s.read(safe_data)}" for s in self.signals[direction]
        )

    def signal_values(self, direction: int, safe_data: bytes) -> dict[str, dict[str, object]]:
        """Return the values of some safe data by signal name, with their labels."""
        return {
            s.name: {"value": s.read(safe_data), "label": s.label} for s in self.signals[direction]
        }


class Naming:
    """Finds the connection of a network that a ConnID on the wire belongs to.

    Args:
        resolution: The network, or ``None`` for no names.
        image: Its logical addresses, to distinguish main from sub in a capture without a start-up.
    """

    def __init__(self, resolution: Resolution | None, image: LogicalImage | None = None) -> None:
        self.connections: Sequence[ConnectionNames] = (
            [_names(c, image) for c in resolution.connections] if resolution is not None else []
        )
        self._by_id = {c.connection_id: c for c in self.connections if c.connection_id}
        self._unstated = [c for c in self.connections if c.connection_id is None]

    def find(self, connection_id: int, frame_bytes: tuple[int, int]) -> ConnectionNames | None:
        """Return the connection with this ConnID and these frame lengths.

        A connection whose ConnID is in no file is found if it is the only one with these lengths.
        """
        stated = self._by_id.get(connection_id)
        if stated is not None:
            return stated if stated.frame_bytes == frame_bytes else None
        fitting = [c for c in self._unstated if c.frame_bytes == frame_bytes]
        return fitting[0] if len(fitting) == 1 else None

    def find_in(self, found: FoundConnection) -> tuple[ConnectionNames | None, bool]:
        """Return the connection that was found in a capture, and whether its roles are swapped.

        Without a start-up the roles are a guess from the numbers; the lengths or the addresses of
        the network correct it.
        """
        to_sub, to_main = found.places[:2]
        frame_bytes = to_sub.size_bytes, to_main.size_bytes
        names = self.find(found.connection_id, frame_bytes)
        if found.roles_certain:
            return names, False
        if names is None:
            names = self.find(found.connection_id, frame_bytes[::-1])
            return names, names is not None
        logical = to_sub.is_logical and to_main.is_logical
        swapped = to_sub.address in names.addresses[1] and to_main.address in names.addresses[0]
        return names, logical and swapped


def _names(connection: Connection, image: LogicalImage | None) -> ConnectionNames:
    outputs, inputs = connection_signals(connection)
    addresses = [
        frozenset(
            a
            for end in (transfer.source, transfer.destination)
            if image is not None and (a := image.address(end)) is not None
        )
        for transfer in (connection.to_sub, connection.to_main)
    ]
    return ConnectionNames(
        name=connection.name,
        ends=(connection.main.name, connection.sub.name),
        signals=(tuple(outputs.values()), tuple(inputs.values())),
        frame_bytes=(
            connection.to_sub.transfer.size_bytes,
            connection.to_main.transfer.size_bytes,
        ),
        connection_id=connection.stated.connection_id,
        addresses=(addresses[0], addresses[1]),
    )
