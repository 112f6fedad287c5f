"""A core on an emulated bus, or a skip with a reason where the compiled module is absent."""

from __future__ import annotations

import pytest
from core.plan_builder import Builder, estop

from fsoe_net.core.core import Core, CorePlan, EmulatedBus
from fsoe_net.errors import CoreMissing


def load(data: bytes) -> CorePlan:
    try:
        return CorePlan.load(data)
    except CoreMissing as exc:
        pytest.skip(f"compiled module absent: {exc}")


def need_core() -> None:
    load(estop().build())


class Rig:
    """Plan, bus and core; the clock advances with each cycle."""

    def __init__(self, builder: Builder | None = None) -> None:
        self.plan = load((builder or estop()).build())
        self.bus = EmulatedBus(self.plan)
        self.core = Core(self.plan, self.bus)
        self.now_ns = 0

    def cycle(self, count: int = 1) -> None:
        for _ in range(count):
            self.now_ns += 1_000_000
            self.core.cycle(self.now_ns)
