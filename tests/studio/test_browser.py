"""The page in a real browser, used by mouse and by keyboard."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from studio.browser import accessible, text_of, wait_for_text, write_text
from studio.server_rig import running
from weekly import first

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(EXAMPLES / "el6910", tmp_path / "cell")
    return tmp_path / "cell" / "network.yaml"


@pytest.fixture
def page(chromium: Any, cell: Path) -> Iterator[Any]:
    """The page of the cell; a word of the browser's console, or another host, fails the test."""
    with running(cell) as studio:
        context = chromium.new_context(viewport={"width": 1400, "height": 900})
        context.set_default_timeout(300_000)  # a busy machine is no failure
        page = context.new_page()
        said: list[str] = []
        asked: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(studio.url)
        page.wait_for_selector(".card")
        yield page
        context.close()
    assert said == []
    assert {url.split("/")[2] for url in asked} == {studio.url.split("/")[2]}


def _verdict(page: Any, text: str) -> None:
    page.wait_for_function(
        "text => document.querySelector('.verdict').textContent.includes(text)", arg=text
    )


def _holds(page: Any, text: str) -> None:
    """Wait until the text pane has a text in it."""
    wait_for_text(page, "text.includes(arg)", text)


def _connection(page: Any, sub: str) -> Any:
    return page.get_by_role("button", name=f"to {sub}", exact=False)


def test_a_connection_is_removed_drawn_confirmed_and_saved(page: Any, cell: Path) -> None:
    before = cell.read_text("utf-8")
    _connection(page, "drive_2").focus()
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Remove this connection").click()
    _verdict(page, "not saved")
    assert page.locator(".line").count() == 3
    page.locator('[data-port="el6910/3"]').drag_to(page.locator('[data-port="drive_2/0"]'))
    _verdict(page, "has errors")
    page.get_by_role("button", name="I have compared it with the safety project").click()
    for label, value in (("FSoE address", "202"), ("ConnID", "4"), ("FSoE watchdog, ms", "100")):
        field = page.get_by_role("textbox", name=label)
        field.fill(value)
        field.press("Enter")
    _holds(page, "watchdog_ms: 100}")
    page.keyboard.press("Control+s")
    _verdict(page, "· saved")
    saved = cell.read_text("utf-8")
    assert saved != before
    for line in ("address: 202", "connection_id: 4", "watchdog_ms: 100", "slot: 3"):
        assert line in saved
    for _ in range(6):
        shown = text_of(page)
        page.get_by_role("button", name="Undo").click()
        wait_for_text(page, "text !== arg", shown)
    assert text_of(page) == before


def test_the_facts_of_a_connection_are_on_its_line(page: Any) -> None:
    page.wait_for_selector(".line text")
    assert page.locator(".line text").all_text_contents() == [
        "address 101 · ConnID 1 · 100 ms",
        "address 102 · ConnID 2 · 100 ms",
        "address 201 · ConnID 3 · 100 ms",
        "address 202 · ConnID 4 · 100 ms",
    ]
    page.set_viewport_size({"width": 700, "height": 450})  # as at 200 %
    page.locator(".line text").first.wait_for(state="detached")


def test_a_selected_card_has_one_outline_and_the_path_one_line(page: Any, cell: Path) -> None:
    page.set_viewport_size({"width": 700, "height": 450})
    page.get_by_role("button", name="el1904 SubInstance").click()
    page.mouse.move(0, 0)
    outlined = page.evaluate(
        "[...document.querySelectorAll('.board *')]"
        ".filter((e) => getComputedStyle(e).outlineStyle !== 'none').map((e) => e.className)"
    )
    assert [name.split()[0] for name in outlined] == ["card"]
    path = page.locator(".path")
    assert path.get_attribute("title") == str(cell)
    assert path.text_content() == "…/cell/network.yaml"
    assert path.bounding_box()["height"] < 30


