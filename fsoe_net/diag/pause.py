"""Pausing the garbage collector while a large structure is built."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")


def without_collector(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Let the cyclic garbage collector rest during a call; what it was before, it is after.

    A network is millions of objects without a cycle: looking for one again and again while they are
    made took half of the time. Reference counts go on freeing what is let go.
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
