"""The work of the rules grows with the bus and no faster; counted, not timed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from networks import resolved, write_big_network

from fsoe_net.model.resolve import resolve
from fsoe_net.rules.check import check


class _Name(str):
    """A name that counts how often it is looked up."""

    looked_up = 0

    def __hash__(self) -> int:
        type(self).looked_up += 1
        return super().__hash__()


@pytest.mark.parametrize("size", [160, 640])
def test_a_name_is_looked_up_as_often_on_a_larger_bus(tmp_path: Path, size: int) -> None:
    network = resolved(write_big_network(tmp_path, size, size - 1)).network
    subs = tuple(replace(s, name=_Name(s.name)) for s in network.subdevices)
    resolution = resolve(replace(network, subdevices=subs))
    _Name.looked_up = 0
    check(resolution)
    assert 0 < _Name.looked_up <= 20 * size


class _Connections(tuple):
    """Connections that count how often they are searched."""

    searched = 0

    def __iter__(self):
        type(self).searched += 1
        return super().__iter__()


def test_connections_are_searched_as_often_with_more_nets(tmp_path: Path) -> None:
    counts = []
    for size in (160, 640):
        (tmp_path / str(size)).mkdir()
        resolution = resolved(write_big_network(tmp_path / str(size), size, size - 1))
        _Connections.searched = 0
        check(replace(resolution, connections=_Connections(resolution.connections)))
        counts.append(_Connections.searched)
    assert counts[0] == counts[1] > 0