def test_only_what_fits_lights_up_and_the_reason_is_shown(page: Any) -> None:
    for sub in ("drive_2", "el1904"):
        _connection(page, sub).focus()
        page.keyboard.press("Enter")
        with page.expect_response("**/api/change"):
            page.get_by_role("button", name="Remove this connection").click()
    port = page.get_by_label("el6910, slot 3,")
    port.focus()
    page.keyboard.press("Enter")
    assert page.locator(".port.fits").get_attribute("data-port") == "drive_2/0"
    assert (
        "sends 11 bytes, 6 are taken there" in page.locator(".card", has_text="el1904").inner_text()
    )
    assert "in use already" in page.locator(".card", has_text="el2904").inner_text()
    page.keyboard.press("Escape")
    assert page.locator(".port.fits").count() == 0
    port.focus()
    page.keyboard.press("Enter")
    page.get_by_label("drive_2, slot 0,").focus()
    page.keyboard.press("Enter")  # keyboard alone connects
    page.wait_for_selector(".line.open")


def test_text_and_drawing_follow_each_other(page: Any) -> None:
    text = text_of(page)
    write_text(page, text.replace("el2904, position: 3", "el2904, position: 33"))
    page.wait_for_selector("text=position 33")
    write_text(page, text.replace("subdevices:", "subdevices"))
    page.wait_for_selector("text=The text is not a valid network at present")
    assert page.locator(".card").count() == 5  # the last network stays in sight
    write_text(page, text.replace("size: 6", "size: 5", 1))
    finding = page.locator(".findings li.error").first
    finding.wait_for()
    finding.locator(".message").click()
    page.wait_for_function("document.activeElement.className === 'editor'")
    page.locator(".cm-lint-marker").first.hover()
    page.locator(".cm-diagnostic-error").first.wait_for()
    page.get_by_role("button", name="Apply the hint").first.click()
    _verdict(page, "no errors")
    assert text_of(page) == text


def test_the_editor_folds_searches_and_marks_findings(page: Any) -> None:
    text = text_of(page)
    content = page.locator(".cm-content")
    line = 1 + text.split("\n").index("subdevices:")
    page.locator(".cm-gutterElement", has_text=re.compile(f"^{line}$")).wait_for()
    assert page.get_by_text("position: 2, config: devices/el1904.yaml").count() == 1
    page.get_by_title("Fold line", exact=True).first.click()
    assert page.get_by_text("position: 2, config: devices/el1904.yaml").count() == 0
    page.locator(".cm-foldPlaceholder").click()
    content.focus()
    page.keyboard.press("Control+f")
    page.keyboard.type("el2904.yaml")
    page.keyboard.press("Enter")
    page.locator(".cm-searchMatch-selected").wait_for()
    accessible(page)
    page.keyboard.press("Escape")
    write_text(page, text.replace("size: 6", "size: 5", 1))
    # The page may draw it again meanwhile.
    page.wait_for_function(
        """() => {
            const editor = document.querySelector(".editor").shadowRoot;
            const marker = editor.querySelector(".cm-lint-marker-error");
            return marker && getComputedStyle(marker, "::before").content === '"✖"';
        }"""
    )


def test_text_and_drawing_have_one_undo(page: Any) -> None:
    before = text_of(page)
    _connection(page, "drive_2").focus()
    page.keyboard.press("Enter")
    page.get_by_role("button", name="Remove this connection").click()
    wait_for_text(page, "text !== arg", before)
    drawn = text_of(page)
    page.locator(".cm-content").focus()
    page.keyboard.press("Control+End")
    page.keyboard.insert_text("# typed")
    page.keyboard.press("Control+z")  # typed and not sent yet: this is undone first
    wait_for_text(page, "text === arg", drawn)
    page.keyboard.press("Control+z")
    wait_for_text(page, "text === arg", before)
    page.locator(".line").nth(3).wait_for()
    page.keyboard.press("Control+Shift+Z")
    wait_for_text(page, "text === arg", drawn)
    page.get_by_role("button", name="Add SubDevices").focus()  # outside of the text
    page.keyboard.press("Control+z")
    wait_for_text(page, "text === arg", before)
    page.keyboard.press("Control+Shift+Z")
    wait_for_text(page, "text === arg", drawn)


def test_the_editor_is_left_by_keyboard_and_saves_what_was_typed_last(
    page: Any, cell: Path
) -> None:
    page.locator(".cm-content").focus()
    page.keyboard.press("Control+End")
    page.keyboard.type("# last")
    with page.expect_response("**/api/save"):
        page.keyboard.press("Control+s")
    assert cell.read_text("utf-8").endswith("\n# last")
    page.keyboard.press("Tab")
    assert text_of(page).endswith("\n  # last")
    page.keyboard.press("Escape")
    page.keyboard.press("Tab")
    assert not page.evaluate("document.activeElement.matches('.editor')")


