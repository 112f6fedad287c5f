"""A network from nothing, by mouse alone; files dropped on the page; export and what it loses."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from studio.browser import accessible, text_of, wait_for_text, write_text
from studio.server_rig import running

ROOT = Path(__file__).parents[2]
ESI = ROOT / "tests" / "formats" / "esi" / "modular.xml"
SCAN = ROOT / "tests" / "diagnostics" / "base" / "scan.json"
CLICK_S = 1.5  # a person's pace
LONGEST_S = 180


class Mouse:
    """A person who has a mouse only, and counts."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.clicks = 0

    def click(self, locator: Any) -> None:
        self.clicks += 1
        locator.click()

    def drag(self, begin: Any, end: Any) -> None:
        self.clicks += 2  # press there, let go here
        begin.drag_to(end)


@pytest.fixture
def page(chromium: Any, tmp_path: Path) -> Iterator[Any]:
    """The page of a folder without a network."""
    (tmp_path / "cell").mkdir()
    with running(tmp_path / "cell" / "network.yaml") as studio:
        context = chromium.new_context(viewport={"width": 1280, "height": 800})
        context.set_default_timeout(300_000)  # a busy machine is no failure
        page = context.new_page()
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(studio.url)
        page.get_by_role("region", name="Begin").wait_for()
        yield page
        context.close()
    assert said == []


def _offer(page: Any, order: str, process_data: str) -> Any:
    return page.get_by_role("button", name=re.compile(f"^Add {order}, .*{process_data}"))


def _saved(page: Any) -> None:
    page.wait_for_function(
        "() => document.querySelector('.verdict').textContent.includes('· saved')"
    )


def test_from_nothing_to_data_by_mouse_alone(page: Any, tmp_path: Path) -> None:
    mouse = Mouse(page)
    begin = page.get_by_role("region", name="Begin")
    mouse.click(begin.get_by_role("button", name="Add SubDevices"))
    mouse.click(_offer(page, "EK1914", "as devices report it"))
    page.locator('[data-port="ek1914/0"]').wait_for()
    mouse.click(page.get_by_text("3 more variants of EL1918"))
    mouse.click(_offer(page, "EL1918", "MainInstance · own safety program"))
    page.locator('[data-port="el1918/0"]').wait_for()
    mouse.click(page.get_by_role("button", name="Close"))
    mouse.drag(page.locator('[data-port="el1918/0"]'), page.locator('[data-port="ek1914/0"]'))
    mouse.click(page.get_by_role("button", name="I have compared it with the safety project"))
    for _ in range(2):  # FSoE address, ConnID
        proposal = page.get_by_role("button", name="1: next free").first
        mouse.click(proposal)
    mouse.click(page.get_by_role("button", name="Try it"))
    page.wait_for_selector("text=1 of 1 in Data")
    assert not (tmp_path / "cell" / "network.yaml").exists()
    mouse.click(page.get_by_role("button", name="Save"))
    _saved(page)
    assert mouse.clicks * CLICK_S < LONGEST_S
    assert mouse.clicks == 12
    assert sorted(p.name for p in (tmp_path / "cell").rglob("*.yaml")) == [
        "ek1914.yaml",
        "el1918.yaml",
        "network.yaml",
    ]


def test_safety_logic_is_added_with_the_connections_of_its_subinstances(page: Any) -> None:
    page.get_by_role("region", name="Begin").get_by_role("button", name="Add").click()
    offers = page.get_by_role("list", name="What can be added")
    page.get_by_role("button", name="safe output").click()
    offers.locator("li > .offer b", has_text="EL2904").first.wait_for()
    orders = offers.locator("li > .offer b").all_inner_texts()
    assert not {"EL1904", "EL6910"} & {*orders}
    assert len(orders) == len({*orders})  # one row for each type
    search = page.get_by_role("searchbox", name="Search")
    search.fill("safe input el1904")
    _offer(page, "EL1904", "SubInstance").first.click()
    page.locator('[data-port="el1904/0"]').wait_for()
    search.fill("drive")
    _offer(page, "0x302", "11 bytes").click()
    page.locator(".bus .box").nth(1).wait_for()
    page.get_by_role("button", name="safety logic", exact=True).click()
    page.get_by_role("button", name="Add EL6910 with 2 connections").wait_for()
    row = offers.locator("li", has_text="EL6910")
    row.locator("summary").click()
    row.get_by_role("combobox", name="Connections").select_option("16")
    row.get_by_role("group", name="Slot 15").get_by_label("to it").select_option("7")
    accessible(page, "light", "dark")
    page.get_by_role("button", name="Add EL6910 with 16 connections").click()
    page.locator('[data-port="el6910/15"]').wait_for()
    lengths = [
        page.locator(f'[data-port="el6910/{slot}"]').get_attribute("title") for slot in (0, 1, 15)
    ]
    assert [text.split(": ")[1].split(";")[0] for text in lengths if text] == [
        "6 bytes out, 6 in",
        "11 bytes out, 31 in",
        "7 bytes out, 6 in",
    ]


