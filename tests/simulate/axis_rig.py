"""One emulated axis without a bus: objects are written as an SDO would."""

from __future__ import annotations

import math

from fsoe_net.model.drives import DriveAxis, DriveSetup
from fsoe_net.simulate.drive.axis import EmulatedAxis
from fsoe_net.simulate.drive.power import PdsState
from fsoe_net.simulate.drive.safety import SafeDemand

MS = 1_000_000
FREE = SafeDemand()
CPR = 10_000
PP, PV, HOMING, CSP, CSV, CST = 1, 3, 6, 8, 9, 10


class AxisRig:
    """An axis that is stepped every millisecond; `demand` is what its safe data say."""

    def __init__(self, *, safe: bool = False, **setup) -> None:
        self.axis = EmulatedAxis(DriveAxis(number=0, outputs={}, inputs={}), {}, 0.001)
        self.axis.configure(DriveSetup(**{"counts_per_rev": CPR, **setup}))
        self.demand = FREE if safe else None
        self.now_ns = 0
        self.operational = True

    def __setitem__(self, index, value):
        self.axis.objects.dictionary[index if isinstance(index, tuple) else (index, 0)] = value

    def __getitem__(self, index):
        return self.axis.objects.value(index)

    @property
    def state(self) -> PdsState:
        return self.axis.power.state

    @property
    def plant(self):
        return self.axis.context.servo.plant

    @property
    def revolutions(self) -> float:
        return self.plant.angle / math.tau

    def run(self, milliseconds: int = 1) -> None:
        for _ in range(milliseconds):
            self.now_ns += MS
            self.axis.step(self.now_ns, bytes, self.demand, operational=self.operational)

    def until(self, condition, at_most_ms: int = 5000) -> int:
        """Return after how many milliseconds something is so."""
        for passed in range(at_most_ms):
            if condition():
                return passed
            self.run()
        raise AssertionError(f"never: {self.state}, 0x{self[0x6041]:04x}")

    def command(self, word: int) -> None:
        self[0x6040] = word
        self.run()

    def enable(self, mode: int) -> None:
        self[0x6060] = mode
        self.run()
        self[0x607A] = self[0x6064]
        for word in (0, 6, 7, 15):
            self.command(word)
        assert self.state is PdsState.OPERATION_ENABLED
