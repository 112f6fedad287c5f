"""Parameters of a connection that its main sends in Connection and Parameter (§4)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Protocol

from fsoe_net.dataclass import dataclass

STATED_PARAMETERS = ("connection_id", "address", "watchdog_ms", "app_parameters")
"""Parameters that a plan states, in the order of the bits in the C core."""
_TEXTS = {
    "connection_id": "connection ID",
    "address": "FSoE address",
    "watchdog_ms": "watchdog",
    "app_parameters": "application parameters",
}
MOST_APP_BYTES = 4096
"""Maximum length of application parameters in a plan; bounds the time to check a hostile plan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FsoeParameters:
    """The parameters that a main sent in its last start-up; ``None`` if not observed.

    Attributes:
        connection_id: ConnID in the data of the Connection frames.
        address: FSoE address of the sub.
        watchdog_ms: Watchdog of the connection.
        app_bytes: Length of the application parameters.
        app_crc: Their CRC-32 (IEEE 802.3).
    """

    connection_id: int | None = None
    address: int | None = None
    watchdog_ms: int | None = None
    app_bytes: int | None = None
    app_crc: int | None = None

    def text(self, name: str) -> str | None:
        """Return one of `STATED_PARAMETERS` with its unit, or ``None`` if unknown."""
        if name == "app_parameters":
            size = self.app_bytes
            return None if size is None else f"{size} bytes, CRC-32 0x{self.app_crc:08x}"
        value = getattr(self, name)
        if value is None:
            return None
        return f"{value} ms" if name == "watchdog_ms" else str(value)

    def to_json(self) -> dict[str, int | None]:
        """Return the stable JSON form."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


NOT_OBSERVED = FsoeParameters()


def differences(
    differs: Iterable[str], configured: FsoeParameters, observed: FsoeParameters
) -> tuple[str, ...]:
    """Return the differences, such as ``watchdog 4000 ms, 400 ms in the plan``.

    Args:
        differs: Names of parameters.
        configured: Parameters of the plan.
        observed: Observed parameters; empty if the start-up was not observed.
    """
    rows = []
    for name in differs:
        stated, there = configured.text(name), observed.text(name)
        planned = f", {stated} in the plan" if stated else ""
        if there is None:
            there = "unknown now; different from the plan at an earlier start-up"
        rows.append(f"{_TEXTS[name]} {there}{planned}")
    return tuple(rows)


class SeenParameters(Protocol):
    """A connection with the planned and the observed parameters."""

    @property
    def configured(self) -> FsoeParameters:
        """Parameters of the plan."""

    @property
    def observed(self) -> FsoeParameters:
        """Parameters that the MainInstance sent in its last start-up."""

    @property
    def differs(self) -> tuple[str, ...]:
        """Names of the parameters that differ."""
