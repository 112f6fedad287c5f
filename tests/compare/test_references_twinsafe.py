"""A safety project beside the robot cell: the same is no finding, each change is one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from compare.robot import codes, crossed, found, ours, project

from fsoe_net.model.description import DescribedConnection


def test_the_same_safety_project_raises_nothing():
    assert codes(project(*ours())) == []


@pytest.mark.parametrize("key", ["address", "connection_id", "watchdog_ms"])
def test_each_value_of_a_safety_project(key: str):
    rows = ours()
    assert getattr(rows[1], key) is not None
    rows[1] = replace(rows[1], **{key: 999})
    one = found(project(*rows))
    assert [d.code for d in one] == ["FSN446"]
    assert "999" in one[0].message
    rows[1] = replace(rows[1], **{key: None})
    assert codes(project(*rows)) == []


def test_order_of_slots_of_a_safety_project():
    rows = ours()
    rows[0], rows[1] = rows[1], rows[0]
    one = found(project(*rows))
    assert [d.code for d in one] == ["FSN446"]
    first, second, third, *rest = ours()
    assert codes(project(third, first, second, *rest)) == ["FSN446"] * 3


def test_connection_that_only_one_side_has_moves_no_others():
    rows = ours()
    one = found(project(rows[0], *rows[2:]))
    assert [d.code for d in one] == ["FSN447"]
    more = DescribedConnection(address=77, connection_id=77, watchdog_ms=100)
    one = found(project(rows[0], more, *rows[1:]))
    assert [d.code for d in one] == ["FSN447"]
    assert "77" in one[0].message


def test_another_device_in_a_slot_is_not_a_pair():
    rows = ours()
    kinds = ("EL2904", "EL2904")
    assert codes(project(*rows, orders=("EL1904", "EL2904"))) == []
    assert "FSN447" in codes(project(*rows, orders=kinds))


def test_empty_and_foreign_safety_projects_are_one_line():
    assert codes(project()) == ["FSN443"]
    foreign = [
        DescribedConnection(address=900 + n, connection_id=900 + n, watchdog_ms=5) for n in range(9)
    ]
    kinds = ("EK1960",) * 9
    assert codes(project(*foreign, orders=kinds)) == ["FSN443"]


def test_connections_with_nothing_but_a_slot_are_paired_by_it(tmp_path: Path):
    bare = [replace(r, address=None, connection_id=None) for r in ours()]
    bare[1] = replace(bare[1], watchdog_ms=999)
    one = found(project(*bare))
    assert [d.code for d in one] == ["FSN446"]
    assert "el2904" in one[0].message
    # Halves in different slots are no slot, and so no pair of anything.
    split = crossed(tmp_path)
    assert codes(project(*ours()), split) == []
    assert codes(project(*bare), split) == ["FSN447"] * 4
