"""Records and the test record in a real browser; what was entered is never lost."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from cases_file import DIAGNOSTICS
from patience import PATIENCE_S
from studio.browser import accessible, text_of, write_text
from studio.records_folder import made_folder
from studio.server_rig import Studio, running

from fsoe_net.studio.workspace import Workspace

ROOT = Path(__file__).parents[2]
OF_ANOTHER = """() => localStorage.setItem('fsoe-net test record other step trigger old',
  JSON.stringify({step: 'trigger old', subdevice: '', now: {result: 'as expected'}}))"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_folder(tmp_path_factory.mktemp("records"))


@pytest.fixture
def path(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made.parent, tmp_path / "cell")
    return tmp_path / "cell" / made.name


@pytest.fixture
def tablet(chromium: Any) -> Iterator[Any]:
    context = chromium.new_context(viewport={"width": 820, "height": 1180}, has_touch=True)
    context.set_default_timeout(PATIENCE_S * 1000)
    yield context
    context.close()


def test_documents_are_shown_and_run_nothing(tablet: Any, path: Path) -> None:
    said: list[str] = []
    shutil.copy(ROOT / "docs" / "images" / "report.png", path.parent / "logo.png")
    for name in ("robot.urdf", "transfers.yaml"):
        shutil.copy(DIAGNOSTICS / "base" / name, path.parent / name)
    with path.open("a", encoding="utf-8") as file:
        file.write("report: {logo: logo.png}\n")
    with running(path) as studio:
        page = tablet.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.goto(studio.url)
        page.get_by_role("link", name="Records").click()
        page.get_by_role("button", name="Show the report").click()
        report = page.frame_locator("iframe[title=Report]")
        report.locator("h1").wait_for()
        assert report.locator("img.logo").evaluate("i => i.decode().then(() => i.naturalWidth)") > 0
        assert report.locator("svg rect").first.evaluate("r => getComputedStyle(r).fill") != ""
        with tablet.expect_page() as opened:
            page.get_by_role("link", name="Open in a tab").click()
        opened.value.locator("h1").wait_for()
        opened.value.close()
        page.get_by_role("button", name="a.fsnincident").click()
        page.frame_locator("iframe").get_by_text("Likely cause").first.wait_for()
        page.get_by_label("From").select_option(label="acceptance.yaml, an acceptance record")
        page.get_by_role("button", name="Show the difference").click()
        page.frame_locator("iframe").get_by_text("No difference").first.wait_for()
        page.get_by_role("button", name="robot.urdf").click()
        page.frame_locator("iframe").get_by_role("img", name="unbound: nothing").wait_for()
        page.get_by_text("acceptance sign acceptance-new.yaml --key KEY --as verifier").wait_for()
        accessible(page, "light", "dark")
        page.get_by_role("link", name="Network").click()
        write_text(page, text_of(page).replace("watchdog_ms: 100", "watchdog_ms: 90"))
        page.wait_for_selector("text=not saved")
        page.get_by_role("link", name="Records").click()
        page.get_by_role("button", name="Show the difference").click()
        page.frame_locator("iframe").get_by_text("It differs").wait_for()
        page.get_by_role("button", name="Save", exact=True).click()  # what is shown is of this text
        page.get_by_text("· saved").wait_for()
        assert page.get_by_text("of an earlier text").count() == 0
    assert said == []


