"""FSN478, FSN488: one cycle time, stated in several files."""

from __future__ import annotations

from collections.abc import Iterator

from fsoe_net.diag.diagnostic import Related
from fsoe_net.model.bus import Device, Sdo, SubDevice
from fsoe_net.model.drives import AXIS_STEP, drive_axes
from fsoe_net.model.network import NetworkConfig
from fsoe_net.rules.context import Context

_SAME = 0.01  # relative: a rate is often the rounded inverse of a cycle time
_INTERPOLATION = 0x60C2  # interpolation time period: value and exponent of 10, in seconds
_SYNC_PARAMETERS = (0x1C32, 0x1C33)  # subindex 2: cycle time in ns
_EXPONENTS = range(-9, 1)
_BY_DEFAULT = -3  # exponent if no SDO writes it


def check_cycle_times(ctx: Context) -> None:
    """Compare the update rates of controllers and the times of drives with the bus cycle."""
    _update_rates(ctx)
    for _, device, sub in ctx.devices():
        cycle_ns = _cycle_of(ctx.resolution.network, sub)
        if cycle_ns:
            for sdo, unit_ns in _times(device):
                if abs(sdo.value * unit_ns - cycle_ns) > _SAME * cycle_ns:
                    _another_time(ctx, sub, sdo, (unit_ns, cycle_ns))


def _update_rates(ctx: Context) -> None:
    network = ctx.resolution.network
    if network.cycle_ns is None or network.robot is None:
        return
    bus_hz = 1e9 / network.cycle_ns
    by_default = "" if "control_frequency" in network.fields else " by default"
    for rate in network.robot.update_rates:
        if abs(rate.hz - bus_hz) > _SAME * bus_hz:
            ctx.add(
                "FSN478",
                rate.span,
                f"update_rate is {rate.hz:g} Hz, control_frequency is {bus_hz:g} Hz{by_default}: "
                "the driver exchanges frames at update_rate, and sets distributed clocks to "
                "control_frequency",
                hint=f"write update_rate: {bus_hz:g}, or change control_frequency",
                related=(
                    Related(span=network.at("control_frequency"), message="the EtherCAT driver"),
                ),
            )


def _cycle_of(network: NetworkConfig, sub: SubDevice) -> int | None:
    """Return the cycle of the bus of a SubDevice; ``None`` if it is not certain."""
    if network.buses:
        return network.buses[sub.master_id].cycle_ns
    # The masters of a URDF have cycles of their own.
    is_one = len({s.master_id for s in network.subdevices}) == 1
    return network.cycle_ns if is_one else None


def _times(device: Device) -> Iterator[tuple[Sdo, float]]:
    """Yield the start-up SDOs that state a cycle, with the unit of their value in ns."""
    values = {(sdo.index, sdo.subindex): sdo for sdo in device.sdos}
    for axis in range(len(drive_axes(device.layout))):
        index = _INTERPOLATION + axis * AXIS_STEP
        value, exponent = values.get((index, 1)), values.get((index, 2))
        power = _BY_DEFAULT if exponent is None else exponent.value
        if value is not None and value.value > 0 and power in _EXPONENTS:
            yield value, 10.0 ** (9 + power)
    for index in _SYNC_PARAMETERS:
        sdo = values.get((index, 2))
        if sdo is not None and sdo.value > 0:
            yield sdo, 1.0


def _another_time(ctx: Context, sub: SubDevice, sdo: Sdo, times_ns: tuple[float, int]) -> None:
    network = ctx.resolution.network
    key = "control_frequency" if sub.system else "cycle_us"
    unit_ns, cycle_ns = times_ns
    stated, cycle = (f"{ns / 1e6:g} ms" for ns in (sdo.value * unit_ns, cycle_ns))
    value = cycle_ns / unit_ns
    ctx.add(
        "FSN488",
        sdo.at("value"),
        f"0x{sdo.index:04x}:{sdo.subindex:02x} of {sub.name} states a cycle of {stated}, the bus "
        f"cycle is {cycle}: the drive expects its targets at another rate",
        hint=f"write {value:.0f}"
        if value.is_integer()
        else f"write a value and, in subindex 2, an exponent for {cycle}",
        related=(Related(span=network.at(key), message="the bus cycle"),),
    )
