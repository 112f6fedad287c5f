"""Configuration of the two ends of a connection."""

from __future__ import annotations

from collections.abc import Callable

from fsoe_net.dataclass import dataclass
from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.pdu import SAFE_SIZES


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Parameters received by a SubInstance, to be judged by its application (§6 row 20).

    Attributes:
        watchdog_ms: Watchdog of the connection, 1 … 65535.
        app_parameters: Application parameters, low byte of each value first.
    """

    watchdog_ms: int
    app_parameters: bytes


def _check_range(name: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise ConfigError(f"{name} is {value}; allowed are {low} … {high}")


def _check_sizes(safe_out_bytes: int, safe_in_bytes: int) -> None:
    for name, value in (("safe_out_bytes", safe_out_bytes), ("safe_in_bytes", safe_in_bytes)):
        if value not in SAFE_SIZES:
            raise ConfigError(f"{name} is {value}; allowed are 1, 2, 4, 6 … 126")


@dataclass(frozen=True, slots=True, kw_only=True)
class MainConfig:
    """Configuration of a MainInstance.

    Args:
        connection_id: 1 … 65535, unique in the network.
        address: FSoE address of the SubInstance, 0 … 65535.
        watchdog_ms: 1 … 65535; used here and sent to the SubInstance.
        safe_out_bytes: Safe data bytes from main to sub: 1, 2, 4, 6 … 126.
        safe_in_bytes: Safe data bytes from sub to main: 1, 2, 4, 6 … 126.
        app_parameters: Application parameters, low byte of each value first. The format allows
            65535 bytes; known implementations use at most 256 (§14).

    Raises:
        ConfigError: A value is outside its range; the message names field and range.
    """

    connection_id: int
    address: int
    watchdog_ms: int
    safe_out_bytes: int
    safe_in_bytes: int
    app_parameters: bytes = b""

    def __post_init__(self) -> None:
        _check_range("connection_id", self.connection_id, 1, 0xFFFF)
        _check_range("address", self.address, 0, 0xFFFF)
        _check_range("watchdog_ms", self.watchdog_ms, 1, 0xFFFF)
        _check_range("length of app_parameters", len(self.app_parameters), 0, 0xFFFF)
        _check_sizes(self.safe_out_bytes, self.safe_in_bytes)


@dataclass(frozen=True, slots=True, kw_only=True)
class SubConfig:
    """Configuration of a SubInstance.

    Args:
        address: Own FSoE address, 0 … 65535.
        safe_out_bytes: Safe data bytes from main to sub, which this end receives.
        safe_in_bytes: Safe data bytes from sub to main, which this end sends.
        app_parameter_bytes: Expected length of the application parameters.
        verify: Called when the parameters are complete; returns 0 to accept, otherwise the reset
            code 9, 11 or 0x80 … 0xFF; any other value is sent as 11. ``None`` accepts all.

    Raises:
        ConfigError: A value is outside its range; the message names field and range.
    """

    address: int
    safe_out_bytes: int
    safe_in_bytes: int
    app_parameter_bytes: int = 0
    verify: Callable[[Parameters], int] | None = None

    def __post_init__(self) -> None:
        _check_range("address", self.address, 0, 0xFFFF)
        _check_range("app_parameter_bytes", self.app_parameter_bytes, 0, 0xFFFF)
        _check_sizes(self.safe_out_bytes, self.safe_in_bytes)
