"""Data classes behave as those of the standard library; only assignments are not rejected."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import subprocess
import sys
from dataclasses import field
from pathlib import Path

import pytest

from fsoe_net.dataclass import dataclass

ROOT = Path(__file__).parents[1]
KINDS = [
    {"frozen": True, "slots": True, "kw_only": True},
    {"frozen": True, "kw_only": True},
    {"slots": True},
    {"slots": True, "eq": False},
]


def classes(decorate, options):
    """Return a class and one that derives from it, and adds texts of its own."""

    @decorate(**options)
    class Place:
        name: str
        line: int = field(default=0, compare=False)
        shown: list[int] = field(default_factory=list, repr=False, compare=False)

    @decorate(**options)
    class Point(Place):
        column: int = 1

    @decorate(**options)
    class Named(Place):
        def __repr__(self) -> str:
            return f"<{self.name}>"

    @decorate(**options)
    class Empty:
        pass

    return Place, Point, Named, Empty


def facts(decorate, options):
    """Return what two decorators must agree on, for the same classes."""
    place, point, named, empty = classes(decorate, options)
    same = [place(name="a"), place(name="a", line=7), place(name="b"), point(name="a")]
    same += [point(name="a", column=2), named(name="a"), empty(), empty()]
    equal = [[a == b for b in same] for a in same]
    found = [equal, [repr(row) for row in same], [row != 1 for row in same]]
    if options.get("frozen"):
        found.append([[hash(a) == hash(b) for b in same if a == b] for a in same])
        found.append(len({*same}))
    else:
        found.append([row.__hash__ is None for row in same])
    changed = dataclasses.replace(same[4], line=3)
    found.append([changed.line, changed.column, dataclasses.asdict(changed)])
    found.append([(f.name, f.kw_only) for f in dataclasses.fields(point)])
    found.append([hasattr(row, "__dict__") for row in same])
    with pytest.raises(TypeError):
        place()
    return found


@pytest.mark.parametrize("options", KINDS, ids=str)
def test_classes_are_those_of_the_standard_library(options):
    assert facts(dataclass, options) == facts(dataclasses.dataclass, options)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """At module level, where pickle finds it."""

    low: int
    high: int


def test_copies_are_equal():
    pair = Pair(low=1, high=2)
    assert copy.deepcopy(pair) == pickle.loads(pickle.dumps(pair)) == pair != Pair(low=2, high=2)


CHECKED = """
import sys
from fsoe_net.cli.main import main
sys.argv = ["fsoe-net", "check", "examples/estop/network.yaml"]
try:
    main()
finally:
    modules = [m for name, m in sys.modules.items() if name.startswith("fsoe_net.")]
    types = {c for m in modules for c in vars(m).values() if isinstance(c, type)}
    kinds = {c for c in types if hasattr(c, "__dataclass_fields__")}
    compiled = {
        name
        for kind in kinds
        for name, method in vars(kind).items()
        if getattr(getattr(method, "__code__", None), "co_filename", "") == "<string>"
    }
    print(len(kinds) > 50, *compiled)
"""


def test_check_compiles_one_method_of_each_class():
    """Compiling all six took a quarter of its time."""
    done = subprocess.run(
        [sys.executable, "-c", CHECKED], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.splitlines()[-1] == "True __init__"
