"""Report, differences, incidents and the intervention log, as pages that run nothing."""

from __future__ import annotations

import base64
import hashlib
import html
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from studio.records_folder import made_folder
from studio.server_rig import Browser, running

from fsoe_net.plan.codec import MAGIC
from fsoe_net.project import companion_files
from fsoe_net.project.companion_files import CompanionKind, files_beside


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_folder(tmp_path_factory.mktemp("records"))


@pytest.fixture(scope="module")
def browser(path: Path) -> Iterator[Browser]:
    with running(path) as studio:
        browser = Browser(studio.url)
        browser.enter()
        yield browser


def _listed(browser: Browser) -> dict[str, int]:
    status, answer = browser.get("records")
    assert status == 200
    return {row["name"]: row["number"] for row in answer["files"]}


def _page(browser: Browser, where: str, status: int = 200) -> str:
    found, headers, body = browser.ask(f"/records/{where}")
    text = body.decode()
    assert found == status, text
    policy = headers.get_all("Content-Security-Policy")
    assert len(policy) == 1
    rules = dict(rule.strip().split(" ", 1) for rule in policy[0].split(";") if " " in rule.strip())
    assert rules["default-src"] == "'none'"
    assert rules["frame-ancestors"] == "'self'"
    assert re.search(r"(?:^|; )sandbox(?:;|$)", policy[0])
    assert "unsafe-inline" not in policy[0]
    for style in re.findall(r'\sstyle="([^"]*)"', text):
        digest = hashlib.sha256(html.unescape(style).encode()).digest()
        assert f"'sha256-{base64.b64encode(digest).decode()}'" in rules["style-src"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    return text


def test_files_next_to_a_network_are_recognised_by_content(path: Path) -> None:
    kinds = {row.name: row.kind for row in files_beside(str(path))}
    assert kinds == {
        "acceptance.yaml": CompanionKind.RECORD,
        "incidents/a.fsnincident": CompanionKind.INCIDENT,
        "log": CompanionKind.LOG,
        "test-record.yaml": CompanionKind.TEST_RECORD,
    }


ROBOT = Path(__file__).parents[2] / "examples" / "robot-cell"


def test_a_robot_next_to_the_network_is_drawn_with_its_controllers(tmp_path: Path) -> None:
    shutil.copytree(ROBOT.parent, tmp_path / "examples")
    network = tmp_path / "examples" / "robot-cell" / "network.yaml"
    # Of another robot, which is in another folder.
    (network.parent / "other").mkdir()
    shutil.copy(ROBOT / "controllers.yaml", network.parent / "other" / "controllers.yaml")
    kinds = {row.name: row.kind for row in files_beside(str(network))}
    assert kinds["robot.urdf.xacro"] is CompanionKind.ROBOT
    assert kinds["controllers.yaml"] is CompanionKind.CONTROLLERS
    with running(network) as studio:
        browser = Browser(studio.url)
        browser.enter()
        files = _listed(browser)
        page = _page(browser, f"robot?file={files['robot.urdf.xacro']}")
        assert "3 controllers, 3 components, 5 SubDevices, 3 FSoE connections" in page
        assert re.search(r"<script|\ssrc=|\shref=\"http", page) is None
        _page(browser, f"robot?file={files['controllers.yaml']}", 422)
        _page(browser, f"difference?file={files['robot.urdf.xacro']}&content=x")
        (network.parent / "robot.urdf.xacro").write_text("<robot><broken></robot>", "utf-8")
        assert "FSN118" in _page(browser, f"robot?file={files['robot.urdf.xacro']}")


def test_links_out_of_the_folder_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "cell"
    (folder / ".hidden").mkdir(parents=True)
    network = folder / "network.yaml"
    text = "version: 1\nsubdevices: []\n"
    for where in (network, tmp_path / "secret.yaml", folder / ".hidden" / "a.yaml"):
        where.write_text(text)
    (folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    (folder / "out").symlink_to(tmp_path)
    (folder / "closed").mkdir(mode=0)
    (folder / "empty.yaml").touch()
    (folder / "run.json").write_text('{"passed": true}')
    (folder / "bus.json").write_text('{"scan": 1}')
    (folder / "old.fsnplan").write_bytes(MAGIC)
    (folder / "old.yaml").write_text(text)
    found = {row.name: row.words for row in files_beside(str(network))}
    assert found["bus.json"] == "a scan"
    assert set(found) == {"bus.json", "old.fsnplan", "old.yaml"}
    monkeypatch.setattr(companion_files, "_MOST_FILES", 2)
    assert {row.name for row in files_beside(str(network))} == {"bus.json"}
    assert companion_files._entries(str(tmp_path / "missing")) == []
    assert companion_files._known(str(tmp_path / "missing")) is None


def test_a_report_is_of_the_text_as_it_is(browser: Browser) -> None:
    _, answer = browser.get("state")
    number = _listed(browser)
    whole = f"report?test_record={number['test-record.yaml']}&accepted={number['acceptance.yaml']}"
    assert "configuration report" in _page(browser, whole)
    changed = answer["text"].replace("watchdog_ms: 100", "watchdog_ms: 90")
    assert changed != answer["text"]
    _, answer = browser.post("text", {"version": answer["version"], "text": changed})
    assert "90" in _page(browser, "report?test_record=&accepted=")
    text = _page(browser, "difference?file=")
    assert "Difference to the saved file" in text
    assert "watchdog_ms 100" in text.replace("watchdog 100", "watchdog_ms 100")
    text = _page(browser, f"difference?file={number['acceptance.yaml']}")
    assert "To be tried again at the machine" in text
    assert "<li>start-up" in text
    browser.post("text", {"version": answer["version"], "text": "nets: ["})
    for where in ("report?", "difference?file="):
        assert "the text is not a valid network at present" in _page(browser, where, 422)
    _, answer = browser.get("state")
    browser.post("take", {"version": answer["version"]})
    text = _page(browser, "difference?file=")
    assert "No difference" in text
    text = _page(browser, f"difference?file={number['acceptance.yaml']}")
    assert "No step of the test record" in text


def test_incidents_and_the_log_have_their_pages(browser: Browser) -> None:
    number = _listed(browser)
    assert "Likely cause" in _page(browser, f"incident?file={number['incidents/a.fsnincident']}")
    assert "what happened 3" in _page(browser, f"log?file={number['log']}")


def test_only_what_is_listed_is_opened(browser: Browser, path: Path) -> None:
    number = _listed(browser)
    for where in (
        "incident",
        "incident?file=",
        "incident?file=../../secret",
        "incident?file=99",
        f"incident?file={number['test-record.yaml']}",
        f"log?file={number['acceptance.yaml']}",
        f"difference?file={number['test-record.yaml']}",
        "report?test_record=99",
    ):
        assert "this file no longer exists" in _page(browser, where, 422)
    assert browser.ask("/records/secret")[0] == 404
    broken = path.parent / "broken.fsnincident"
    broken.write_text("<script>alert(1)</script>")
    try:
        text = _page(browser, f"incident?file={_listed(browser)['broken.fsnincident']}", 422)
    finally:
        broken.unlink()
    assert "<script" not in text
    bus = path.parent / "bus.json"
    bus.write_text('{"scan": "<img>"}')
    try:
        text = _page(browser, f"difference?file={_listed(browser)['bus.json']}", 422)
    finally:
        bus.unlink()
    assert "bus.json cannot be compared" in text
    assert "<img" not in text


def test_signing_is_a_command_to_type(browser: Browser) -> None:
    _, answer = browser.get("records")
    commands = answer["commands"]
    assert (
        commands[0] == "fsoe-net report network.yaml --test-record test-record.yaml -o report.html"
    )
    assert commands[-1] == "fsoe-net acceptance sign acceptance-new.yaml --key KEY --as verifier"
    assert "--replaces acceptance.yaml" in commands[-3]
    other = Browser(f"http://{browser.host}/")
    assert other.ask("/api/records")[0] == 403
    assert other.ask("/records/report")[0] == 403
