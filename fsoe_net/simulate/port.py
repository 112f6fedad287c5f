"""One FSoE end of an emulated device: places of its frames, and names of its safe data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import safe_data_length
from fsoe_net.fsoe.sub_instance import SubInstance
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.signals import Signal, connection_signals
from fsoe_net.model.transfer_ends import ResolvedEnd
from fsoe_net.simulate.setup import FsoeSetup

SessionIds = Callable[[], int]


@dataclass(slots=True, eq=False)
class Port:
    """One FSoE end of a device and the places of its frames.

    ``is_main``: it is the MainInstance of its connection. ``receives`` and ``sends`` name the safe
    data; ``safe`` are the data that the end sends while enabled.
    """

    setup: FsoeSetup
    instance: MainInstance | SubInstance
    is_main: bool
    rx_sm: int
    rx_byte: int
    rx_bytes: int
    tx_sm: int
    tx_byte: int
    receives: dict[str, Signal]
    sends: dict[str, Signal]
    safe: bytearray
    mirrored: list[str] = field(default_factory=list)
    """Values that a SubInstance sends back as received: a drive reports received commands."""
    reported: dict[str, int] = field(default_factory=dict)
    """Values that an emulated axis reports: 1 for an active safety function."""

    def received(self, name: str) -> int:
        """Return a received safe value; 0 while the data are not valid."""
        return self.receives[name].read(self.instance.received_safe_data)


def main_port(setup: FsoeSetup, session_ids: SessionIds) -> Port:
    """Build the end in the safety master."""
    c = setup.connection
    instance = MainInstance(setup.main, session_ids=session_ids)
    # Names of safe data are those of the SubInstance; the slots of a logic have only numbers.
    return _port(setup, instance, c.to_main.destination, c.to_sub.source, named_by_sub=True)


def sub_port(setup: FsoeSetup, session_ids: SessionIds) -> Port:
    """Build the end in a safe input, output or drive."""
    c = setup.connection
    instance = SubInstance(setup.sub, session_ids=session_ids)
    return _port(setup, instance, c.to_sub.destination, c.to_main.source, named_by_sub=False)


def _port(
    setup: FsoeSetup,
    instance: MainInstance | SubInstance,
    rx: ResolvedEnd,
    tx: ResolvedEnd,
    *,
    named_by_sub: bool,
) -> Port:
    c = setup.connection
    to_sub, to_main = c.to_sub, c.to_main
    outputs, inputs = connection_signals(c)
    receives, sends = (inputs, outputs) if named_by_sub else (outputs, inputs)
    received, sent = (to_main, to_sub) if named_by_sub else (to_sub, to_main)
    return Port(
        setup=setup,
        instance=instance,
        is_main=named_by_sub,
        rx_sm=_sm_index(rx),
        rx_byte=rx.byte_offset,
        rx_bytes=received.transfer.size_bytes,
        tx_sm=_sm_index(tx),
        tx_byte=tx.byte_offset,
        receives=receives,
        sends=sends,
        safe=bytearray(safe_data_length(sent.transfer.size_bytes)),
        mirrored=[] if named_by_sub else [name for name in sends if name in receives],
    )


def _sm_index(end: ResolvedEnd) -> int:
    return cast(SmLayout, end.sm).sm.index  # connections resolve by construction
