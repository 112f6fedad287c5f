"""The network in other formats, as the text is in the page; files come in within limits."""

from __future__ import annotations

import io
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from studio.server_rig import Browser, running

from fsoe_net import convert
from fsoe_net.formats.registry import all_targets
from fsoe_net.studio import files as file_routes

ROOT = Path(__file__).parents[2]
ESI = ROOT / "tests" / "formats" / "esi" / "modular.xml"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "examples" / "estop", tmp_path / "estop")
    return tmp_path / "estop" / "network.yaml"


@pytest.fixture
def browser(path: Path) -> Iterator[Browser]:
    with running(path) as studio:
        browser = Browser(studio.url)
        browser.enter()
        yield browser


def test_each_format_is_what_convert_writes(browser: Browser, path: Path) -> None:
    targets = browser.json("/api/targets")["targets"]
    assert [row["name"] for row in targets] == list(all_targets())
    for name in ("eni", "c", "driver"):
        shown = browser.json(f"/api/export/{name}?version=1")
        called = shown["files"][0]["name"]
        made = convert(str(path), to=name, name=called)
        assert [row["name"] for row in shown["files"]] == list(made.files)
        assert shown["notes"] == list(dict.fromkeys(made.notes))
        status, headers, data = browser.ask(f"/api/export/{name}/download?version=1")
        assert status == 200
        assert headers["Content-Disposition"].startswith('attachment; filename="')
        if len(made.files) == 1:
            assert data == made.files[called]
            continue
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            assert {n: archive.read(n) for n in archive.namelist()} == made.files


def test_unsaved_text_is_exported_as_in_the_page(browser: Browser, path: Path) -> None:
    offers = browser.json("/api/offers")["offers"]
    number = next(row["number"] for row in offers if row["process_data"] == "device PDO")
    status, state = browser.post("add", {"version": 1, "offers": [number]})
    assert status == 200
    assert state["unwritten"]
    assert any("unverified" in text for text in state["said"])
    shown = browser.json(f"/api/export/eni?version={state['version']}")
    assert shown["error"] == ""
    assert not (path.parent / state["unwritten"][0]).exists()


_COUPLER = b"""<EtherCATInfo><Vendor><Id>2</Id><Name>Maker</Name></Vendor><Descriptions><Devices>
<Device Physics="YY"><Type ProductCode="#x077a2c52" RevisionNo="#x00010000">EK1914</Type>
<Sm StartAddress="#x1000" DefaultSize="128" ControlByte="#x26">MBoxOut</Sm>
<Sm StartAddress="#x1080" DefaultSize="128" ControlByte="#x22">MBoxIn</Sm>
<Sm StartAddress="#x1100" ControlByte="#x24">Outputs</Sm>
<Sm StartAddress="#x1180" ControlByte="#x20">Inputs</Sm>
<Mailbox><CoE/></Mailbox></Device></Devices></Descriptions></EtherCATInfo>"""


def test_start_commands_of_an_esi_are_exported(browser: Browser) -> None:
    assert browser.give("maker/maker.xml", _COUPLER)[0] == 200
    assert browser.json("/api/offers")["findings"] == []
    where = "/api/export/eni"
    with_esi = browser.json(f"{where}?version=1")["notes"]
    assert b"<Mailbox>" in browser.ask(f"{where}/download?version=1")[2]
    browser.post("files/clear", {})
    without = browser.json(f"{where}?version=1")["notes"]
    assert b"<Mailbox>" not in browser.ask(f"{where}/download?version=1")[2]
    assert any(note.startswith("Physics, mailbox") and "ek1914" in note for note in without)
    assert not any(note.startswith("Physics, mailbox") and "ek1914" in note for note in with_esi)
    assert not any("fsoe-net-studio" in note for note in with_esi)
    browser.give("maker/maker.xml", _COUPLER[:-40])
    for end in ("", "/download"):
        status, _, refused = browser.ask(f"{where}{end}?version=1")
        assert status == 422
        assert b"nothing written; maker/maker.xml:" in refused


@pytest.mark.parametrize("end", ["", "/download"])
def test_an_export_that_cannot_be_made_gives_the_reason(browser: Browser, end: str) -> None:
    for target, version, words in (
        ("eni", "2", "something else has changed meanwhile"),
        ("eni", "x", "something else has changed meanwhile"),
        ("word", "1", "unknown format 'word'; there are"),
    ):
        status, _, data = browser.ask(f"/api/export/{target}{end}?version={version}")
        assert status == 422
        assert words in data.decode()
    browser.post("text", {"version": 1, "text": "nets: ["})
    status, _, data = browser.ask(f"/api/export/eni{end}?version=2")
    assert status == 422
    assert "nothing written; " in data.decode()
    assert "network.yaml:2:1" in data.decode()


def test_files_come_in_and_are_put_away(browser: Browser) -> None:
    status, answer = browser.give("maker.xml", ESI.read_bytes())
    assert status == 200
    assert b'"files":["maker.xml"]' in answer
    shown = browser.json("/api/offers")
    assert any(row["file"] == "maker.xml" for row in shown["offers"])
    status, gone = browser.post("files/clear", {})
    assert status == 200
    assert gone["files"] == []


def test_a_file_needs_the_header_of_the_page_and_its_length(browser: Browser) -> None:
    assert browser.give("a.xml", b"x", X_Fsoe_Net=None)[0] == 403
    assert browser.give("a.xml", b"x", Origin="http://evil.example")[0] == 403
    assert browser.give("a.xml", b"x", Content_Length=str(1 << 40))[0] == 413
    browser.cookie = ""
    assert browser.give("a.xml", b"x")[0] == 403


def test_files_that_are_too_large_together_leave_nothing(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_routes.Uploads, "room_bytes", lambda _: 10)
    status, answer = browser.give("a.xml", b"12345678901")
    assert status == 413
    assert b"too large; remove some first" in answer
    assert browser.json("/api/offers")["files"] == []
    assert browser.give("a.xml", b"1234567890")[0] == 200


def test_a_full_disk_and_too_many_files_are_said(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fsoe_net.studio.uploads.Upload.write", full)
    status, answer = browser.give("a.xml", b"1")
    assert status == 422
    assert b"cannot be kept: No space left on device" in answer
    monkeypatch.setattr("fsoe_net.studio.uploads._MOST_FILES", 0)
    status, answer = browser.give("a.xml", b"1")
    assert status == 422
    assert b"put them away first" in answer


def test_the_proposal_of_files_becomes_the_text(browser: Browser) -> None:
    status, refused = browser.post("import", {"version": 1})
    assert status == 422
    assert "propose no network" in refused["error"]
    scan = (ROOT / "tests" / "diagnostics" / "base" / "scan.json").read_bytes()
    assert browser.give("scan.json", scan)[0] == 200
    status, state = browser.post("import", {"version": 1})
    assert status == 200
    assert len(state["subdevices"]) == 3
    assert state["can_undo"] is True
    status, state = browser.post("example", {"version": state["version"]})
    assert status == 200
    assert state["name"] == "estop"
