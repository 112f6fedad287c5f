"""Writes the C source of the compiled module; run by CMake while building, never imported."""

from __future__ import annotations

import sys
from pathlib import Path


def main(cdef: str, target: str) -> None:
    """Turn the declarations in ``cdef`` into a cffi API-mode module at ``target``."""
    import cffi

    ffi = cffi.FFI()
    ffi.cdef(Path(cdef).read_text("utf-8"))
    ffi.set_source("fsoe_net.core._core", '#include "fsn/fsn.h"\n#include "fsn/segment.h"')
    ffi.emit_c_code(target)


if __name__ == "__main__":
    main(*sys.argv[1:3])
