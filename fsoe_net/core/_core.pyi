"""Types of the compiled module: cffi's ``ffi`` and ``lib`` are dynamic."""

from typing import Any

ffi: Any
lib: Any
