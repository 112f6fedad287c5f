"""A real-time client of ``fsn-master``: inputs of every cycle, outputs in the next frame.

The memory is shared through the C library; see ``docs/howto/program.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

from fsoe_net.core.module import compiled
from fsoe_net.errors import ControlRefused, EnvironmentFault
from fsoe_net.live.axis import Axis, AxisMode

_KINDS = ("bits", "bool", "signed", "unsigned", "real")
_CODES = {"signed": "i", "real": "f"}


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleTimes:
    """One cycle: its number, start and planned next start (monotonic), DC time, all in ns.

    ``skipped``: cycles missed since the previous one. ``overruns``: cycles that the master has
    omitted so far. If the working counters differ, some inputs are from an earlier cycle.
    """

    cycle: int
    now_ns: int
    next_ns: int
    dc_time_ns: int
    skipped: int
    overruns: int
    expected_wkc: int
    actual_wkc: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleCounts:
    """Counters of the master for the outputs; see `CycleClient`."""

    on_time: int
    late: int
    missed: int
    torn: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleSymbol:
    """A value of the process image: its place in `RealTime.image`, and its type.

    ``kind`` is ``bool``, ``signed``, ``unsigned``, ``bits`` or ``real``. ``owned``: this client
    writes it. ``scaled``: it has a factor or an offset.
    """

    number: int
    kind: str
    bits: int
    bit_offset: int
    is_output: bool
    owned: bool
    scaled: bool


class RealTime:
    """Memory shared with the cycle; a context manager. One thread at a time.

    ``realtime["name"]`` reads an input of the current cycle, with factor and offset. Assigning
    stores an output for `send`, which sends all outputs together. An input and an output may share
    a name, such as the actual and the target position of an axis; `sent` reads an output.

    Args:
        path: Control socket of ``fsn-master``.
        outputs: Names of the outputs to write; a name may end in ``*``.
        misses: Permitted number of consecutive cycles without new outputs.
        plan_sha256: Hash of the expected plan; empty for any.
        timeout_s: Timeout for the answer, in seconds.

    Raises:
        ControlRefused: The request was refused, with the reason and the next step.
        EnvironmentFault: No process answers, or the memory cannot be mapped.
        CoreMissing: The compiled part is missing.
    """

    def __init__(
        self,
        path: str,
        outputs: Sequence[str] = (),
        *,
        misses: int = 3,
        plan_sha256: str = "",
        timeout_s: float = 5.0,
    ) -> None:
        self._ffi, self._lib = compiled()
        self._pointer = self._open(path, outputs, misses, plan_sha256, timeout_s)
        lib = self._lib
        self.cycle_ns = int(lib.fsn_realtime_cycle_ns(self._pointer))
        symbols = list(self._read_symbols())
        self.inputs: Mapping[str, CycleSymbol] = {n: s for n, s in symbols if not s.is_output}
        self.outputs: Mapping[str, CycleSymbol] = {n: s for n, s in symbols if s.is_output}
        self._image = bytearray(lib.fsn_realtime_image_bytes(self._pointer))
        self._cycle = self._ffi.new("struct fsn_realtime_cycle *")

    def _open(
        self, path: str, outputs: Sequence[str], misses: int, plan: str, timeout_s: float
    ) -> Any:
        ffi, lib = self._ffi, self._lib
        # fsn-master checks the limit; cffi would raise OverflowError beyond 32 bits.
        if not 0 <= misses < 1 << 32:
            raise ControlRefused("a client may miss 0 to 1000 cycles in a row", "FSN_E_ARG")
        # C keeps pointers only: these objects must live until `fsn_realtime_open` returns.
        texts = [ffi.new("char[]", name.encode()) for name in outputs]
        keep = [ffi.new("char[]", path.encode()), ffi.new("char[]", plan.encode())]
        names = ffi.new("const char *[]", texts)
        options = ffi.new("struct fsn_realtime_options *")
        options.socket = keep[0]
        options.plan_sha256 = keep[1] if plan else ffi.NULL
        options.outputs = names
        options.output_count = len(texts)
        options.misses = misses
        options.timeout_ms = max(1, int(timeout_s * 1000))
        slot = ffi.new("struct fsn_realtime **")
        fault = ffi.new("struct fsn_realtime_fault *")
        status = lib.fsn_realtime_open(options, slot, fault)
        if status:
            text = ffi.string(fault.text).decode("utf-8", "replace")
            name = ffi.string(lib.fsn_status_name(status)).decode()
            # A system error has another remedy than a refusal by fsn-master.
            if name in ("FSN_E_SYS", "FSN_E_NOMEM"):
                raise EnvironmentFault(f"{text}; is fsn-master running, and as which user?")
            raise ControlRefused(f"realtime: {text}", name)
        # The garbage collector closes a forgotten client; otherwise its outputs would stay leased
        # until the process ends.
        return ffi.gc(slot[0], lib.fsn_realtime_close)

    def _read_symbols(self) -> Iterator[tuple[str, CycleSymbol]]:
        ffi, lib = self._ffi, self._lib
        info = ffi.new("struct fsn_realtime_symbol *")
        for number in range(lib.fsn_realtime_symbol_count(self._pointer)):
            lib.fsn_realtime_symbol(self._pointer, number, info)
            if info.bits == 0:
                continue  # it has no place on this bus
            yield (
                ffi.string(info.name).decode(),
                CycleSymbol(
                    number=number,
                    kind=_KINDS[info.kind],
                    bits=info.bits,
                    bit_offset=info.bit_offset,
                    is_output=bool(info.output),
                    owned=bool(info.owned),
                    scaled=(info.factor, info.offset) != (1.0, 0.0),
                ),
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the cycle; the outputs take their stop values."""
        if self._pointer is not None:
            self._ffi.release(self._pointer)
            self._pointer = None

    def _here(self) -> Any:
        if self._pointer is None:
            raise ValueError("this client has left the cycle; realtime() enters it again")
        return self._pointer

    def wait(self, timeout_s: float = 1.0) -> CycleTimes:
        """Wait for the next cycle and read its inputs.

        Args:
            timeout_s: Timeout, in seconds.

        Raises:
            EnvironmentFault: No cycle arrived, the bus was stopped, or ``fsn-master`` has ended.
            ControlRefused: The outputs were withdrawn; call `Client.realtime` to enter the cycle
                again.
        """
        lib, pointer = self._lib, self._here()
        status = lib.fsn_realtime_wait(pointer, max(0, int(timeout_s * 1e9)), self._cycle)
        if status == lib.FSN_E_BUSY:
            raise EnvironmentFault(f"no cycle has come for {timeout_s:g} s; is the bus running?")
        if status == lib.FSN_E_STATE:
            raise EnvironmentFault(
                "the bus was stopped, or fsn-master has ended; enter the cycle again when it runs"
            )
        image = lib.fsn_realtime_image(pointer)
        self._ffi.memmove(self._image, image, len(self._image))
        if status:
            raise ControlRefused(
                "the outputs were taken back and have their stop values: too many cycles without "
                "new ones, or a stop; enter the cycle again",
                "FSN_E_CLOSED",
            )
        return CycleTimes(**{f.name: int(getattr(self._cycle, f.name)) for f in fields(CycleTimes)})

    def axis(
        self,
        subdevice: str,
        number: int = 0,
        *,
        mode: AxisMode = AxisMode.CSP,
        max_step: int = 0,
        max_velocity: int = 0,
        max_torque: int = 0,
        answer_s: float = 3.0,
        torque_off: str = "",
        torque_off_mask: int = 0,
        torque_off_low: bool = False,
    ) -> Axis:
        """Return an axis of a drive by CiA 402; its outputs must belong to this client.

        Args:
            subdevice: Name of the SubDevice.
            number: Number n of the axis; its objects are 0x800 * n higher.
            mode: Initial mode. A limit of 0 disables the modes that it belongs to:
            max_step: CSP: largest change of the target in one step, in units of the drive.
            max_velocity: CSV, PV: largest target in either direction.
            max_torque: CST: largest target in either direction.
            answer_s: Timeout for a change of state, a mode or a set-point, in seconds; longer than
                the ramps of the drive.
            torque_off: Value with a bit that reports STO; empty if the drive has none.
            torque_off_mask: Mask of that bit.
            torque_off_low: Whether the bit is 0 for STO.

        Raises:
            ControlRefused: An object is missing or has another size, or an output of the axis does
                not belong to this client.
            ValueError: A limit is out of range.
        """
        options = self._ffi.new("struct fsn_axis_options *")
        keep = [self._ffi.new("char[]", text.encode()) for text in (subdevice, torque_off)]
        options.subdevice, options.number = keep[0], number
        try:
            options.config = {
                "max_step": max_step,
                "max_velocity": max_velocity,
                "max_torque": max_torque,
                "answer_ms": max(1, round(answer_s * 1000)),
                "mode": int(mode),
            }
            options.torque_off_mask = torque_off_mask
        except OverflowError as exc:
            raise ValueError(f"a limit of an axis is out of range: {exc}") from exc
        options.torque_off = keep[1] if torque_off else self._ffi.NULL
        options.torque_off_low = torque_off_low
        return Axis(self._here, self._cycle, options)

    def send(self) -> None:
        """Send all outputs together with their last assigned values; initially, stop values."""
        self._lib.fsn_realtime_send(self._here())

    def counts(self) -> CycleCounts:
        """Return the counters of the master."""
        found = self._lib.fsn_realtime_counts(self._here())
        return CycleCounts(**{f.name: int(getattr(found, f.name)) for f in fields(CycleCounts)})

    def __getitem__(self, name: str) -> bool | int | float:
        """Return an input of the current cycle, with factor and offset.

        Raises:
            KeyError: Unknown input.
        """
        return self._value(self.inputs[name])

    def sent(self, name: str) -> bool | int | float:
        """Return an output of the current cycle as it was sent, whichever client wrote it.

        Raises:
            KeyError: Unknown output.
        """
        return self._value(self.outputs[name])

    def _value(self, symbol: CycleSymbol) -> bool | int | float:
        pointer = self._here()
        if symbol.kind == "bool":
            return bool(self._lib.fsn_realtime_get(pointer, symbol.number))
        if symbol.scaled or symbol.kind == "real":
            return float(self._lib.fsn_realtime_value(pointer, symbol.number))
        raw = int(self._lib.fsn_realtime_get(pointer, symbol.number))
        return raw - (raw >> symbol.bits - 1 << symbol.bits) if symbol.kind == "signed" else raw

    def __setitem__(self, name: str, value: float) -> None:
        """Store an output for `send`.

        Raises:
            KeyError: Unknown output.
            ControlRefused: The output does not belong to this client.
            ValueError: The value is outside the range of its type.
        """
        symbol, lib, pointer = self.outputs[name], self._lib, self._here()
        # Integers take the exact path: a float cannot represent every 64-bit value.
        whole = isinstance(value, int) and not symbol.scaled and symbol.kind != "real"
        if whole:
            # C masks the value: without this range check, another number would be sent.
            least = -1 << symbol.bits - 1 if symbol.kind == "signed" else 0
            if not least <= value < least + (1 << symbol.bits):
                raise ValueError(f"{name} has {symbol.bits} bits {symbol.kind}: {value}")
            status = lib.fsn_realtime_set(pointer, symbol.number, int(value) & (1 << 64) - 1)
        else:
            status = lib.fsn_realtime_set_value(pointer, symbol.number, float(value))
        if status == lib.FSN_E_CLOSED:
            raise ControlRefused(f"{name} is not an output of this client", "FSN_E_CLOSED")
        if status:
            raise ValueError(f"{name} has {symbol.bits} bits {symbol.kind}: {value}")

    @property
    def image(self) -> memoryview:
        """The process image of the current cycle; it changes with the next one."""
        return memoryview(self._image).toreadonly()

    def view(self, *, outputs: bool = False) -> Any:
        """Return a numpy record over `image`: raw inputs of whole bytes by name, no copy.

        Args:
            outputs: Whether to return the outputs, as sent, instead.

        Values that are shifted or have an odd number of bits are omitted; read them with
        ``self[name]`` or `sent`.

        Raises:
            ImportError: numpy is not installed.
        """
        import numpy as np

        found = {
            name: (f"<{_CODES.get(s.kind, 'u')}{s.bits // 8}", s.bit_offset // 8)
            for name, s in (self.outputs if outputs else self.inputs).items()
            # numpy has types of these sizes only, on byte boundaries.
            if s.bits in (8, 16, 32, 64)
            and s.bit_offset % 8 == 0
            and not (s.kind == "real" and s.bits < 32)
        }
        form = np.dtype(
            {
                "names": list(found),
                "formats": [code for code, _ in found.values()],
                "offsets": [byte for _, byte in found.values()],
                "itemsize": len(self._image),
            }
        )
        return np.frombuffer(self.image, dtype=form, count=1)[0]