class _Restarted:
    """A studio that is killed and started again at the same port."""

    def __init__(self, path: Path) -> None:
        self.path, self.port = path, 0
        self.start()

    def start(self) -> None:
        self.studio = Studio(Workspace(str(self.path)), port=self.port)
        self.port = int(self.studio.url.split(":")[2].split("/")[0])
        self._thread = threading.Thread(target=self.studio.run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self.studio.stop()
        self._thread.join()


def _enter(page: Any, result: str, remark: str) -> None:
    page.get_by_label(result, exact=False).first.check()
    page.get_by_label("Remark").fill(remark)
    page.get_by_role("textbox", name="Name").fill("A. Person")


def _machine(path: Path, number: int) -> dict[str, Any]:
    text = (path.parent / "test-record.yaml").read_text("utf-8")
    return dict(yaml.safe_load(text)["steps"][number]["machine"])


def test_entries_survive_tab_and_server(tablet: Any, path: Path) -> None:
    server = _Restarted(path)
    try:
        page = tablet.new_page()
        page.goto(f"{server.studio.url}#test-record")
        page.goto(f"http://127.0.0.1:{server.port}/#test-record")
        page.get_by_role("button", name="Enter, and continue").wait_for()
        boxes = page.locator(".step button, .step label.big, .step input[type=text], .list button")
        for box in boxes.all():
            assert box.bounding_box()["height"] >= 44
        _enter(page, "✔ as expected", "quick")
        accessible(page, "light", "dark")
        with page.expect_response("**/api/test-record/enter"):
            page.get_by_role("button", name="Enter, and continue").click()
        page.wait_for_selector("text=1 of ")
        assert _machine(path, 0)["remark"] == "quick"
        server.stop()  # killed while a person goes on
        _enter(page, "✖ not as expected", "too slow")
        page.get_by_role("button", name="Enter, and continue").click()
        page.wait_for_selector("text=1 not sent yet")
        page.get_by_label("Remark").fill("half a sen")
        page.close()
        server.start()
        page = tablet.new_page()
        page.goto(server.studio.url)
        page.get_by_role("link", name="Test record").click()
        page.wait_for_function("() => document.body.innerText.includes('failed')")
        assert page.get_by_text("not sent yet").count() == 0
        assert _machine(path, 1)["result"] == "not as expected"
        assert _machine(path, 1)["by"] == "A. Person"
        assert _machine(path, 0)["remark"] == "quick"
        assert page.get_by_text("Entries for another test record").count() == 0
        page.evaluate("() => localStorage.setItem('fsoe-net test record x', 'no entry')")
        page.evaluate(OF_ANOTHER)
        page.locator(".list button", has_text="not finished").click()
        page.get_by_text("Entries for another test record (1)").click()
        page.get_by_text("trigger old: as expected").wait_for()
        assert page.get_by_label("Remark").input_value() == "half a sen"
    finally:
        server.stop()


def test_two_people_at_one_step(tablet: Any, path: Path) -> None:
    with running(path) as studio:
        page = tablet.new_page()
        page.goto(studio.url)
        page.get_by_role("link", name="Test record").click()
        page.get_by_role("button", name="Enter, and continue").wait_for()
        test_record = path.parent / "test-record.yaml"
        document = yaml.safe_load(test_record.read_text("utf-8"))
        theirs = {"result": "as expected", "remark": "theirs", "by": "B. Other"}
        document["steps"][0]["machine"] |= theirs | {"date": "2026-11-20"}
        test_record.write_text(yaml.safe_dump(document, sort_keys=False))
        _enter(page, "✖ not as expected", "mine")
        page.get_by_role("button", name="Enter, and continue").click()
        page.locator(".list button", has_text="another person has entered").click()
        page.get_by_text("as expected, theirs, B. Other, 2026-11-20").wait_for()
        page.get_by_role("button", name="Enter mine; theirs stays in the remark").click()
        page.locator(".list button", has_text="failed").wait_for()
        remark = _machine(path, 0)["remark"]
        assert remark == "mine; before: as expected, theirs, B. Other, 2026-11-20"


def test_an_answer_that_comes_late_does_not_replace_the_test_record_chosen_since(
    tablet: Any, path: Path
) -> None:
    shutil.copy(path.parent / "test-record.yaml", path.parent / "tests-2.yaml")
    late: list[Any] = []
    with running(path) as studio:
        page = tablet.new_page()
        page.goto(f"{studio.url}#test-record")
        choice = page.get_by_label("Test record", exact=True)
        choice.wait_for()
        first = choice.input_value()
        second = next(n for n in choice.locator("option").all() if n.inner_text() == "tests-2.yaml")
        other = second.get_attribute("value")
        assert other != first
        page.route(f"**/api/test-record?file={other}", lambda route: late.append(route))
        choice.select_option(other)
        with page.expect_response(f"**/api/test-record?file={first}"):
            choice.select_option(first)
        with page.expect_response(f"**/api/test-record?file={other}"):
            late[0].continue_()
        page.evaluate("() => new Promise((then) => setTimeout(then, 200))")
        assert choice.input_value() == first
