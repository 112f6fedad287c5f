"""Typed facade over the C core; the only importer of the compiled module.

Importing this package works without the compiled part; the first use then raises `CoreMissing`.
"""

from fsoe_net.core.core import Core, CorePlan, EmulatedBus
from fsoe_net.core.monitor import CoreMonitor, frame_fits, frame_sequence
from fsoe_net.core.scan import FoundConnection, Place, ScanCounts, Scanner, Sighting
from fsoe_net.core.segment import AlStatus, Segment, SegmentCounts, SegmentLink, is_test_rig
from fsoe_net.core.snapshot import (
    ConnectionSnapshot,
    CoreEvent,
    DirectionSnapshot,
    Glance,
    Histogram,
    Snapshot,
    Statistics,
    bucket_end,
)
from fsoe_net.core.status import StatusInfo, status_table

__all__ = [
    "AlStatus",
    "ConnectionSnapshot",
    "Core",
    "CoreEvent",
    "CoreMonitor",
    "CorePlan",
    "DirectionSnapshot",
    "EmulatedBus",
    "FoundConnection",
    "Glance",
    "Histogram",
    "Place",
    "ScanCounts",
    "Scanner",
    "Segment",
    "SegmentCounts",
    "SegmentLink",
    "Sighting",
    "Snapshot",
    "Statistics",
    "StatusInfo",
    "bucket_end",
    "frame_fits",
    "frame_sequence",
    "is_test_rig",
    "status_table",
]
