"""Live sessions: emulated devices, the C core and a scenario, in virtual or real time."""

from fsoe_net.run.attachment import Attachment, BusView, WatchedConnection
from fsoe_net.run.client import Client
from fsoe_net.run.control_layout import Layout
from fsoe_net.run.control_values import (
    BusState,
    HistoryMessage,
    NamedConnection,
    ScanReply,
    SdoValue,
    Status,
    Symbol,
    Values,
    WatchedCycle,
)
from fsoe_net.run.emulate import EmulateResult, SegmentSession, serve
from fsoe_net.run.in_use import fingerprint_in_use
from fsoe_net.run.incidents import IncidentRecorder
from fsoe_net.run.live_bus import BusOptions, LiveUpdate, run_on_bus
from fsoe_net.run.live_capture import LiveCapture
from fsoe_net.run.live_snapshot import LiveSnapshot, SubDeviceSnapshot
from fsoe_net.run.master import Master, find_master
from fsoe_net.run.protocol import compare_protocol, keep_machine, make_protocol
from fsoe_net.run.protocol_live import run_protocol_live
from fsoe_net.run.protocol_virtual import run_protocol_virtual
from fsoe_net.run.result import (
    BusResult,
    ConnectionResult,
    Run,
    RunEvent,
    Verdict,
    state_text,
)
from fsoe_net.run.session import (
    Session,
    counted_session_ids,
    random_session_ids,
    run_live,
    run_virtual,
)
from fsoe_net.run.sockets import control_socket
from fsoe_net.run.stage import Stage

__all__ = [
    "Attachment",
    "BusOptions",
    "BusResult",
    "BusState",
    "BusView",
    "Client",
    "ConnectionResult",
    "EmulateResult",
    "HistoryMessage",
    "IncidentRecorder",
    "Layout",
    "LiveCapture",
    "LiveSnapshot",
    "LiveUpdate",
    "Master",
    "NamedConnection",
    "Run",
    "RunEvent",
    "ScanReply",
    "SdoValue",
    "SegmentSession",
    "Session",
    "Stage",
    "Status",
    "SubDeviceSnapshot",
    "Symbol",
    "Values",
    "Verdict",
    "WatchedConnection",
    "WatchedCycle",
    "compare_protocol",
    "control_socket",
    "counted_session_ids",
    "find_master",
    "fingerprint_in_use",
    "keep_machine",
    "make_protocol",
    "random_session_ids",
    "run_live",
    "run_on_bus",
    "run_protocol_live",
    "run_protocol_virtual",
    "run_virtual",
    "serve",
    "state_text",
]