def test_two_tabs_and_a_file_that_changes(page: Any, cell: Path) -> None:
    second = page.context.new_page()
    second.goto(page.url)
    second.wait_for_selector(".card")
    page.bring_to_front()
    write_text(page, text_of(page) + "# one\n")
    _holds(second, "# one\n")
    cell.write_text(cell.read_text("utf-8") + "# theirs\n", "utf-8")
    page.wait_for_selector("text=The file on the disk was changed")
    page.get_by_role("button", name="Use the text of the file").click()
    _holds(page, "# theirs\n")
    page.get_by_role("button", name="Undo").click()
    _holds(page, "# one\n")


def test_it_is_tried_on_the_emulated_bus(page: Any) -> None:
    page.set_viewport_size({"width": 1280, "height": 500})
    page.reload()
    page.locator(".card").first.wait_for()
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    moved = "[...document.querySelectorAll('*')].some((e) => e.scrollTop > 0)"
    assert not page.evaluate(moved)  # the page begins at its top
    page.get_by_role("button", name="Try it").click()
    page.wait_for_selector("text=4 of 4 in Data")
    text = text_of(page)
    came = page.locator(".line .came").all_text_contents()
    assert len(came) == 4
    assert all(re.fullmatch(r"✔ Data .* after [0-9.]+ ms", words) for words in came), came
    result = page.locator(".trial [role=status]")
    assert result.evaluate(
        "e => e.getBoundingClientRect().top >= 0 && e.getBoundingClientRect().bottom <= innerHeight"
    )
    write_text(page, text + "# more\n")
    page.wait_for_selector("text=of an earlier text")
    page.get_by_role("button", name="Undo").click()
    page.wait_for_selector("text=of an earlier text", state="detached")
    write_text(page, text + "# saved\n")
    page.wait_for_selector("text=of an earlier text")
    page.get_by_role("button", name="Try it").click()
    page.wait_for_selector("text=of an earlier text", state="detached")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("· saved").wait_for()
    assert result.inner_text() == "✔ 4 of 4 in Data"
    write_text(page, text.replace("size: 6", "size: 5", 1))
    _verdict(page, "has errors")
    assert page.get_by_role("button", name="Try it").is_disabled()


def test_a_connection_that_does_not_come_up_has_the_reason_on_its_line(page: Any) -> None:
    # Without the safety functions, whose budget rejects a watchdog that is below the bus cycle.
    text = text_of(page).partition("\n# Figures of an example")[0]
    text = re.sub(r"^project:.*\n", "", text, flags=re.MULTILINE)
    text = text.replace("cycle_us: 1000", "cycle_us: 20000")
    write_text(page, text.replace("watchdog_ms: 100", "watchdog_ms: 5", 1))
    page.get_by_text("address 101 · ConnID 1 · 5 ms").wait_for()
    page.get_by_role("button", name="Try it").click()
    page.wait_for_selector("text=3 of 4 in Data")
    stopped = page.get_by_role("button", name="Connection el6910 to el1904")
    assert "✖ stopped in Reset: watchdog expired" in stopped.get_attribute("aria-label")
    assert page.locator(".line .came.error").count() == 1
    page.get_by_role("button", name="Undo").click()  # the result is that of another text
    page.locator(".line .came").first.wait_for(state="detached")


def test_the_drawing_is_zoomed_and_moved(page: Any) -> None:
    frame = page.get_by_role("group", name="Drawing of the network")
    card = page.locator(".card").first
    before = card.bounding_box()["width"]

    def is_shown(percent: int) -> None:
        page.get_by_role("button", name=f"Zoom {percent} %").wait_for()

    frame.focus()
    for key, percent in (("+", 120), ("+", 144), ("0", 100), ("-", 83)):
        page.keyboard.press(key)
        is_shown(percent)
    assert card.bounding_box()["width"] == pytest.approx(before / 1.2, abs=1)
    frame.hover()
    page.keyboard.down("Control")
    for _ in range(5):
        page.mouse.wheel(0, -100)
        page.wait_for_timeout(50)
    page.keyboard.up("Control")
    is_shown(200)  # the limit
    ends = "e => [e.scrollLeft + e.clientWidth, e.scrollTop + e.clientHeight]"
    at = frame.bounding_box()
    frame.evaluate("e => e.scrollTo(0, 0)")
    x, y = at["x"] + 4, at["y"] + at["height"] - 30  # the ground, left of all cards
    seen = frame.evaluate(ends)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 60)
    page.mouse.up()
    assert frame.evaluate(ends) == [seen[0], seen[1] + 60]
    page.get_by_role("button", name="Fit").click()
    page.wait_for_function(
        "() => { const e = document.querySelector('.frame');"
        " return e.scrollHeight <= e.clientHeight; }"
    )
    page.wait_for_function(
        """() => {
          const port = document.querySelector("[data-port='el1904/0']").getBoundingClientRect();
          const line = document.querySelector(".line .thin").getBoundingClientRect();
          return Math.abs(line.right - (port.left + port.right) / 2) < 1;
        }"""
    )  # the line ends at its slot


