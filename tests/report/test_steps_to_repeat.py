"""Which steps a change calls for again."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from report.made import BASE, TIMED, inputs_of

from fsoe_net.compare.diff import compare
from fsoe_net.compare.diff_types import Change, ChangeArea, ChangeKind
from fsoe_net.compare.sides import side_of_network, side_of_plan
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.report.steps_to_repeat import steps_to_repeat
from fsoe_net.test_record.steps import make_test_record


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
    steps = make_test_record(now, b"").steps
    return list(steps_to_repeat(changes, now, steps)), len(steps)


def test_nothing_changed_nothing_again() -> None:
    resolution = _resolution()
    assert steps_to_repeat((), resolution, make_test_record(resolution, b"").steps) == ()


@pytest.mark.shows("R27")
def test_a_connection_touches_its_ends_and_what_uses_them(tmp_path: Path) -> None:
    again, _ = _again(tmp_path, lambda t: t.replace("connection_id: 11", "connection_id: 12"))
    assert again == [
        "start-up logic-io",  # the logic has an end in both
        "start-up logic-io2",
        "trigger estop",
        "loss io2",
        "loss logic",
    ]


@pytest.mark.shows("R27")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("{bit: 0, name: K1}, {bit: 1, name: K2}", "{bit: 1, name: K1}, {bit: 0, name: K2}"),
        ("{bit: 0, name: K1}", "{bit: 2, name: K1}"),
    ],
    ids=["exchanged", "moved"],
)
def test_a_safe_bit_calls_for_the_trigger(tmp_path: Path, old: str, new: str) -> None:
    shutil.copytree(BASE / "devices", tmp_path / "devices")
    bits = "sub: io2, bits: [{bit: 0, name: K1}, {bit: 1, name: K2}], time_ms: 3"
    text = TIMED.read_text("utf-8").replace("sub: io2, time_ms: 3", bits)
    found = []
    for name, stated in (("before", text), ("now", text.replace(old, new))):
        path = tmp_path / f"{name}.yaml"
        path.write_text(stated, "utf-8")
        found.append(_resolution(path))
    again, _ = _since(*found)
    assert again == ["trigger estop"]


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
def test_shared_or_renamed_parts_touch_all(tmp_path: Path, find: str, put: str) -> None:
    def edit(text: str) -> str:
        assert find in text
        text = text.replace(find, put)
        return text.replace("io2", "io3") if "io3" in put else text

    again, count = _again(tmp_path, edit)
    assert len(again) == count


@pytest.mark.shows("R27")
@pytest.mark.parametrize(
    "change",
    [
        Change(kind=ChangeKind.REMOVED, area=ChangeArea.SUBDEVICE, where="io"),
        Change(kind=ChangeKind.CHANGED, area=ChangeArea.CONNECTION, where="io - somebody"),
        Change(kind=ChangeKind.CHANGED, area=ChangeArea.SUBDEVICE, where="radio"),
        Change(kind=ChangeKind.CHANGED, area=ChangeArea.SAFETY_FUNCTION, where=""),
    ],
    ids=lambda c: f"{c.kind} {c.where}",
)
def test_a_change_without_a_place_touches_all(change: Change) -> None:
    resolution = _resolution()
    steps = make_test_record(resolution, b"").steps
    assert len(steps_to_repeat([change], resolution, steps)) == len(steps)


LOGIC = ["start-up logic-io", "start-up logic-io2", "trigger estop", "loss logic"]


def _network(folder: Path, text: str, device: tuple[str, str] = ("", "")) -> Resolution:
    shutil.copytree(BASE / "devices", folder / "devices")
    path = folder / "devices" / "el6910.yaml"
    board = path.read_text("utf-8")
    assert device[0] in board
    path.write_text(board.replace(*device, 1) if device[0] else board, "utf-8")
    (folder / "n.yaml").write_text(text, "utf-8")
    return _resolution(folder / "n.yaml")


def _since(before: Resolution, now: Resolution) -> tuple[list[str], list[str]]:
    """Return the steps since a record, as it has them, and all steps."""
    plans = compile_plan(before), compile_plan(now)
    assert fingerprint_of(plans[0]).whole != fingerprint_of(plans[1]).whole
    functions = before.network.safety_functions
    old = side_of_plan(plans[0], "a", functions)
    changes = compare(old, side_of_network(now, "b")).changes
    steps = make_test_record(now, b"").steps
    again = steps_to_repeat(changes, now, steps, plans=plans, functions=functions)
    return list(again), [step.id for step in steps]


@pytest.mark.shows("R27")
@pytest.mark.parametrize("by_meaning", [True, False])
def test_application_parameters_touch_the_ends_of_their_connection(
    tmp_path: Path, by_meaning: bool
) -> None:
    text = TIMED.read_text("utf-8")
    assert text.count('app_parameters: "01 00"') == 1
    text = text.replace('app_parameters: "01 00"', 'app_parameters: "02 00"')
    before, now = _resolution(), _network(tmp_path, text)
    plans = compile_plan(before), compile_plan(now)
    changes = compare(side_of_plan(plans[0], "a"), side_of_network(now, "b")).changes
    assert [(c.what, c.before, c.after) for c in changes] == [("app_parameters", "0100", "0200")]
    steps = make_test_record(now, b"").steps
    again = steps_to_repeat(changes if by_meaning else (), now, steps, plans=plans)
    assert again[:2] == ("start-up logic-io", "start-up logic-io2")
    assert "loss logic" in again


@pytest.mark.shows("R27")
@pytest.mark.parametrize(
    "device",
    [
        ("0xf200, sub_index: 1, type: uint8", "0xf200, sub_index: 1, type: int8"),
        ("state_interface: logic_state", "state_interface: logic_state, factor: 2"),
        ("index: 0x17ff", "index: 0x17fe"),
        ("rpdo:", "assign_activate: 0x0300\nrpdo:"),
    ],
    ids=["type", "factor", "PDO", "distributed clocks"],
)
def test_a_difference_in_the_fingerprint_alone_counts(
    tmp_path: Path, device: tuple[str, str]
) -> None:
    now = _network(tmp_path, TIMED.read_text("utf-8"), device)
    assert _since(_resolution(), now)[0] == LOGIC


def test_another_order_touches_all(tmp_path: Path) -> None:
    text = TIMED.read_text("utf-8")
    rows = [
        f"  - {{name: {name}, config: devices/ek1914.yaml}}\n"
        for name in ("io, position: 0", "io2, position: 1")
    ]
    assert "".join(rows) in text
    text = text.replace("".join(rows), "".join(reversed(rows)))
    again, steps = _since(_resolution(), _network(tmp_path, text))
    assert again == steps


@pytest.mark.parametrize("name", ["io-2", '"io 2"'])
def test_a_new_name_next_to_one_that_looks_like_the_old_touches_all(
    tmp_path: Path, name: str
) -> None:
    text = TIMED.read_text("utf-8")
    (tmp_path / "a").mkdir()
    before = _network(tmp_path / "a", text.replace("io2", name))
    (tmp_path / "b").mkdir()
    again, steps = _since(before, _network(tmp_path / "b", text.replace("io2", "box")))
    assert again == steps


def test_the_logic_belongs_to_a_function_that_does_not_name_it(tmp_path: Path) -> None:
    text = "".join(
        line for line in TIMED.read_text("utf-8").splitlines(True) if "kind: logic" not in line
    )
    for name in "ab":
        (tmp_path / name).mkdir()
    before = _network(tmp_path / "a", text)
    sdos = "sdo:\n  - {index: 0x8000, sub_index: 1, type: uint8, value: 3}\nrpdo:"
    now = _network(tmp_path / "b", text, ("rpdo:", sdos))
    assert _since(before, now)[0] == LOGIC


def test_an_element_that_is_not_a_subdevice_any_more_touches_its_function(tmp_path: Path) -> None:
    text = TIMED.read_text("utf-8").replace("logic, sub: logic,", "logic, name: logic,")
    assert _since(_resolution(), _network(tmp_path, text))[0] == ["trigger estop"]


def test_the_new_end_of_a_copy_is_touched_too() -> None:
    resolution = _resolution()
    steps = make_test_record(resolution, b"").steps
    change = Change(
        kind=ChangeKind.CHANGED,
        area=ChangeArea.COPY,
        where="io 0x6010:01 -> logic 0xf200:01",
        what="source",
        before="io 0x6010:01",
        after="io2 0x6010:01",
    )
    again = steps_to_repeat([change], resolution, steps)
    assert {"loss io", "loss io2", "loss logic"} <= set(again)
