"""The compiled module, loaded on first use, and its errors as exceptions."""

from __future__ import annotations

import functools
import os
from typing import Any

from fsoe_net.errors import CoreError, CoreMissing


@functools.cache
def compiled() -> tuple[Any, Any]:
    """Return cffi's ``ffi`` and ``lib``.

    Raises:
        CoreMissing: The compiled module is missing or is for another platform.
    """
    try:
        from fsoe_net.core import _core
    except ImportError as exc:
        raise CoreMissing(
            f"the compiled part of fsoe-net is missing ({exc}); run `make demo` once, or "
            "`pip install .` in the source tree. `check`, `plan` and `explain` work without it "
            "(captures do not)"
        ) from exc
    return _core.ffi, _core.lib


def raise_status(status: int, what: str) -> None:
    """Raise `CoreError` with the text of a status that is not 0."""
    if status:
        ffi, lib = compiled()
        text = ffi.string(lib.fsn_status_text(status)).decode()
        raise CoreError(f"{what}: {text}", status)


def fault_text(fault: Any) -> str:
    """Return record, rule and status of a `struct fsn_fault` as one line."""
    ffi, lib = compiled()
    rule = "" if fault.rule == ffi.NULL else ffi.string(fault.rule).decode()
    text = rule or ffi.string(lib.fsn_status_text(fault.status)).decode()
    name = ffi.string(lib.fsn_status_name(fault.status)).decode()
    section = ffi.string(lib.fsn_section_name(fault.section)).decode()
    place = f"{section}: " if fault.section else ""
    if fault.section and fault.copy_index != lib.FSN_FAULT_NO_RECORD:
        place = f"{section} {fault.copy_index}: "
    system = f": {os.strerror(fault.sys_errno)}" if fault.sys_errno else ""
    detail = ffi.string(fault.detail).decode("utf-8", "replace")
    found = f": {detail}" if detail else ""
    return f"{place}{text}{found}{system} ({name})"
