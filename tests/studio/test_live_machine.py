"""The picture of the live page: order and cables of SubDevices, lamps, e-stops, axes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from networks import EXAMPLES, example, resolved
from studio.browser import needed

from fsoe_net.core.bus_documents import Found, SubDeviceSnapshot
from fsoe_net.errors import InputError
from fsoe_net.model.kinds import SubDeviceKind
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scan import Scan, ScannedPort, ScannedSubDevice

needed("starlette", "studio")

from fsoe_net.studio.live_cabling import CablePlace, bus_row, lines_of  # noqa: E402
from fsoe_net.studio.live_emulated import EmulatedFeed  # noqa: E402

EK1100 = (2, 0x044C2C52)  # not in the file


def scan(network: Resolution, *links: str) -> Scan:
    """Return a scan of a coupler and the SubDevices of a network, by their linked ports."""
    own = [s.device for s in network.network.subdevices if s.device is not None]
    identities = [EK1100, *((device.vendor_id, device.product_code) for device in own)]
    return Scan(
        interface="eth1",
        subdevices=tuple(
            ScannedSubDevice(
                position=n,
                vendor_id=vendor,
                product_code=product,
                name="EK1100",
                ports=tuple(ScannedPort(port=p, link=str(p) in link) for p in range(4)),
            )
            for n, (link, (vendor, product)) in enumerate(zip(links, identities, strict=True))
        ),
    )


def machine(feed: EmulatedFeed) -> dict[str, Any]:
    """Return what changes of a run that no thread steps."""
    feed._look(ended=False)
    view = feed.message(0, 0, 0)[0]["machine"]
    assert isinstance(view, dict)
    return view


def test_lamps_have_the_names_of_the_network_and_then_of_the_device_file() -> None:
    feed = EmulatedFeed(resolved(EXAMPLES / "robot-cell" / "network.yaml"), "")
    nodes = {n["name"]: n for n in feed.machine()["nodes"]}
    assert [row["label"] for row in nodes["el1904"]["inputs"]] == [
        "ES1 channel A",  # safety_functions
        "ES1 channel B",
        "safe input 3",  # devices/el1904.yaml
        "safe input 4",
    ]
    assert [row["label"] for row in nodes["axis_1"]["outputs"]] == ["STO", "SS1"]
    assert [n["kind"] for n in nodes.values()] == [
        "logic",
        "terminal",
        "terminal",
        "drive",
        "drive",
    ]
    assert nodes["axis_1"]["axes"] == ["axis_1"]
    (stop,) = feed.machine()["stops"]
    assert (stop["logic"], stop["subdevice"], stop["title"]) == ("el6910", "el1904", "button ES1")
    scope = {row["name"]: row["label"] for row in feed.signals()}
    assert scope["el1904.0x6001:01"] == "ES1 channel A"


def test_values_follow_the_safe_inputs_in_the_order_of_the_lamps() -> None:
    feed = EmulatedFeed(example("estop"), "")
    assert machine(feed)["values"] == [1, 1, 0, 0]  # both channels; outputs before Data
    feed.command(["set ek1914.0x6001:02 0"])
    assert machine(feed)["values"] == [1, 0, 0, 0]


def test_an_axis_shows_its_angle_as_a_part_of_a_turn() -> None:
    feed = EmulatedFeed(example("robot-cell"), "")
    axis = feed._session.network.axes["axis_2"].axis
    axis.context.servo.plant.angle = -math.tau * 0.25
    axis.context.servo.plant.speed = math.tau
    assert machine(feed)["axes"] == [
        [0.0, 0.0, "Not ready to switch on"],
        [0.75, 60.0, "Not ready to switch on"],
    ]


def test_two_buses_are_two_lines_with_names_of_their_own() -> None:
    picture = EmulatedFeed(example("two-buses"), "").machine()
    assert picture["buses"] == ["cell", "drives"]
    assert [(n["name"], n["bus"], n["parent"]) for n in picture["nodes"]] == [
        ("el6910", 0, None),
        ("el1904", 0, 0),
        ("el2904", 0, 1),
        ("drive_1", 1, None),
        ("drive_2", 1, 3),
    ]


def test_a_subdevice_with_an_alias_stays_after_the_previous_one() -> None:
    places = [("c", 0, 2), ("a", 0, 0), ("x", 7, 0), ("b", 0, 1)]
    rows = lines_of([CablePlace(name=n, bus=0, alias=a, position=p) for n, a, p in places])
    assert [node.name for node in rows.nodes] == ["a", "x", "b", "c"]


def test_a_cut_cable_of_a_tree_separates_its_branch_alone() -> None:
    network = example("el6910")
    feed = EmulatedFeed(network, "", scan(network, "013", "01", "0", "01", "01", "0"))
    nodes = feed.machine()["nodes"]
    assert [(n["name"] or n["type"], n["parent"], n["port"]) for n in nodes] == [
        ("EK1100", None, 0),
        ("el6910", 0, 3),
        ("el1904", 1, 1),
        ("el2904", 0, 1),
        ("drive_1", 3, 1),
        ("drive_2", 4, 1),
    ]
    feed.set_cable(1, whole=False)
    assert machine(feed)["separated"] == ["el1904", "el6910"]
    feed.set_cable(1, whole=True)
    assert machine(feed)["separated"] == []


def test_a_ring_needs_two_cuts_to_separate_what_is_between_them() -> None:
    network = example("el6910")
    feed = EmulatedFeed(network, "", scan(network, "01", "01", "01", "01", "01", "01"))
    assert feed.machine()["rings"] == [5]
    feed.set_cable(3, whole=False)
    assert machine(feed)["separated"] == []
    feed.set_cable(5, whole=False)
    assert machine(feed)["separated"] == ["drive_1", "el2904"]
    feed.set_cable(6, whole=False)  # the one that closes it
    assert machine(feed)["separated"] == ["drive_1", "drive_2", "el2904"]
    with pytest.raises(InputError, match="unknown cable 7"):
        feed.set_cable(7, whole=False)


def test_a_repaired_cable_returns_neither_what_was_pulled_nor_what_is_absent() -> None:
    feed = EmulatedFeed(example("tool-exchange"), "")
    names = [n["name"] for n in feed.machine()["nodes"]]
    feed.command([f"break {names[1]}"])
    session = feed._session
    absent = set(session.absent)
    assert session.away < absent
    feed.set_cable(0, whole=False)
    assert session.absent == set(names)
    feed.set_cable(0, whole=True)
    assert session.absent == absent
    feed.set_cable(0, whole=False)
    feed.command(["pull gripper"])  # meanwhile
    feed.set_cable(0, whole=True)
    assert session.absent == absent | {"valves"}


def subdevice(name: str, position: int, link: tuple[int, ...] = ()) -> SubDeviceSnapshot:
    numbers = dict.fromkeys(
        ("bus", "alias", "vendor_id", "product_code", "revision", "returns", "stale_cycles"), 0
    )
    return SubDeviceSnapshot(
        **numbers,
        name=name,
        position=position,
        known=True,
        al="OP",
        al_code=0,
        detail="",
        found=Found.RIGHT,
        link=link,
        link_lost=(),
        rx_errors=(),
    )


def test_a_real_bus_is_drawn_by_the_links_that_it_reports() -> None:
    tree = [subdevice("a", 0, (1, 1, 0, 1)), subdevice("b", 1, (1,)), subdevice("c", 2, (1, 1))]
    picture = bus_row(tree, {"a": SubDeviceKind.COUPLER})
    assert [(n["kind"], n["parent"], n["port"]) for n in picture["nodes"]] == [
        ("coupler", None, 0),
        ("terminal", 0, 3),
        ("terminal", 0, 1),
    ]
    assert picture["rings"] == [2]
    unknown = bus_row([subdevice("b", 2, (1,)), subdevice("a", 1, (1, 1))], {})
    assert [(n["name"], n["parent"]) for n in unknown["nodes"]] == [("a", None), ("b", 0)]
