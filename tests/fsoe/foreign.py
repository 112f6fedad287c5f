"""A third party's main, `fsoe_master`, by its public interface; optional, extra `interop`."""

from __future__ import annotations

import importlib
import os

import pytest
from fsoe.pair import ADDRESS, CONNECTION_ID

MODULE = "fsoe_master.fsoe_master"


def load():
    """Return the module; absent it skips, but fails where FSN_REQUIRE names ``interop``."""
    if "interop" in os.environ.get("FSN_REQUIRE", "").split(","):
        return importlib.import_module(MODULE)
    return pytest.importorskip(
        MODULE, reason="fsoe_master is not installed: pip install -e '.[interop]'"
    )


class ForeignMain:
    """Its main with one dictionary item per word, or per byte where the size is one byte."""

    def __init__(self, module, out=2, inn=2, parameters=(), address=ADDRESS):
        items = [_items(module, out, 1), _items(module, inn, 100)]
        self.outs = [module.DictionaryItemOutput(**item) for item in items[0]]
        self.ins = [module.DictionaryItemInput(fail_safe_value=0, **item) for item in items[1]]
        self.handler = module.MasterHandler(
            dictionary=module.Dictionary([*self.outs, *self.ins]),
            slave_address=address,
            connection_id=CONNECTION_ID,
            watchdog_timeout_s=30.0,
            application_parameters=[
                module.ApplicationParameter(name=f"p{n}", initial_value=value, n_bytes=size)
                for n, (value, size) in enumerate(parameters)
            ],
        )
        for item in self.outs:
            self.handler.master.dictionary_map.add(item)
        for item in self.ins:
            self.handler.slave.dictionary_map.add(item)

    def set_outputs(self, data: bytes):
        for item, value in zip(self.outs, _values(data), strict=True):
            item.set(value)

    def inputs(self) -> bytes:
        size = 1 if len(self.ins) == 1 and self.ins[0].data_type.name == "UINT8" else 2
        return b"".join(item.get().to_bytes(size, "little") for item in self.ins)


def _items(module, size: int, first_key: int) -> list[dict]:
    kind = getattr(module.DictionaryItem.DataTypes, "UINT8" if size == 1 else "UINT16")
    keys = range(first_key, first_key + max(1, size // 2))
    return [{"key": key, "name": f"item {key}", "data_type": kind} for key in keys]


def _values(data: bytes) -> list[int]:
    width = 1 if len(data) == 1 else 2
    return [int.from_bytes(data[at : at + width], "little") for at in range(0, len(data), width)]
