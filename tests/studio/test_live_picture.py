"""The picture and the time axis of the live page in a real browser."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from networks import EXAMPLES
from studio.browser import accessible
from studio.live_page import opened
from studio.server_rig import running


@pytest.fixture
def page(chromium: Any, tmp_path: Path) -> Iterator[Any]:
    """The live page of the robot cell, in an emulated run."""
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    with (
        running(tmp_path / "examples" / "el6910" / "network.yaml") as studio,
        opened(chromium, f"{studio.url}#live") as page,
    ):
        page.get_by_role("button", name="Start an emulated run").click()
        page.get_by_role("button", name="el6910, safety logic").get_by_text("outputs on").wait_for()
        yield page


def test_a_cable_is_cut_by_mouse_and_repaired_by_keyboard(page: Any) -> None:
    cable = page.get_by_role("button", name="Cable between el2904 and drive_1")
    cable.locator(".scissors").click()
    effects = page.locator(".effects")
    effects.get_by_text("Cut: the cable between el2904 and drive_1.").wait_for()
    effects.get_by_text("No frame reaches drive_1, drive_2 any more.").wait_for()
    page.get_by_role("button", name="drive_2, drive").get_by_text("✖ no answer").wait_for()
    page.get_by_role("button", name="drive_2, drive").press(" ")
    page.get_by_text("A cut cable separates it").wait_for()
    accessible(page, "light", "dark")
    cable.press("Enter")
    page.get_by_role("button", name="drive_2, drive").get_by_text("OP").wait_for()
    page.locator(".log .events").get_by_text("cable between el2904 and drive_1 repaired").wait_for()


def test_motors_turn_until_the_e_stop(page: Any) -> None:
    hand = page.get_by_role("button", name="drive_1, drive").locator(".axis g")
    first = hand.get_attribute("transform")
    page.get_by_role("button", name="Start the axes").click()
    page.locator(".axis.turns").nth(1).wait_for()
    assert hand.get_attribute("transform") != first
    page.get_by_role("button", name="Press button ES1 at el1904").click()
    page.locator(".axis.turns").first.wait_for(state="detached")
    page.get_by_role("button", name="Start the axes").wait_for()  # the program has stopped, too


def until(page: Any) -> float:
    """Return the end of the window of the time axis in s."""
    return float(page.locator(".times > .row output").inner_text().split()[0])


def test_one_time_axis_is_scrolled_zoomed_and_has_one_cursor(page: Any) -> None:
    page.wait_for_function(
        "() => parseFloat(document.querySelector('.times output').textContent) > 3"
    )
    page.locator(".times select").first.select_option("2")
    tracks = page.get_by_role("group", name="Time axis")
    tracks.focus()
    page.keyboard.press("ArrowLeft")  # a tenth of 2 s: no longer the newest time
    page.get_by_role("button", name="Follow again").wait_for()
    first = until(page)
    page.keyboard.press("ArrowLeft")
    assert until(page) == pytest.approx(first - 0.2, abs=0.0015)
    page.keyboard.press("Shift+ArrowLeft")
    at = float(page.locator(".cursor").inner_text().split()[0])
    assert until(page) - at == pytest.approx(0.02, abs=0.0015)  # a hundredth of 2 s
    page.keyboard.press("+")
    assert page.locator(".times select").first.evaluate("e => e.value") == "1.6"
    canvas = page.locator(".strips canvas").first
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 10)
    page.mouse.wheel(0, 100)
    page.wait_for_function("() => document.querySelector('.times select').value === '2'")
    before = until(page)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + box["width"] / 10, box["y"] + 10, steps=4)
    page.mouse.up()
    assert before - until(page) == pytest.approx(0.2, abs=0.02)
    tracks.focus()
    page.keyboard.press("Home")
    assert until(page) == pytest.approx(2, abs=0.0015)  # the first 2 s
    pause = page.get_by_role("button", name="Pause")
    while not pause.count():
        page.keyboard.press("ArrowRight")  # up to the newest time, which it then follows
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("End")
    pause.wait_for()


def test_an_event_under_the_cursor_is_marked(page: Any) -> None:
    page.get_by_role("button", name="Press button ES1 at el1904").click()
    page.locator(".events").get_by_text("el6910: outputs off").wait_for()
    page.get_by_role("button", name="Pause").click()
    page.locator(".events").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    times = dict.fromkeys(page.locator(".events li code").all_inner_texts())
    assert page.locator(".cursor").inner_text() == list(times)[1]
    assert set(page.locator(".events [aria-current] code").all_inner_texts()) == {list(times)[1]}


CHECK_LAYOUT = """async ({ nodes, rings, width }) => {
    const { fitted } = await import('/assets/live_machine.js');
    const full = nodes.map((node) => ({ kind: 'terminal', type: '', about: '', bus: 0, axes: [],
        inputs: [], outputs: [{ name: 'a.0x7000:01', label: '' }], ...node }));
    const connections = full.slice(1).map(({ name }) => ({ name, main: full[0].name, sub: name }));
    return fitted({ nodes: full, rings, buses: [] }, connections, width);
}"""


@pytest.mark.parametrize("width", [320, 846, 1480])
@pytest.mark.parametrize(
    ("parents", "rings"),
    [
        ([None, *range(299)], []),  # a line
        ([None, *range(49)], [49]),  # a ring
        ([None, 0, 1, 0, 3, 0, 5, 4], []),  # a tree with branches of branches
        ([None, 0, None, 2], []),  # two buses
    ],
)
def test_no_two_parts_overlap_at_any_width(
    chromium: Any, live_assets: Any, parents: list[int | None], rings: list[int], width: int
) -> None:
    roots = [n for n, parent in enumerate(parents) if parent is None]
    ports: dict[int | None, int] = {}
    nodes = []
    for n, parent in enumerate(parents):
        ports[parent] = ports.get(parent, 0) + 1
        bus = sum(root <= n for root in roots) - 1
        nodes.append({"name": f"s{n}", "parent": parent, "port": ports[parent], "bus": bus})
    found = live_assets.evaluate(CHECK_LAYOUT, {"nodes": nodes, "rings": rings, "width": width})[
        "places"
    ]
    boxes = [*found["nodes"], *found["ends"]]
    assert len(boxes) == len(parents) + len(roots)
    for n, box in enumerate(boxes):
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= found["width"]
        assert box["y"] + box["height"] <= found["height"]
        for other in boxes[:n]:
            apart_x = (
                box["x"] >= other["x"] + other["width"] or other["x"] >= box["x"] + box["width"]
            )
            apart_y = (
                box["y"] >= other["y"] + other["height"] or other["y"] >= box["y"] + box["height"]
            )
            assert apart_x or apart_y
    assert sorted(c["number"] for c in found["cables"]) == list(range(len(parents) + len(rings)))
    assert len(found["arcs"]) == len(parents) - 1


@pytest.fixture(scope="module")
def live_assets(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A page that can import the modules of the page."""
    path = tmp_path_factory.mktemp("assets") / "network.yaml"
    with running(path) as studio, opened(chromium, studio.url) as page:
        yield page


STEPS = """async ({ rows, every }) => {
    const { stepsOf } = await import('/assets/live_scope.js');
    return stepsOf(rows, 1, 0, rows.length - 1, every);
}"""


def test_a_signal_keeps_its_changes_extremes_and_gaps(live_assets: Any) -> None:
    rows = [[0, 1], [1, 1], [2, 0], [3, None], [4, 0], [5, 9], [6, 0]]
    every_cycle = [[0, 1], [2, 0], [3, None], [4, 0], [5, 9], [6, 0]]
    assert live_assets.evaluate(STEPS, {"rows": rows, "every": 1}) == every_cycle
    # One pixel for all: the gap and the peak are still there.
    few = live_assets.evaluate(STEPS, {"rows": rows, "every": 100})
    assert [value for _, value in few] == [1, 0, None, 9, 0]


@pytest.mark.parametrize(
    ("span", "width", "step"), [(10_000, 600, 2000), (20, 900, 2), (90, 90, 100)]
)
def test_ticks_of_the_time_axis_are_round(
    live_assets: Any, span: int, width: int, step: int
) -> None:
    script = "async ([span, width]) => (await import('/assets/live_time.js')).tickStep(span, width)"
    assert live_assets.evaluate(script, [span, width]) == step
