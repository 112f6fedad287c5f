"""Looks at FSoE frames of others: hex, captures, a dissector for Wireshark. Sends nothing."""

from fsoe_net.formats.packets import CaptureReader, buffered, is_capture, read_capture
from fsoe_net.observe.capture import CaptureWriter
from fsoe_net.observe.hexframes import HexFrame, Seen, follow_frames, parse_frames
from fsoe_net.observe.incident import (
    CycleRecord,
    IncidentHead,
    LinkSeen,
    SubDeviceSeen,
    Trigger,
    TriggerKind,
)
from fsoe_net.observe.incident_read import IncidentReader
from fsoe_net.observe.incident_write import (
    Written,
    incident_lines,
    incident_name,
    write_incident,
)
from fsoe_net.observe.lua import lua_dissector
from fsoe_net.observe.names import ConnectionNames, Naming
from fsoe_net.observe.wire import LogicalImage, RebuiltFrames

__all__ = [
    "CaptureReader",
    "CaptureWriter",
    "ConnectionNames",
    "CycleRecord",
    "HexFrame",
    "IncidentHead",
    "IncidentReader",
    "LinkSeen",
    "LogicalImage",
    "Naming",
    "RebuiltFrames",
    "Seen",
    "SubDeviceSeen",
    "Trigger",
    "TriggerKind",
    "Written",
    "buffered",
    "follow_frames",
    "incident_lines",
    "incident_name",
    "is_capture",
    "lua_dissector",
    "parse_frames",
    "read_capture",
    "write_incident",
]
