"""A mutant in the place of functions that are imported already."""

from __future__ import annotations

import gc
import os
import types
from itertools import chain

_OWN = (
    "co_code co_names co_varnames co_freevars co_cellvars co_flags co_argcount "
    "co_posonlyargcount co_kwonlyargcount co_exceptiontable"
)


def _inner(code: types.CodeType) -> list[types.CodeType]:
    return [c for c in code.co_consts if isinstance(c, types.CodeType)]


def _consts(code: types.CodeType) -> list[tuple[str, object]]:
    return [(type(c).__name__, repr(c)) for c in code.co_consts if not hasattr(c, "co_code")]


def _same(old: types.CodeType, new: types.CodeType) -> bool:
    return _consts(old) == _consts(new) and all(
        getattr(old, name) == getattr(new, name) for name in _OWN.split()
    )


def _differing(
    old: types.CodeType, new: types.CodeType, around: tuple
) -> list[tuple[tuple[types.CodeType, types.CodeType], ...]]:
    """Return the way from the module down to each code that differs by itself.

    Raises:
        LookupError: the mutant has other functions, or differs where no function is.
    """
    way = (*around, (old, new))
    out = []
    if not _same(old, new):
        # The code of a module or class has run already.
        if not old.co_flags & 0x02:
            raise LookupError(old.co_name)
        out.append(way)
    a, b = _inner(old), _inner(new)
    if [c.co_name for c in a] != [c.co_name for c in b]:
        raise LookupError(old.co_name)
    return out + list(chain.from_iterable(map(_differing, a, b, [way] * len(a))))


def swap(path: str, original: str, mutant: str) -> bool:
    """Give the functions of a file the code of its mutant.

    Returns whether that was possible: not where a mutant changes what runs at import.
    """
    try:
        ways = _differing(compile(original, path, "exec"), compile(mutant, path, "exec"), ())
    except LookupError:
        return False
    wanted = {
        (old.co_qualname, old.co_firstlineno): new
        for way in ways
        for old, new in way
        if old.co_flags & 0x02
    }
    found = set()
    for it in gc.get_objects():
        if not isinstance(it, types.FunctionType):
            continue
        key = (it.__code__.co_qualname, it.__code__.co_firstlineno)
        if key in wanted and os.path.realpath(it.__code__.co_filename) == path:
            if len(it.__code__.co_freevars) != len(wanted[key].co_freevars):
                return False
            it.__code__ = wanted[key]
            found.add(key)
    # Only what lies directly in the module or in a class is there before anything runs.
    return all(any((o.co_qualname, o.co_firstlineno) in found for o, _ in way) for way in ways)
