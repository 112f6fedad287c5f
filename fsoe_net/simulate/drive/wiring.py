"""Safe data that act on an emulated axis, and the safe data that it reports.

The defaults are the objects of the drive profile (ETG.6100.2) in the frames of the same device,
0x800 * n higher for axis n: 0x6640 STO, 0x6650 SS1, 0x6690 SLS, 0x6632 error acknowledge. In the
direction to the drive, 0 requests a function; from the drive, 1 reports that it is active. A rising
edge of 0x6632 to the drive acknowledges; from the drive, 0x6632 reports an error. Source: Omron
R88D-1SN□-ECT manual (I586), objects 0x6632 and 0x6640; the other objects follow the same pattern,
with the names of `model.signals`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from fsoe_net.fsoe.event import State
from fsoe_net.model.drives import DriveSetup, axis_name
from fsoe_net.simulate.drive.axis import EmulatedAxis
from fsoe_net.simulate.drive.safety import SafeDemand
from fsoe_net.simulate.port import Port

_STO, _SS1, _SLS, _ACKNOWLEDGE = 0x6640, 0x6650, 0x6690, 0x6632

Wire = tuple[Port, str]


class WiredAxis:
    """An axis, the safe outputs that act on it, and its safe inputs.

    Args:
        subdevice: Name of the drive.
        axis: The axis.
        ports: FSoE ends of the drive.
    """

    def __init__(self, subdevice: str, axis: EmulatedAxis, ports: Sequence[Port]) -> None:
        self.name = axis_name(subdevice, axis.number)
        self.axis = axis
        self._own = [port for port in ports if not port.is_main]
        self._base = axis.objects.axis.base
        self._profile = {index: self._wires(index) for index in (_STO, _SS1, _SLS, _ACKNOWLEDGE)}
        self._reports = [
            (port, name, signal.index - self._base, signal.subindex)
            for port in self._own
            for name, signal in port.sends.items()
            if signal.index - self._base in self._profile
        ]
        # In the drive, 0 reports an inactive function; before the first step, all are inactive.
        for port, name, *_ in self._reports:
            port.reported[name] = 0
        self.configure(axis.setup, None)

    def _wires(self, index: int) -> list[Wire]:
        return [
            (port, name)
            for port in self._own
            for name, signal in port.receives.items()
            if signal.index - self._base == index
        ]

    def configure(self, setup: DriveSetup, find: Callable[[str], Wire] | None) -> None:
        """Apply another motor, load and wiring.

        Args:
            setup: Set-up of the axis.
            find: Returns the safe output with a name; required if the set-up names one.

        Raises:
            KeyError: Unknown safe output.
        """

        def named(names: Sequence[str | None] | None, index: int) -> list[Wire]:
            wanted = [name for name in names or () if name is not None]
            if names is None or not wanted or find is None:
                return self._profile[index]
            return [find(name) for name in wanted]

        self._sto, self._ss1 = named((setup.sto,), _STO), named((setup.ss1,), _SS1)
        self._sls = named(setup.sls, _SLS)
        speeds = [rpm / 60 * math.tau for rpm in setup.sls_rpm]
        # Fewer speeds than limits: the last one applies to the rest.
        self._speeds = [speeds[min(n, len(speeds) - 1)] for n in range(len(self._sls))]
        self.axis.configure(setup)

    def demand(self) -> SafeDemand | None:
        """Return the request in the safe data; ``None`` if no safe data act on this axis.

        Without valid data from its own MainInstance, a drive removes the torque.
        """
        # A drive without safety functions has torque whenever its controller commands it.
        if not (self._own or self._sto or self._ss1 or self._sls):
            return None
        valid = all(p.instance.state is State.DATA and p.instance.data_valid for p in self._own)
        limits = zip(self._sls, self._speeds, strict=True)
        return SafeDemand(
            sto=not valid or _is_demanded(self._sto),
            ss1=_is_demanded(self._ss1),
            sls_speeds=[speed for wire, speed in limits if _is_demanded([wire])],
            acknowledge=any(port.received(name) for port, name in self._profile[_ACKNOWLEDGE]),
        )

    def report(self) -> None:
        """Write active functions into the safe data of the drive, except values of a scenario."""
        for port, name, index, subindex in self._reports:
            if name in port.reported:
                port.reported[name] = int(self._acts(index, subindex))

    def _acts(self, index: int, subindex: int) -> bool:
        safe = self.axis.safe
        if index == _STO:
            return safe.torque_off
        if index == _SS1:
            # SS1 has ended when the torque is off, and is reported as long as it is requested.
            return safe.stopping or (safe.torque_off and _is_demanded(self._ss1))
        if index == _SLS:
            return safe.limit_watched and self._is_limited(subindex)
        return safe.violated  # the violation to acknowledge

    def _is_limited(self, subindex: int) -> bool:
        return any(
            port.receives[name].subindex == subindex
            for port, name in self._sls
            if not port.received(name)
        )


def _is_demanded(wires: Sequence[Wire]) -> bool:
    return any(not port.received(name) for port, name in wires)