def test_the_sizes_of_the_parts_are_kept(page: Any) -> None:
    bar = page.get_by_role("separator", name="Height of the text")
    text = page.get_by_role("region", name="File")
    whole = page.locator("main").bounding_box()["height"]
    bar.focus()
    for _ in range(5):
        page.keyboard.press("ArrowUp")
    assert bar.get_attribute("aria-valuenow") == "44"
    assert text.bounding_box()["height"] == pytest.approx(0.44 * whole, abs=2)
    side = page.get_by_role("separator", name="Width of the right side")
    at = side.bounding_box()
    page.mouse.move(at["x"] + 3, at["y"] + 200)
    page.mouse.down()
    page.mouse.move(700, at["y"] + 200)
    page.mouse.up()
    assert side.get_attribute("aria-valuenow") == "50"
    page.evaluate("localStorage.setItem('fsoe-net-pane-text', '<b>')")
    page.reload()
    assert side.get_attribute("aria-valuenow") == "50"
    assert bar.get_attribute("aria-valuenow") == "34"  # what the browser kept is no number


def test_letters_in_a_number_are_refused_in_words(page: Any, cell: Path) -> None:
    before = cell.read_text("utf-8")
    _connection(page, "drive_2").focus()
    page.keyboard.press("Enter")
    field = page.get_by_label("FSoE watchdog, ms")
    field.fill("1OO")
    page.keyboard.press("Enter")
    alert = page.locator(".field [role=alert]")
    assert "“1OO” is not a whole number from 0 to 65534; not taken." in alert.inner_text()
    assert field.get_attribute("aria-invalid") == "true"
    assert text_of(page) == before
    field.fill("101")
    page.keyboard.press("Enter")
    alert.wait_for(state="detached")
    _holds(page, "watchdog_ms: 101")


def test_errors_are_before_warnings_and_notes(page: Any) -> None:
    text = text_of(page)
    write_text(
        page, text.replace("cycle_us:", "foo: 1\ncycle_us:", 1).replace("size: 6", "size: 5", 1)
    )
    page.locator(".findings li.error").first.wait_for()
    ranks = page.eval_on_selector_all(".findings li", "rows => rows.map((row) => row.className)")
    assert len(set(ranks)) > 1, ranks
    assert ranks == sorted(ranks, key=["error", "warning", "info"].index)


def test_hostile_names_are_text(page: Any) -> None:
    evil = "<img src=x onerror=alert(1)>"
    write_text(page, text_of(page).replace("name: el6910-cell", f'name: "{evil}"'))
    page.wait_for_function("text => document.body.innerText.includes(text)", arg=evil)
    assert page.locator("img").count() == 0


@pytest.mark.parametrize("scheme", first(1, ["dark", "light"]))
def test_it_follows_wcag(page: Any, scheme: str) -> None:
    """WCAG 2.2, level AA, as far as a program can tell; with everything in sight."""
    page.emulate_media(color_scheme=scheme)
    write_text(page, text_of(page).replace("size: 6", "size: 5", 1))
    page.locator(".findings li.error").first.wait_for()
    _connection(page, "drive_2").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector(".field")
    page.get_by_role("button", name="Undo").click()
    page.get_by_role("button", name="Redo").wait_for()
    page.get_by_role("button", name="Try it").click()
    page.get_by_text("What happened, in order").click()
    page.get_by_text("Frames and copies, to the byte").click()
    accessible(page)
