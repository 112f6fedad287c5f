"""Writes the C source of the compiled module; run by CMake while building, never imported."""

from __future__ import annotations

import re
import sys
from pathlib import Path


def main(cdef: str, include: str, target: str) -> None:
    """Turn the declarations in ``cdef`` into a cffi API-mode module at ``target``.

    ``@struct NAME`` is replaced by the whole struct as defined in the headers in ``include``.
    """
    import cffi

    headers = "".join(path.read_text("utf-8") for path in sorted(Path(include).glob("fsn/*.h")))
    text = Path(cdef).read_text("utf-8")
    ffi = cffi.FFI()
    ffi.cdef(re.sub(r"^@(struct \w+)$", lambda m: _whole(m[1], headers), text, flags=re.M))
    used = "".join(f'#include "fsn/{name}.h"\n' for name in ("fsn", "segment", "client", "axis"))
    ffi.set_source("fsoe_net.core._core", used)
    ffi.emit_c_code(target)


def _whole(name: str, headers: str) -> str:
    """Return a struct without comments; the compiler determines its array lengths."""
    found = re.search(rf"^{name} {{\n.*?^}};", headers, flags=re.M | re.S)
    if found is None:
        raise SystemExit(f"{name} is in none of the headers")
    text = re.sub(r"/\*.*?\*/", "", found[0], flags=re.S)
    return re.sub(r"\[\w+\]", "[...]", text)


if __name__ == "__main__":
    main(*sys.argv[1:4])
