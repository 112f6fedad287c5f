"""Emulated SubDevices: FSoE ends at their places in the process data, and what they do with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, cast

from fsoe_net.emul.logic import SafetyLogic
from fsoe_net.emul.setup import ConnectionSetup
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.pdu import safe_data_length
from fsoe_net.fsoe.sub_instance import SubInstance
from fsoe_net.model.ends import ResolvedEnd
from fsoe_net.model.layout import SmLayout
from fsoe_net.model.signals import Signal, connection_signals, write_bits

__all__ = ["EmulatedDevice", "Port", "ProcessData", "main_port", "sub_port"]

SessionIds = Callable[[], int]


class ProcessData(Protocol):
    """The sync managers of one SubDevice, seen from the device; numbers are SM numbers."""

    def read_outputs(self, sm: int) -> bytes:
        """Return the newest outputs."""

    def write_inputs(self, sm: int, data: bytes) -> None:
        """Publish inputs, whole."""


@dataclass(slots=True)
class Port:
    """One FSoE end of a device and where its frames lie.

    ``receives`` and ``sends`` name the safe data; ``safe`` is what the end sends while enabled.
    """

    setup: ConnectionSetup
    instance: MainInstance | SubInstance
    rx_sm: int
    rx_byte: int
    rx_bytes: int
    tx_sm: int
    tx_byte: int
    receives: dict[str, Signal]
    sends: dict[str, Signal]
    safe: bytearray
    mirrored: list[str] = field(default_factory=list)
    """Values a SubInstance sends as it receives them: what a drive received, it reports."""

    @property
    def is_main(self) -> bool:
        """Whether this is the MainInstance of its connection."""
        return isinstance(self.instance, MainInstance)

    def received(self, name: str) -> int:
        """Return a received safe value; 0 while the data are not valid."""
        return self.receives[name].read(self.instance.received_safe_data)


def main_port(setup: ConnectionSetup, session_ids: SessionIds) -> Port:
    """Build the end in the safety master."""
    c = setup.connection
    to_sub = safe_data_length(c.to_sub.transfer.size_bytes)
    to_main = safe_data_length(c.to_main.transfer.size_bytes)
    config = MainConfig(
        connection_id=setup.connection_id,
        address=setup.address,
        watchdog_ms=setup.watchdog_ms,
        safe_out_bytes=to_sub,
        safe_in_bytes=to_main,
        app_parameters=setup.app_parameters,
    )
    instance = MainInstance(config, session_ids=session_ids)
    # Names of safe data are those of the SubInstance; the slots of a logic are mere numbers.
    return _port(setup, instance, c.to_main.destination, c.to_sub.source, named_by_sub=True)


def sub_port(setup: ConnectionSetup, session_ids: SessionIds) -> Port:
    """Build the end in a safe input, output or drive."""
    c = setup.connection
    config = SubConfig(
        address=setup.address,
        safe_out_bytes=safe_data_length(c.to_sub.transfer.size_bytes),
        safe_in_bytes=safe_data_length(c.to_main.transfer.size_bytes),
        app_parameter_bytes=len(setup.app_parameters),
    )
    instance = SubInstance(config, session_ids=session_ids)
    return _port(setup, instance, c.to_sub.destination, c.to_main.source, named_by_sub=False)


def _port(
    setup: ConnectionSetup,
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


@dataclass(slots=True)
class EmulatedDevice:
    """One SubDevice: its FSoE ends, and its input process data as last published."""

    name: str
    ports: list[Port]
    inputs: dict[int, bytearray]
    logic: SafetyLogic = field(default_factory=SafetyLogic)
    logic_inputs: list[tuple[Port, str]] = field(default_factory=list)
    logic_outputs: list[tuple[Port, str]] = field(default_factory=list)
    away: set[str] = field(default_factory=set)  # connections that the logic does not ask for
    _unpublished: set[int] = field(default_factory=set)

    def set_input(self, sm: int, bit: int, bits: int, value: int) -> None:
        """Set standard input bits of a sync manager; the next step publishes them."""
        data = self.inputs[sm]
        write_bits(data, bit, bits, value)
        self._unpublished.add(sm)

    def step(self, now_ns: int, io: ProcessData) -> None:
        """Read outputs, let every FSoE end take one step, publish inputs that changed."""
        changed = self._unpublished
        for port in self.ports:
            image = io.read_outputs(port.rx_sm)
            frame = image[port.rx_byte : port.rx_byte + port.rx_bytes]
            if not port.is_main:
                self._prepare_sub(port)
            port.instance.set_safe_data(bytes(port.safe))
            answer = port.instance.step(now_ns, frame)
            if answer is not None:
                self.inputs[port.tx_sm][port.tx_byte : port.tx_byte + len(answer)] = answer
                changed.add(port.tx_sm)
        self._decide()
        for sm in changed:
            io.write_inputs(sm, bytes(self.inputs[sm]))
        changed.clear()

    def _prepare_sub(self, port: Port) -> None:
        """A SubInstance sends its values whenever it is in Data; drives echo what is commanded."""
        port.instance.enable = port.instance.state is State.DATA
        for name in port.mirrored:
            port.sends[name].write(port.safe, port.received(name))

    def _decide(self) -> None:
        """Run the logic of a safety master over all its connections."""
        mains = [p for p in self.ports if p.is_main]
        if not mains:
            return
        due = [p for p in mains if p.setup.connection.name not in self.away]
        good = all(p.instance.state is State.DATA and p.instance.data_valid for p in due)
        good = good and all(p.received(name) for p, name in self.logic_inputs if p in due)
        on = self.logic.update(good)
        for port in mains:
            port.safe[:] = bytes(len(port.safe))
            port.instance.enable = on and port.instance.state is State.DATA
        for port, name in self.logic_outputs if on else ():
            signal = port.sends[name]
            signal.write(port.safe, (1 << signal.bits) - 1)

    def power_cycle(self) -> None:
        """Switch the device off and on: everything volatile is lost.

        The bus shows the inputs of before until the device publishes anew, as a memory does.
        """
        for port in self.ports:
            port.instance.power_cycle()
        for data in self.inputs.values():
            data[:] = bytes(len(data))
        self.logic.on = False