def test_the_example_is_taken_and_its_things_can_be_tried(page: Any) -> None:
    page.get_by_role("button", name="Use the e-stop example").click()
    things = page.get_by_role("region", name="Five things to try")
    things.wait_for()
    assert things.locator("li").count() == 5
    page.get_by_role("button", name="Try it").click()
    page.wait_for_selector("text=1 of 1 in Data")
    page.get_by_role("button", name="Connection el1918 to ek1914").focus()
    page.keyboard.press("Enter")
    field = page.get_by_role("textbox", name="FSoE watchdog, ms")
    field.fill("20")
    field.press("Enter")
    page.wait_for_selector(".findings >> text=is below 24 ms")
    page.get_by_role("button", name="Undo").click()
    wait_for_text(page, "text.includes(arg)", "_ms: 100")
    write_text(page, text_of(page).replace("size: 6", "size: 5", 1))
    page.get_by_role("button", name="Apply the hint").first.click()
    wait_for_text(page, "!text.includes(arg)", "size: 5")
    page.get_by_role("button", name="Export").click()
    page.get_by_role("combobox", name="Format").select_option("eni")
    page.wait_for_selector("text=What this format cannot hold")
    assert page.locator(".lost li").count() > 0
    with page.expect_download() as download:
        page.get_by_role("link", name="Download estop.eni.xml").click()
    assert b"EtherCATConfig" in Path(download.value.path()).read_bytes()


TYPED = """async () => {
    document.querySelector('[aria-label^="Connection el1918 to ek1914"]').dispatchEvent(
        new KeyboardEvent('keydown', { key: 'Enter', bubbles: true }));
    while (!document.querySelector('#field-FSoE-watchdog-ms')) await new Promise(setTimeout);
    const field = document.querySelector('#field-FSoE-watchdog-ms');
    field.value = '20';
    field.dispatchEvent(new InputEvent('input', { bubbles: true }));
    await new Promise((done) => setTimeout(done, 500));
    return field.value;
}"""


def test_fast_typing_is_kept(page: Any) -> None:
    """Before the page has done what it does after it was drawn."""
    page.get_by_role("button", name="Use the e-stop example").click()
    page.get_by_role("button", name="Connection el1918 to ek1914").focus()
    assert page.evaluate(TYPED) == "20"


def test_files_are_dropped_and_their_subdevices_added(page: Any) -> None:
    _drop(page, {"maker.xml": ESI.read_bytes(), "scan.json": SCAN.read_bytes()})
    page.get_by_text("A bus of 3 SubDevices").wait_for()
    page.get_by_role("button", name="Add EK1914, position 1").click()
    page.locator('[data-port="ek1914/0"]').wait_for()
    page.get_by_role("button", name="Add its SubDevices that are not here (2)").click()
    page.locator('[data-port="el6910/1"]').wait_for()
    assert page.locator(".bus .box").count() == 3
    for _ in range(2):
        page.get_by_role("button", name="Undo").click()
    page.get_by_role("region", name="Begin").wait_for()
    page.get_by_role("button", name="Remove").click()
    page.get_by_text("A bus of 3 SubDevices").wait_for(state="detached")
    page.get_by_label("Files", exact=True).set_input_files(ESI)
    page.get_by_role("searchbox", name="Search").fill("modular")
    page.get_by_role("button", name="Add D,").click()
    page.locator('[data-port="d/0"]').wait_for()
    page.get_by_text("Added: d").wait_for()
    page.get_by_label("Folder", exact=True).set_input_files(SCAN.parent / "devices")
    page.get_by_text("devices/").first.wait_for()
    page.get_by_label("Files", exact=True).set_input_files(SCAN)
    page.get_by_role("button", name="Use it as the network").click()
    page.locator(".bus .box").nth(2).wait_for()
    assert page.locator(".bus .box").all_inner_texts()[0].startswith("0 ")
    page.get_by_role("button", name="Undo").click()
    page.locator('[data-port="d/0"]').wait_for()


