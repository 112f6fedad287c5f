"""Links at ports and positions leave one tree, or nothing is said."""

from __future__ import annotations

from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.model.scan import Scan, ScannedPort, ScannedSubDevice
from fsoe_net.model.wiring import Cable, Wiring, reached, wiring_of

ORDER = (3, 1, 2)


def _scan(*links: str, unread: int | None = None) -> Scan:
    """Return a bus from the linked ports of each SubDevice, such as ``013``."""
    subs = [
        ScannedSubDevice(
            position=n,
            ports=tuple(
                ScannedPort(port=p, link=None if n == unread and p == 1 else str(p) in ports)
                for p in range(4)
            ),
        )
        for n, ports in enumerate(links)
    ]
    return Scan(interface="eth1", subdevices=tuple(subs))


def _cables(*rows: tuple[int | None, int]) -> tuple[Cable, ...]:
    return tuple(Cable(position=n, parent=parent, port=p) for n, (parent, p) in enumerate(rows))


@pytest.mark.parametrize(
    ("links", "cables", "ring"),
    [
        (("0",), _cables((None, 0)), None),
        (("01", "01", "0"), _cables((None, 0), (0, 1), (1, 1)), None),
        (("01", "01", "01"), _cables((None, 0), (0, 1), (1, 1)), (2, 1)),
        (("01",), _cables((None, 0)), (0, 1)),
        # a junction: first what hangs at port 3, then the line goes on at port 1, then port 2
        (("0123", "0", "0", "0"), _cables((None, 0), (0, 3), (0, 1), (0, 2)), None),
        (("013", "01", "0", "01"), _cables((None, 0), (0, 3), (1, 1), (0, 1)), (3, 1)),
    ],
)
def test_states_of_links(
    links: tuple[str, ...], cables: tuple[Cable, ...], ring: tuple[int, int] | None
) -> None:
    assert wiring_of(_scan(*links)) == Wiring(cables=cables, ring_from=ring)


@pytest.mark.parametrize(
    "links",
    [
        (),
        ("",),  # no link is known at all
        ("1",),  # fed at another port than 0
        ("0", "0"),  # a SubDevice behind the end
        ("0123", "0"),  # two cables with nothing at their ends
    ],
)
def test_nothing_is_said_where_links_and_subdevices_do_not_match(links: tuple[str, ...]) -> None:
    assert wiring_of(_scan(*links)) is None


def test_nothing_is_said_where_a_link_was_not_read() -> None:
    assert wiring_of(_scan("01", "0", unread=0)) is None


_TREES = st.recursive(
    st.just({}),
    lambda tree: st.dictionaries(st.sampled_from(ORDER), tree, max_size=3),
    max_leaves=12,
)


@given(_TREES)
def test_every_tree_is_found_again(tree: dict[int, object]) -> None:
    numbers, links, cables = count(), [], []

    def walk(node: dict[int, dict], parent: int | None, port: int) -> None:
        own = next(numbers)
        cables.append((parent, port))
        links.append("0" + "".join(map(str, node)))
        for at in ORDER:
            if at in node:
                walk(node[at], own, at)

    walk(tree, None, 0)
    assert wiring_of(_scan(*links)) == Wiring(cables=_cables(*cables))


LINE = (None, 0, 1)
TREE = (None, 0, 1, 0)  # 3 branches off at 0
TWO_BUSES = (None, 0, None, 2)


@pytest.mark.parametrize(
    ("parents", "rings", "cut", "left"),
    [
        (LINE, (), (), {0, 1, 2}),
        (LINE, (), (0,), set()),
        (LINE, (), (1,), {0}),
        (TREE, (), (1,), {0, 3}),
        (TREE, (), (3,), {0, 1, 2}),
        (LINE, (2,), (1,), {0, 1, 2}),  # a ring: 1 and 2 are reached from its other end
        (LINE, (2,), (3,), {0, 1, 2}),  # 3 is the cable that closes it
        (LINE, (2,), (1, 3), {0}),
        (LINE, (2,), (0, 2), {2}),
        (TWO_BUSES, (), (0,), {2, 3}),
    ],
)
def test_subdevices_before_a_cut_cable_or_on_the_other_side_of_a_ring_are_reached(
    parents: tuple[int | None, ...], rings: tuple[int, ...], cut: tuple[int, ...], left: set[int]
) -> None:
    assert reached(parents, rings, cut) == left
