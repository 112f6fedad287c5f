"""Which steps a change calls for again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from report.made import BASE, TIMED, inputs_of

from fsoe_net.model import Resolution
from fsoe_net.report import Change, compare, side_of_network, steps_again
from fsoe_net.run import make_protocol


def _resolution(path: Path = TIMED) -> Resolution:
    found = inputs_of(path).resolution
    assert found is not None
    return found


def _again(tmp_path: Path, edit: Callable[[str], str]) -> tuple[list[str], int]:
    """Return the steps after an edit of the network, and how many steps there are."""
    path = tmp_path / "now.yaml"
    text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
    path.write_text(edit(text), "utf-8")
    before, now = _resolution(), _resolution(path)
    changes = compare(side_of_network(before, "a"), side_of_network(now, "b")).changes
    assert changes
    steps = make_protocol(now, b"").steps
    return list(steps_again(changes, now, steps)), len(steps)


def test_nothing_changed_nothing_again() -> None:
    resolution = _resolution()
    assert steps_again((), resolution, make_protocol(resolution, b"").steps) == ()


def test_a_connection_touches_its_ends_and_what_uses_them(tmp_path: Path) -> None:
    again, _ = _again(tmp_path, lambda t: t.replace("connection_id: 11", "connection_id: 12"))
    assert again == [
        "start-up logic-io",  # the logic has an end in both
        "start-up logic-io2",
        "trigger estop",
        "loss io2",
        "loss logic",
    ]


def test_a_safety_function_touches_itself(tmp_path: Path) -> None:
    again, _ = _again(tmp_path, lambda t: t.replace("time_ms: 20,", "time_ms: 21,"))
    assert again == ["trigger estop"]


@pytest.mark.parametrize(
    ("find", "put"),
    [
        ("cycle_us: 1000", "cycle_us: 2000"),
        ("name: io2,", "name: io3,"),
    ],
)
def test_what_all_share_or_lost_its_name_touches_all(tmp_path: Path, find: str, put: str) -> None:
    def edit(text: str) -> str:
        assert find in text
        text = text.replace(find, put)
        return text.replace("io2", "io3") if "io3" in put else text

    again, count = _again(tmp_path, edit)
    assert len(again) == count


@pytest.mark.parametrize(
    "change",
    [
        Change(kind="removed", area="subdevice", where="io"),
        Change(kind="changed", area="connection", where="io - somebody"),
        Change(kind="changed", area="subdevice", where="radio"),
        Change(kind="changed", area="safety_function", where=""),
    ],
    ids=lambda c: f"{c.kind} {c.where}",
)
def test_what_cannot_be_placed_touches_all(change: Change) -> None:
    resolution = _resolution()
    steps = make_protocol(resolution, b"").steps
    assert len(steps_again([change], resolution, steps)) == len(steps)