def _drop(page: Any, files: dict[str, bytes]) -> None:
    """Drop files on the page as a file manager does."""
    page.evaluate(
        """files => {
          const data = new DataTransfer();
          for (const [name, bytes] of files)
            data.items.add(new File([new Uint8Array(bytes)], name));
          const main = document.querySelector("main");
          for (const kind of ["dragover", "drop"])
            main.dispatchEvent(new DragEvent(kind, {
              dataTransfer: data, bubbles: true, cancelable: true }));
        }""",
        [[name, list(data)] for name, data in files.items()],
    )


def test_subdevices_change_places_and_go(page: Any) -> None:
    page.get_by_role("button", name="Use the e-stop example").click()
    boxes = page.locator(".bus .box")
    boxes.nth(1).wait_for()
    boxes.nth(0).drag_to(boxes.nth(1))
    page.wait_for_function("() => document.querySelector('.bus .box').innerText.includes('el1918')")
    boxes.nth(0).click()
    page.get_by_role("button", name="Towards the end").focus()
    page.keyboard.press("Enter")
    page.wait_for_function("() => document.querySelector('.bus .box').innerText.includes('ek1914')")
    field = page.get_by_role("textbox", name="Name", exact=True)
    field.fill("door")
    field.press("Enter")
    page.get_by_role("heading", name="door").wait_for()
    field = page.get_by_role("textbox", name="Alias")
    field.fill("7")
    field.press("Enter")
    page.wait_for_selector("text=7 +1")
    assert "door → ek1914" in page.locator(".inspector").inner_text()
    page.get_by_role("button", name="Remove this SubDevice").click()
    page.wait_for_function("() => document.querySelectorAll('.bus .box').length === 1")
    assert page.locator(".line").count() == 0
    field = page.get_by_role("textbox", name="Bus cycle, µs")
    field.fill("2000")
    field.press("Enter")
    wait_for_text(page, "text.includes(arg)", "cycle_us: 2000")


def test_it_follows_wcag(page: Any) -> None:
    """WCAG 2.2, level AA, as far as a program can tell: begin, add, export; light and dark."""
    accessible(page)
    _drop(page, {"scan.json": SCAN.read_bytes(), "gate.xml": b"<EtherCATInfo><Vendor>"})
    page.locator(".given li.error").first.wait_for()
    page.get_by_role("button", name="Remove").click()
    _drop(page, {"bus.json": _bus("013", "0", "01")})
    page.get_by_text("A ring with branches").wait_for()
    page.get_by_text("3 have several possible process data").wait_for()
    page.locator(".given summary").click()
    page.get_by_text("more variants of EK1914").first.click()
    _offer(page, "EK1914", "device PDO").first.click()
    page.get_by_text("Added: ek1914").wait_for()
    accessible(page)
    accessible(page, "dark")
    page.get_by_role("button", name="Undo").click()
    page.get_by_role("button", name="Use the e-stop example").click()
    page.locator('[data-port="el1918/0"]').wait_for()  # an empty network cannot be exported
    page.get_by_role("button", name="Export").click()
    page.get_by_role("combobox", name="Format").select_option("driver")
    page.get_by_role("link", name="Download").wait_for()
    accessible(page)


def _bus(*links: str) -> bytes:
    """Return a scan of couplers with these linked ports."""
    row = {"vendor_id": 2, "product_code": 0x077A2C52, "name": "EK1914", "revision": 1}
    subs = [
        {
            "position": n,
            **row,
            "ports": [{"port": p, "link": str(p) in ports} for p in range(4)],
        }
        for n, ports in enumerate(links)
    ]
    return json.dumps({"scan": 1, "interface": "eth1", "subdevices": subs}).encode()


def test_a_tree_and_a_ring_are_drawn_so(page: Any) -> None:
    page.get_by_role("button", name="Use the e-stop example").click()
    _drop(page, {"bus.json": _bus("013", "01", "0", "0")})
    page.get_by_text("A tree, by the links in bus.json").wait_for()
    branch = page.get_by_role("list", name="Branch from ek1914, port 3 (D)")
    assert branch.locator("li").count() == 2
    assert "≠ EK1914 in the scan" in branch.inner_text()
    branch.get_by_role("button", name="el1918").focus()
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="el1918").wait_for()
    assert "not in the file" in page.locator(".foreign").first.inner_text()
    _drop(page, {"bus.json": _bus("01", "01")})
    page.get_by_text("A ring, by the links in bus.json").wait_for()
    page.get_by_text("back to the MainDevice").wait_for()
    _drop(page, {"bus.json": _bus("0123", "0")})
    page.get_by_text("leave open how the cables run").wait_for()
    page.get_by_role("button", name="Remove", exact=True).click()
    page.get_by_text("leave open how the cables run").wait_for(state="detached")
