"""State of a bus as ``control_msgs/HardwareStatus``, as hardware of ros2_control publishes it."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.core.bus_documents import SubDeviceSnapshot
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.attachment import BusView
from fsoe_net.live.health import Health, HealthLevel, SubDeviceHealth
from fsoe_net.ros2.messages import (
    EtherCatState,
    GenericHardwareState,
    HardwareDeviceStatus,
    HardwareStatus,
    Header,
    KeyValue,
)
from fsoe_net.ros2.names import legal_text

# Constants of control_msgs/GenericHardwareState: HEALTH_OK and so on, CONNECT_UP, CONNECT_DOWN.
_HEALTH = {
    HealthLevel.UNKNOWN: 0,
    HealthLevel.GOOD: 1,
    HealthLevel.WARNING: 3,
    HealthLevel.ERROR: 4,
}
_UP, _DOWN = 1, 2
# ETG.1000.6, as in control_msgs/EtherCATState.
_AL_STATES = {"INIT": 1, "PREOP": 2, "BOOT": 3, "SAFEOP": 4, "OP": 8}


def hardware_status(view: BusView, header: Header, hardware_id: str) -> HardwareStatus:
    """Return the state of each SubDevice, with the states of its FSoE connections as details.

    Args:
        view: The bus.
        header: Header of the message and of its parts.
        hardware_id: Name of the bus.
    """
    rows = [_device(view, row, header) for row in view.health.subdevices]
    return HardwareStatus(header, legal_text(hardware_id), rows)


def _device(view: BusView, health: SubDeviceHealth, header: Header) -> HardwareDeviceStatus:
    seen = health.seen
    current = view.current and seen.known
    state = GenericHardwareState(
        health_status=_HEALTH[health.level],
        connectivity_status=_connectivity(seen) if current else 0,
        state_details=[KeyValue(legal_text(k), legal_text(v)) for k, v in _details(view, health)],
    )
    word, _, error = seen.al.partition("+")
    ethercat = EtherCatState(
        slave_position=seen.position & 0xFFFF,
        vendor_id=_identity(seen.vendor_id),
        product_code=_identity(seen.product_code),
        al_state=_AL_STATES.get(word, 0) if current else 0,
        has_error=current and bool(error),
        al_status_code=(seen.al_code or 0) & 0xFFFF if current else 0,
    )
    return HardwareDeviceStatus(
        header, legal_text(health.name), [state], ethercat_states=[ethercat]
    )


def _connectivity(seen: SubDeviceSnapshot) -> int:
    return _UP if seen.answers else _DOWN


def _identity(number: int) -> str:
    return f"0x{number:08x}" if number else ""  # 0: not read


def _details(view: BusView, health: SubDeviceHealth) -> Iterator[tuple[str, str]]:
    yield "bus", str(health.seen.bus)
    yield "alias", str(health.seen.alias)
    yield "reasons", _reasons(health)
    for connection, row in zip(view.connections, view.health.connections, strict=True):
        result = connection.result
        if health.name in (result.main, result.sub):
            yield f"FSoE {row.name}", result.state if view.current else ConnectionState.UNKNOWN
            yield f"FSoE {row.name} reasons", _reasons(row)


def _reasons(health: Health) -> str:
    return " ".join(reason.key for reason in health.reasons)
