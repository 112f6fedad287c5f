"""Names of data types: those of the slave YAML, and those of other tools."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

TYPE_BITS: Mapping[str, int] = MappingProxyType(
    {
        "bool": 1,
        "int8": 8,
        "uint8": 8,
        "int16": 16,
        "uint16": 16,
        "int32": 32,
        "uint32": 32,
        "int64": 64,
        "uint64": 64,
        "float": 32,
        "real32": 32,
        "double": 64,
        "real64": 64,
    }
)
"""Length in bits of each type word of ethercat_driver_ros2, except ``bitN``."""

DRIVER_WORD: Mapping[str, str] = MappingProxyType(
    {
        "usint": "uint8",
        "sint": "int8",
        "byte": "uint8",
        "uint": "uint16",
        "int": "int16",
        "word": "uint16",
        "udint": "uint32",
        "dint": "int32",
        "dword": "uint32",
        "ulint": "uint64",
        "lint": "int64",
        "lreal": "double",
        "real": "float",
        "boolean": "bool",
        "unsigned8": "uint8",
        "unsigned16": "uint16",
        "unsigned32": "uint32",
        "integer8": "int8",
        "integer16": "int16",
        "integer32": "int32",
    }
)
"""The word of `TYPE_BITS` for each other name of a type, in lower case."""
