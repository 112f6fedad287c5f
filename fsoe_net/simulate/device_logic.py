"""Replaces an FSoE end by the implementation of a device developer, found by name.

The name is ``module:factory``, as for entry points. The factory is called with the configuration of
its end (`MainConfig` or `SubConfig`) and returns an object with the `Peer` protocol. Errors of
foreign code are reported to its author in one sentence.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import inspect
import os
import sys
import sysconfig
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from fsoe_net.campaign.channel import Peer
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fsoe.config import MainConfig, SubConfig
from fsoe_net.fsoe.pdu import frame_length

_NEEDED = ("step", "power_cycle", "received_safe_data", "data_valid")
_PASSED_ON = ("set_safe_data", "snapshot", "restore")  # optional, without a return value to check
_LONG = 100  # characters of a foreign value in a message


@dataclass(frozen=True, slots=True)
class DeviceFactory:
    """Calls ``module:factory``; only the name is passed to other processes.

    Raises:
        EnvironmentFault: In a call: the factory fails or returns no FSoE end.
    """

    name: str

    def __call__(self, config: MainConfig | SubConfig) -> Peer:
        """Return a new end, as after power-on."""
        factory = _find(self.name)
        # Each access to foreign code is within `_blaming`, so that its author sees where it failed.
        with _blaming(self.name, "the factory"):
            end = factory(config)
        with _blaming(self.name, f"an attribute of what it returned ({_short(end)})"):
            missing = [name for name in _NEEDED if not hasattr(end, name)]
        if missing:
            raise EnvironmentFault(
                f"{self.name}: the factory returned {_short(end)}, which lacks "
                f"{', '.join(missing)}; docs/howto/test-your-device.md lists what an end needs"
            )
        sizes = config.safe_in_bytes, config.safe_out_bytes
        # The configuration is from the view of the MainInstance, which has in and out exchanged.
        sent, taken = sizes if isinstance(config, SubConfig) else sizes[::-1]
        return _Guard(end, self.name, frame_length(sent), taken)


def device_factory(name: str) -> DeviceFactory:
    """Find and return the factory with this name.

    Raises:
        InputError: The name is not ``module:factory``, or does not exist.
        EnvironmentFault: The module fails during import.
    """
    _find(name)
    return DeviceFactory(name)


def _find(name: str) -> Callable[[MainConfig | SubConfig], Any]:
    module, colon, attribute = name.partition(":")
    if not colon or not module or not attribute or module.startswith("."):
        # A relative import has no meaning outside of a package.
        raise InputError(f"{_short(name)} is not module:factory, e.g. my_device:make_sub")
    try:
        with _blaming(name, f"importing {module}", passing=(ImportError, SyntaxError)):
            loaded = importlib.import_module(module)
    except ImportError as exc:
        raise InputError(
            f"module {module!r} cannot be imported ({exc}); it is looked for in the current "
            "folder and in PYTHONPATH"
        ) from exc
    except SyntaxError as exc:
        raise InputError(f"{name}: module {module!r} is not valid Python: {exc}") from exc
    # A module may have its own `__getattr__`, which can raise any exception.
    with _blaming(name, f"reading {attribute} of the module"):
        found = getattr(loaded, attribute, None)
    if found is None:
        raise InputError(f"module {module!r} has no {attribute!r}")
    if not callable(found):
        raise InputError(f"{name} is {_short(found)} and cannot be called")
    _takes_configuration(name, found)
    call: Callable[[MainConfig | SubConfig], Any] = found
    return call


def _takes_configuration(name: str, found: Callable[..., Any]) -> None:
    try:
        signature = inspect.signature(found)
    except (ValueError, TypeError):  # compiled code may have no signature; then the call decides
        return
    try:
        signature.bind(None)
    except TypeError as exc:
        raise InputError(
            f"{name} is not a factory: it is called with one argument, the configuration, and "
            f"takes {_short(str(signature), quote=False)}"
        ) from exc


class _Guard:
    """Wraps a foreign end: checks its return values and attributes errors.

    Optional attributes that the foreign end lacks are also missing here.
    """

    def __init__(self, end: Any, name: str, frame_bytes: int, data_bytes: int) -> None:
        with _blaming(name, "step"):
            step = end.step
        # Directly into the dictionary, because external assignments are passed to the end.
        self.__dict__.update(
            _end=end, _name=name, _frame_bytes=frame_bytes, _data_bytes=data_bytes, _step=step
        )

    def __getattr__(self, name: str) -> Any:
        with _blaming(self._name, name, passing=(AttributeError,)):  # how it shows that it has none
            value = getattr(self._end, name)
        if name == "watchdog_remaining_ns":
            value = self._watchdog(value)
        elif name in _PASSED_ON:
            value = self._guarded(name, value)
        else:
            return value  # such as enable, which changes
        self.__dict__[name] = value
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        with _blaming(self._name, f"setting {name}"):
            setattr(self._end, name, value)

    def step(self, now_ns: int, received: bytes | None) -> bytes | None:
        try:
            frame = self._step(now_ns, received)
        # Ctrl-C comes from the user, not from the device.
        except KeyboardInterrupt:
            raise
        except BaseException as exc:  # a SystemExit would end the campaign silently
            raise _raised(self._name, "step()", exc) from exc
        if frame is None:
            return None
        # Subclasses and bytearrays are converted: the channel stores frames, which must not change
        # later.
        if type(frame) is not bytes:
            frame = self._bytes("step() returned", frame, "bytes or None")
        if len(frame) != self._frame_bytes:
            raise self._wrong(
                f"step() returned a frame of {len(frame)} bytes ({_short(frame)}); its frames have "
                f"{self._frame_bytes}, and no frame is None"
            )
        return frame

    def power_cycle(self) -> None:
        with _blaming(self._name, "power_cycle()"):
            self._end.power_cycle()

    @property
    def data_valid(self) -> bool:
        with _blaming(self._name, "data_valid"):
            valid = self._end.data_valid
        if valid is True or valid is False:
            return valid
        if type(valid) is int and valid in (0, 1):  # as returned by a C function
            return bool(valid)
        raise self._wrong(f"data_valid is {_short(valid)}, not True or False")

    @property
    def received_safe_data(self) -> bytes:
        with _blaming(self._name, "received_safe_data"):
            data = self._end.received_safe_data
        if type(data) is bytes and len(data) == self._data_bytes:
            return data
        if not self.data_valid:
            return bytes(self._data_bytes)  # invalid data must not be used, so they may be missing
        data = self._bytes("received_safe_data is", data, "bytes")
        if len(data) != self._data_bytes:
            raise self._wrong(
                f"received_safe_data has {len(data)} bytes ({_short(data)}) while data_valid; the "
                f"configuration has {self._data_bytes}"
            )
        return data

    def _bytes(self, what: str, value: Any, wanted: str) -> bytes:
        if isinstance(value, bytes | bytearray):
            return bytes(value)
        raise self._wrong(f"{what} {_short(value)}, not {wanted}")

    def _watchdog(self, call: Callable[[int], Any]) -> Callable[[int], int | None]:
        guarded = self._guarded("watchdog_remaining_ns", call)

        def remaining(now_ns: int) -> int | None:
            left_ns = guarded(now_ns)
            if left_ns is None or type(left_ns) is int:
                return left_ns
            raise self._wrong(
                f"watchdog_remaining_ns() returned {_short(left_ns)}, not a whole number or None"
            )

        return remaining

    def _guarded(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def guarded(*args: Any) -> Any:
            with _blaming(self._name, f"{name}()"):
                return call(*args)

        return guarded

    def _wrong(self, text: str) -> EnvironmentFault:
        return EnvironmentFault(f"{self._name}: {text}")


class _blaming:  # noqa: N801 - reads as a word of a with statement
    """Converts any exception of foreign code to a sentence for its author.

    Ctrl-C is passed through. This is a class and not a generator for speed, because it is entered
    for every call of an end.
    """

    __slots__ = ("_name", "_passing", "_what")

    def __init__(
        self, name: str, what: str, *, passing: tuple[type[BaseException], ...] = ()
    ) -> None:
        self._name, self._what = name, what
        self._passing = (KeyboardInterrupt, EnvironmentFault, InputError, *passing)

    def __enter__(self) -> None:
        pass

    def __exit__(self, _type: object, exc: BaseException | None, _traceback: object) -> None:
        if exc is not None and not isinstance(exc, self._passing):
            raise _raised(self._name, self._what, exc) from exc


def _raised(name: str, what: str, exc: BaseException) -> EnvironmentFault:
    return EnvironmentFault(f"{name}: {what} raised {_short(exc)}{_place(exc)}")


def _place(exc: BaseException) -> str:
    """Return the location of an exception in the foreign code."""
    # A standard module, such as ctypes for a missing library, is not where the mistake is.
    trace, last, own = exc.__traceback__, "", sysconfig.get_path("stdlib") + os.sep
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        standard = file.startswith(own) and "-packages" not in file
        if file != __file__ and not standard and not file.startswith("<"):  # <frozen importlib…>
            last = f" ({os.path.basename(file)}, line {trace.tb_lineno})"
        trace = trace.tb_next
    return last


def _short(value: object, *, quote: bool = True) -> str:
    """Return a foreign value for a message: short, on one line, whatever its repr does."""
    # A foreign object can be huge; a failing message would hide the fault.
    try:
        if isinstance(value, bytes | bytearray) and len(value) > _LONG // 4:
            text = f"{bytes(value[: _LONG // 4]).hex()}..."
        else:
            text = repr(value) if quote else str(value)
    except Exception:  # a foreign __repr__
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= _LONG else f"{text[:_LONG]}..."


@contextlib.contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Redirect output of a device to standard error, so that it never mixes with a report.

    Covers Python code and compiled code, which writes to the file descriptor.
    """
    _flush()
    kept: int | None = None
    with contextlib.suppress(OSError):  # the descriptor is closed
        kept = os.dup(1)
    try:
        divert_stdout()
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _flush()
        if kept is not None:
            os.dup2(kept, 1)
            os.close(kept)


def divert_stdout() -> None:
    """Redirect the descriptor of standard output permanently to standard error."""
    with contextlib.suppress(OSError):
        os.dup2(2, 1)


def _flush() -> None:
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stdout.flush()
    with contextlib.suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL(None).fflush(None)  # printf output of a device is buffered without a terminal
