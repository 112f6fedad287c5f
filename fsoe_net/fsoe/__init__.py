"""FSoE as seen on the wire: frames, CRCs, MainInstance and SubInstance.

Compared with independent implementations, not checked against ETG.5100 and not conformance tested:
for emulation and test, never part of a safety function. Knows nothing of EtherCAT; time is an
argument.
"""

from fsoe_net.fsoe.chain import Chain
from fsoe_net.fsoe.instance import Event, EventKind, MainConfig, State, SubConfig
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import (
    SAFE_SIZES,
    Command,
    Pdu,
    ResetCode,
    decode_pdu,
    describe_pdu,
    encode_pdu,
    frame_crcs,
    frame_length,
    is_frame_length,
    reset_code_text,
    safe_data_length,
    sra_crc,
)
from fsoe_net.fsoe.sub_instance import SubInstance

__all__ = [
    "SAFE_SIZES",
    "Chain",
    "Command",
    "Event",
    "EventKind",
    "MainConfig",
    "MainInstance",
    "Pdu",
    "ResetCode",
    "State",
    "SubConfig",
    "SubInstance",
    "decode_pdu",
    "describe_pdu",
    "encode_pdu",
    "frame_crcs",
    "frame_length",
    "is_frame_length",
    "reset_code_text",
    "safe_data_length",
    "sra_crc",
]
