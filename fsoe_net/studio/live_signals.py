"""Signals for the scope of an emulated run: safe inputs and outputs, and named process data."""

from __future__ import annotations

import functools
import math
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from fsoe_net.model.signals import Signal
from fsoe_net.model.symbols import directed_names
from fsoe_net.plan.model import PlanSymbol
from fsoe_net.simulate.bus import EmulatedDevices
from fsoe_net.simulate.port import Port
from fsoe_net.simulate.session import Session

_SIGNED, _REAL = 2, 4  # kinds of a `PlanSymbol`


@dataclass(frozen=True, slots=True, kw_only=True)
class ScopeSignal:
    """A signal for the scope, with its reader for devices or a process image."""

    name: str
    is_output: bool
    kind: str
    label: str
    read: Callable[[bytes], float | None]


def scope_signals(session: Session, label: Callable[[Signal], str]) -> dict[str, ScopeSignal]:
    """Return the signals by unique names: see `directed_names`."""
    rows = list(_all_signals(session, label))
    names = directed_names([(row.is_output, row.name) for row in rows])
    found: dict[str, ScopeSignal] = {}
    for name, row in zip(names, rows, strict=True):
        found.setdefault(name, row)
    return found


def _all_signals(session: Session, label: Callable[[Signal], str]) -> Iterator[ScopeSignal]:
    network = session.network
    for name, port in network.safe_inputs.items():
        read = functools.partial(_safe_input, port, name)
        yield ScopeSignal(
            name=name,
            is_output=False,
            kind="safe input",
            label=label(port.sends[name]),
            read=read,
        )
    for name, port in network.safe_outputs.items():
        read = functools.partial(_safe_output, network, name)
        yield ScopeSignal(
            name=name,
            is_output=True,
            kind="safe output",
            label=label(port.receives[name]),
            read=read,
        )
    for symbol in session.records.symbols:
        base = session.core.sm_base(symbol.sm)
        # A sync manager without process data has no place in the image.
        if base is not None and symbol.bits <= 64:
            yield ScopeSignal(
                name=symbol.name,
                is_output=symbol.output,
                kind="output" if symbol.output else "input",
                label="",
                read=reader(symbol, base),
            )


def first_signals(session: Session, signals: Mapping[str, ScopeSignal]) -> list[str]:
    """Return the signals to show first: some inputs of the logic, and its outputs."""
    names = {(signal.is_output, signal.name): name for name, signal in signals.items()}
    devices = session.network.masters
    inputs = [names[False, name] for device in devices for _, name in device.logic_inputs]
    outputs = [names[True, name] for device in devices for _, name in device.logic_outputs]
    return [*inputs[:3], *outputs[:3]]


def _safe_input(port: Port, name: str, _image: bytes) -> int:
    return port.sends[name].read(port.safe)


def _safe_output(network: EmulatedDevices, name: str, _image: bytes) -> int:
    return network.safe_output(name)


def reader(symbol: PlanSymbol, base: int) -> Callable[[bytes], float | None]:
    """Return the function that reads a value of the process data.

    Args:
        symbol: The value.
        base: Place of its sync manager in the image.
    """
    first = base + symbol.bit_offset // 8
    # Determined once, outside of the reader, which runs in each bus cycle.
    shift, mask = symbol.bit_offset % 8, (1 << symbol.bits) - 1
    last = first + (shift + symbol.bits + 7) // 8
    form = {32: "<f", 64: "<d"}.get(symbol.bits)

    def read(image: bytes) -> float | None:
        raw = int.from_bytes(image[first:last], "little") >> shift & mask
        if symbol.kind == _REAL and form is not None:
            (real,) = struct.unpack(form, raw.to_bytes(symbol.bits // 8, "little"))
            # JSON has no infinity and no NaN: the page would reject the whole message.
            return float(real) if math.isfinite(real) else None
        # Two's complement of a width without a type in `struct`.
        if symbol.kind == _SIGNED and raw >> (symbol.bits - 1):
            raw -= 1 << symbol.bits
        # For outputs, factor and offset convert the value to the raw number, not back.
        if symbol.output:
            return (raw - symbol.offset) / symbol.factor
        return symbol.factor * raw + symbol.offset

    return read
