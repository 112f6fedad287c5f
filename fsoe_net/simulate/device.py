"""Emulated SubDevices: FSoE ends at their places in the process data, and their behaviour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from fsoe_net.fsoe.event import State
from fsoe_net.model.signals import write_bits
from fsoe_net.simulate.drive.wiring import WiredAxis
from fsoe_net.simulate.port import Port


@dataclass(slots=True)
class SafetyLogic:
    """Decides whether the outputs of a net are on.

    A reset counts only as a rising edge while every input is good. A button that is held, or
    pressed before the inputs are good, has no effect (ISO 13849-1 requires a deliberate action).

    ``delays_ns`` are outputs that stay on for a time after the others have switched off, whatever
    the inputs do in the meantime: the STO of a drive that is first stopped by SS1.
    """

    on: bool = False
    delays_ns: Mapping[str, int] = field(default_factory=dict)
    pressed: bool = False
    _was_pressed: bool = False
    _now_ns: int = 0
    _off_since_ns: int | None = None

    def update(self, inputs_good: bool, now_ns: int = 0) -> bool:
        """Return whether the outputs are on from now on.

        Args:
            inputs_good: Whether all safe inputs are 1 and valid, and all connections exchange data.
            now_ns: Current time.
        """
        self._now_ns, was_on = now_ns, self.on
        # A button that is pressed when the inputs become good must not start the machine: an edge
        # is needed.
        edge = self.pressed and not self._was_pressed
        self._was_pressed = self.pressed
        # The stop comes first: an edge in the same step must not override it.
        if not inputs_good:
            self.on = False
        elif edge:
            self.on = True
        if was_on and not self.on:
            self._off_since_ns = now_ns
        return self.on

    def is_on(self, output: str) -> bool:
        """Return whether an output is on, or its delay has not expired."""
        if self.on or self._off_since_ns is None:
            return self.on
        return self._now_ns - self._off_since_ns < self.delays_ns.get(output, 0)

    def power_cycle(self) -> None:
        """Switch off and on; all outputs are off."""
        self.on, self._off_since_ns = False, None


class ProcessData(Protocol):
    """The sync managers of one SubDevice on the device side; numbers are SM numbers."""

    def read_outputs(self, sm: int) -> bytes:
        """Return the newest outputs."""

    def write_inputs(self, sm: int, data: bytes) -> None:
        """Publish inputs, all at once."""

    def operational(self) -> bool:
        """Return whether outputs arrive, because the SubDevice is in OP."""


class _Images(dict[int, bytes]):
    """Outputs by sync manager, read once in a step: frames and axes can share one."""

    def __init__(self, io: ProcessData) -> None:
        self._io = io

    def __missing__(self, sm: int) -> bytes:
        image = self[sm] = self._io.read_outputs(sm)
        return image


@dataclass(slots=True)
class EmulatedDevice:
    """One SubDevice: its FSoE ends, and its last published input process data."""

    name: str
    ports: list[Port]
    inputs: dict[int, bytearray]
    logic: SafetyLogic = field(default_factory=SafetyLogic)
    logic_inputs: list[tuple[Port, str]] = field(default_factory=list)
    logic_outputs: list[tuple[Port, str]] = field(default_factory=list)
    away: set[str] = field(default_factory=set)  # connections that the logic does not require
    axes: list[WiredAxis] = field(default_factory=list)
    _unpublished: set[int] = field(default_factory=set)
    _set: set[tuple[int, int]] = field(default_factory=set)
    _shown: dict[tuple[int, int], int] = field(default_factory=dict)
    _mains: tuple[Port, ...] = ()

    def __post_init__(self) -> None:
        self._mains = tuple(port for port in self.ports if port.is_main)

    def set_input(self, sm: int, bit: int, bits: int, value: int) -> None:
        """Set standard input bits of a sync manager; they are published in the next step.

        These bits keep the set value even if an emulated axis would write them.
        """
        self._set.add((sm, bit))
        self._write(sm, bit, bits, value)

    def _write(self, sm: int, bit: int, bits: int, value: int) -> None:
        write_bits(self.inputs[sm], bit, bits, value)
        self._unpublished.add(sm)

    def step(self, now_ns: int, io: ProcessData) -> None:
        """Read outputs, let every FSoE end take one step, publish inputs that changed."""
        changed = self._unpublished
        images = _Images(io)
        for port in self.ports:
            frame = images[port.rx_sm][port.rx_byte : port.rx_byte + port.rx_bytes]
            # A SubInstance needs its address before it answers the first frame.
            if not port.is_main:
                self._prepare_sub(port)
            port.instance.set_safe_data(bytes(port.safe))
            answer = port.instance.step(now_ns, frame)
            if answer is not None:
                self.inputs[port.tx_sm][port.tx_byte : port.tx_byte + len(answer)] = answer
                changed.add(port.tx_sm)
        self._decide(now_ns)
        self._move(now_ns, io, images)
        # Written after all ends have stepped: a MainDevice must not see an incomplete step.
        for sm in changed:
            io.write_inputs(sm, bytes(self.inputs[sm]))
        changed.clear()

    def _prepare_sub(self, port: Port) -> None:
        """Let a SubInstance send its values in Data; drives mirror the commanded values."""
        port.instance.enable = port.instance.state is State.DATA
        for name in port.mirrored:
            port.sends[name].write(port.safe, port.received(name))
        for name, value in port.reported.items():
            port.sends[name].write(port.safe, value)

    def _move(self, now_ns: int, io: ProcessData, images: _Images) -> None:
        """Advance every axis by one step."""
        if not self.axes:
            return
        image = images.__getitem__
        operational = io.operational()
        for wired in self.axes:
            axis = wired.axis
            axis.step(now_ns, image, wired.demand(), operational=operational)
            wired.report()
            for sm, bit, bits, value in axis.objects.inputs():
                # A value set by a scenario is kept; only changes of the axis are published.
                if self._shown.get((sm, bit)) != value and (sm, bit) not in self._set:
                    self._shown[sm, bit] = value
                    self._write(sm, bit, bits, value)

    def _decide(self, now_ns: int) -> None:
        """Run the logic of a safety master over all its connections."""
        if not self._mains:
            return
        # A connection that is absent by design must not keep the outputs off.
        due = {p for p in self._mains if p.setup.connection.name not in self.away}
        good = all(p.instance.state is State.DATA and p.instance.data_valid for p in due)
        good = good and all(p.received(name) for p, name in self.logic_inputs if p in due)
        self.logic.update(good, now_ns)
        self._switch()

    def _switch(self) -> None:
        """Copy the outputs of the logic to the frames of its connections."""
        held = [(port, name) for port, name in self.logic_outputs if self.logic.is_on(name)]
        holding = {port for port, _ in held}
        for port in self._mains:
            # Cleared first: an output that is no longer enabled must not keep its old value.
            port.safe[:] = bytes(len(port.safe))
            enabled = self.logic.on or port in holding
            # Before Data the enable has no meaning; the engine would reject it.
            port.instance.enable = enabled and port.instance.state is State.DATA
        for port, name in held:
            signal = port.sends[name]
            signal.write(port.safe, (1 << signal.bits) - 1)

    def power_cycle(self) -> None:
        """Switch the device off and on: everything volatile is lost.

        The bus keeps the previous inputs, like a memory, until the device publishes again.
        """
        for port in self.ports:
            port.instance.power_cycle()
        for wired in self.axes:
            wired.axis.power_cycle()
        # After the restart each value is published again.
        self._shown.clear()
        for data in self.inputs.values():
            data[:] = bytes(len(data))
        self.logic.power_cycle()
