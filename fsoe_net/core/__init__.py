"""Typed facade over the C core; the only importer of the compiled module.

Importing this package works without the compiled part; the first use then raises `CoreMissing`.
"""

from fsoe_net.core.core import Core, CorePlan, EmulatedBus
from fsoe_net.core.snapshot import (
    ConnectionSnapshot,
    CoreEvent,
    DirectionSnapshot,
    OutsideState,
    Snapshot,
    Statistics,
)

__all__ = [
    "ConnectionSnapshot",
    "Core",
    "CoreEvent",
    "CorePlan",
    "DirectionSnapshot",
    "EmulatedBus",
    "OutsideState",
    "Snapshot",
    "Statistics",
]
