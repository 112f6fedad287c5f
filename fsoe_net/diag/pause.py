"""Pausing the garbage collector while a large structure is built."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")


def without_collector(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Disable the cyclic garbage collector during a call; its previous state is restored.

    A network consists of millions of objects without reference cycles. Searching for cycles took
    half of the time. Reference counts still free unused objects.
    """

    @functools.wraps(function)
    def paused(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        if not gc.isenabled():
            return function(*args, **kwargs)
        gc.disable()
        try:
            return function(*args, **kwargs)
        finally:
            gc.enable()

    return paused
