"""FSoE as seen on the wire: frames, CRCs, MainInstance and SubInstance.

Compared with independent implementations, not checked against ETG.5100 and not conformance tested:
for emulation and test, never part of a safety function. Knows nothing of EtherCAT; time is an
argument. `fsoe_net.fsoe.recording` holds recorded runs against the engine.
"""

from fsoe_net.fsoe.chain import Chain, advance, before, fits_start, is_whole, reset_frame
from fsoe_net.fsoe.config import MainConfig, Parameters, SubConfig
from fsoe_net.fsoe.crc import block_crc, frame_crcs, solve_sequence, sra_crc
from fsoe_net.fsoe.event import Event, EventKind, State
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.monitor import DirectionCounts, Monitor, OutsideState, Verdict, outside_state
from fsoe_net.fsoe.pdu import (
    SAFE_SIZES,
    Command,
    Pdu,
    ResetCode,
    command_text,
    decode_pdu,
    describe,
    frame_length,
    is_frame_length,
    reset_code_text,
    safe_data_length,
    safe_data_of,
)
from fsoe_net.fsoe.sub_instance import SubInstance

__all__ = [
    "SAFE_SIZES",
    "Chain",
    "Command",
    "DirectionCounts",
    "Event",
    "EventKind",
    "MainConfig",
    "MainInstance",
    "Monitor",
    "OutsideState",
    "Parameters",
    "Pdu",
    "ResetCode",
    "State",
    "SubConfig",
    "SubInstance",
    "Verdict",
    "advance",
    "before",
    "block_crc",
    "command_text",
    "decode_pdu",
    "describe",
    "fits_start",
    "frame_crcs",
    "frame_length",
    "is_frame_length",
    "is_whole",
    "outside_state",
    "reset_code_text",
    "reset_frame",
    "safe_data_length",
    "safe_data_of",
    "solve_sequence",
    "sra_crc",
]
