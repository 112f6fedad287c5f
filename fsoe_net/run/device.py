"""A device developer's own FSoE end in the place of one of ours, found by name.

Named ``module:factory``, as entry points are. The factory is called with the configuration of its
end (`MainConfig` or `SubConfig`) and returns something with the `Peer` protocol.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fsoe import MainConfig, SubConfig
from fsoe_net.fsoe.campaign import Peer

__all__ = ["DeviceFactory", "device_factory"]

_NEEDED = ("step", "power_cycle", "received_safe_data", "data_valid")
_GUARDED = ("step", "power_cycle", "snapshot", "restore")


@dataclass(frozen=True, slots=True)
class DeviceFactory:
    """Calls ``module:factory``; only the name goes to other processes.

    Raises:
        EnvironmentFault: In a call: the factory fails or returns no FSoE end.
    """

    name: str

    def __call__(self, config: MainConfig | SubConfig) -> Peer:
        """Return a new end, switched off and on."""
        try:
            end = _find(self.name)(config)
        except (InputError, EnvironmentFault):
            raise
        except Exception as exc:  # whatever a stranger's code raises is told to its author
            raise EnvironmentFault(f"{self.name} failed: {exc!r}") from exc
        missing = [name for name in _NEEDED if not hasattr(end, name)]
        if missing:
            raise EnvironmentFault(
                f"what {self.name} returned lacks {', '.join(missing)}; "
                "docs/howto/test-your-device.md lists what an end needs"
            )
        peer: Peer = _Guard(end, self.name)
        return peer


def device_factory(name: str) -> DeviceFactory:
    """Return the factory of a name after finding it.

    Raises:
        InputError: The name is not ``module:factory``, or there is no such thing.
    """
    _find(name)
    return DeviceFactory(name)


def _find(name: str) -> Callable[[MainConfig | SubConfig], Any]:
    module, colon, attribute = name.partition(":")
    if not colon or not module or not attribute:
        raise InputError(f"{name!r} is not module:factory, e.g. my_device:make_sub")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except ImportError as exc:
        raise InputError(
            f"module {module!r} cannot be imported ({exc}); it is looked for in the current "
            "folder and in PYTHONPATH"
        ) from exc
    except AttributeError as exc:
        raise InputError(f"module {module!r} has no {attribute!r}") from exc
    if not callable(found):
        raise InputError(f"{name} cannot be called")
    call: Callable[[MainConfig | SubConfig], Any] = found
    return call


class _Guard:
    """Passes everything on and says whose fault an exception is."""

    def __init__(self, end: Any, name: str) -> None:
        object.__setattr__(self, "_end", end)
        object.__setattr__(self, "_name", name)

    def __getattr__(self, name: str) -> Any:
        value = getattr(object.__getattribute__(self, "_end"), name)
        return self._guarded(name, value) if name in _GUARDED else value

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._end, name, value)

    def _guarded(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def guarded(*args: Any) -> Any:
            try:
                return call(*args)
            except Exception as exc:  # whatever a stranger's code raises is told to its author
                raise EnvironmentFault(f"{self._name}: {name}() raised {exc!r}") from exc

        return guarded
