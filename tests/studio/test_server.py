"""One browser comes in, by an address that counts once; everything else stays outside."""

from __future__ import annotations

import re
import shutil
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from studio.server_rig import Browser, Studio, running

from fsoe_net.errors import EnvironmentFault
from fsoe_net.studio import server as server_module
from fsoe_net.studio import workspace as workspace_module
from fsoe_net.studio.workspace import MAX_TEXT_BYTES, Workspace

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    return tmp_path / "estop" / "network.yaml"


@pytest.fixture
def studio(path: Path) -> Iterator[Studio]:
    with running(path) as studio:
        yield studio


@pytest.fixture
def browser(studio: Studio) -> Browser:
    browser = Browser(studio.url)
    browser.enter()
    return browser


def test_the_address_counts_once(studio: Studio) -> None:
    first, second = Browser(studio.url), Browser(studio.url)
    status, headers, body = first.ask("/")
    assert status == 403
    assert b"open the address that fsoe-net studio printed" in body
    assert first.ask("/?token=wrong")[0] == 403
    status, headers, _ = first.ask(first.first)
    assert status == 303
    assert headers["Location"] == "/"
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert "Path=/" in cookie
    first.cookie = cookie.partition(";")[0]
    assert first.ask("/")[0] == 200
    status, _, body = second.ask(second.first)
    assert status == 403
    assert b"was used already" in body
    assert second.ask("/api/state")[0] == 403
    second.cookie = first.cookie[:-1] + "x"
    assert second.ask("/api/state")[0] == 403
    second.cookie = "\u00e4=\u00fc"
    assert second.ask("/api/state")[0] == 403


def test_every_answer_forbids_what_the_page_does_not_need(browser: Browser) -> None:
    for where in ("/", "/api/state", "/assets/app.js", "/assets/nothing", "/?token=x"):
        _, headers, _ = browser.ask(where)
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Access-Control-Allow-Origin"] is None
        assert headers["Server"] is None


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1", "", "127.0.0.1:1", "[::1]:80"]
)
def test_another_name_for_this_machine_is_refused(browser: Browser, host: str) -> None:
    """A page of another site can let its own name point here (DNS rebinding)."""
    assert browser.ask("/api/state", Host=host)[0] == 403
    assert browser.ask("/api/state", Host="LOCALHOST:" + browser.host.partition(":")[2])[0] == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://{}", "http://{}.evil.example", "http://a@b"]
)
def test_other_pages_can_neither_read_nor_write(browser: Browser, origin: str) -> None:
    origin = origin.format(browser.host)
    assert browser.ask("/api/state", Origin=origin)[0] == 403
    assert browser.post("text", {"version": 1, "text": ""}, Origin=origin)[0] == 403


def test_a_write_has_a_header_that_no_form_sends(browser: Browser, path: Path) -> None:
    body = {"version": 1, "text": "evil"}
    assert browser.post("text", body, X_Fsoe_Net=None)[0] == 403
    assert browser.post("text", body, X_Fsoe_Net="2")[0] == 403
    assert browser.post("text", body, Origin=None)[0] == 403
    browser.cookie = ""
    assert browser.post("text", body)[0] == 403
    assert "evil" not in path.read_text("utf-8")


def test_too_long_input_is_rejected_before_it_is_read(browser: Browser) -> None:
    status, answer = browser.post("text", {"version": 1, "text": "#" * (MAX_TEXT_BYTES + 1)})
    assert status == 422
    assert "more than 4 MiB" in str(answer["error"])
    status, answer = browser.post("text", {"version": 1, "text": "#" * 10_000_000})
    assert status == 413
    own = {"Origin": f"http://{browser.host}", "X_Fsoe_Net": "1"}
    for length in ("-1", "1e9", ""):
        assert browser.ask("/api/undo", "POST", **own, Content_Length=length)[0] in (400, 413)
    assert browser.ask("/api/state")[0] == 200


def test_odd_requests_are_answered(browser: Browser) -> None:
    own = {"Origin": f"http://{browser.host}", "X_Fsoe_Net": "1"}
    deep = b"[" * 100_000
    for body in (b"", b"{", b"\xff", b"[]", b"1", b'{"version": "1"}', b"{}", deep):
        assert browser.ask("/api/undo", "POST", body, **own)[0] == 400
    assert browser.post("erase", {"version": 1})[0] == 404
    assert browser.post("text", {"version": 1, "text": "\ud800"})[0] == 422
    for act in ("text", "fix", "change"):
        assert browser.post(act, {"version": 1})[0] == 422
    assert browser.ask("/assets/../server.py")[0] in (404, 403)
    assert browser.ask("/assets/%2e%2e/server.py")[0] == 404
    assert browser.ask("/api/state", "DELETE", **own, Content_Length="0")[0] == 405


def test_a_change_is_answered_with_what_is_there_then(browser: Browser, path: Path) -> None:
    change = {"change": "set", "connection": 0, "key": "watchdog_ms", "value": 150}
    status, state = browser.post("change", {"version": 1, **change})
    assert status == 200
    assert state["error"] == ""
    assert state["saved"] is False
    status, late = browser.post("undo", {"version": 1})
    assert status == 409
    assert late["version"] == state["version"]
    assert "look at it, and do it again" in late["error"]
    status, saved = browser.post("save", {"version": state["version"]})
    assert status == 200
    assert saved["saved"] is True
    assert "watchdog_ms: 150" in path.read_text("utf-8")


def test_it_is_tried_on_the_emulated_bus(browser: Browser) -> None:
    status, tried = browser.post("try", {})
    assert status == 200
    (row,) = tried["connections"]
    assert (row["name"], row["in_data"], row["resets"]) == ("el1918-ek1914", True, 0)
    assert tried["passed"] is True
    assert {e["text"] for e in tried["events"]} >= {"MainInstance: Session"}
    browser.post("text", {"version": 1, "text": "nets: ["})
    status, refused = browser.post("try", {})
    assert status == 422
    assert str(refused["error"]).startswith("not tried: 1 error")


def test_a_second_tab_hears_of_a_change(browser: Browser) -> None:
    with browser.events() as stream:
        _until(stream, b"data: 1")
        browser.post("text", {"version": 1, "text": "x"})
        _until(stream, b"data: 2")


def _until(stream, text: bytes) -> None:
    for line in stream:
        if line.strip() == text:
            return
    pytest.fail(f"the stream ended before {text!r}")


def test_pages_that_come_and_go_do_not_block_others(
    browser: Browser, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server_module, "_EVENTS_S", 0.001)
    over = threading.Event()

    def come_and_go() -> None:
        while not over.is_set():
            with browser.events() as stream:
                assert stream.readline() == b"data: 1\n"

    version = browser.json("/api/state")["version"]
    with ThreadPoolExecutor(6) as pool:
        pages = [pool.submit(come_and_go) for _ in range(6)]
        try:
            for _ in range(100):
                status, answer = browser.post("undo", {"version": version})
                assert status == 200, answer
        finally:
            over.set()
        for page in pages:
            page.result()


def test_names_from_files_are_text(tmp_path: Path) -> None:
    path = tmp_path / "network.yaml"
    path.write_text("version: 1\nname: '<script>alert(1)</script>'\nsubdevices: \x1b[2J\n", "utf-8")
    with running(path) as studio:
        browser = Browser(studio.url)
        browser.enter()
        _, headers, body = browser.ask("/api/state")
    assert headers["Content-Type"] == "application/json"
    assert b"\\u001b" in body
    assert b"\x1b" not in body


def test_a_port_that_is_taken_is_named(path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(EnvironmentFault, match=f"port {port} .* give another --port"):
            Studio(Workspace(str(path)), port=port)


def test_the_first_page_asks_for_all_its_modules_at_once() -> None:
    """One round after the other would add up; views that nobody looks at come later."""
    assets = Path(workspace_module.__file__).parent / "assets"
    needed: set[str] = set()
    left = {"app.js"}
    while left:
        name = left.pop()
        needed.add(name)
        folder = name.rpartition("/")[0]
        text = (assets / name).read_text("utf-8")
        found = re.findall(r'^import [^;]*?from\s*"\./([^"]+)"', text, re.MULTILINE)
        left |= {f"{folder}/{n}" if folder else n for n in found} - needed
    page = (assets / "index.html").read_text("utf-8")
    assert set(re.findall(r'modulepreload" href="/assets/([^"]+)"', page)) == needed - {"app.js"}
    assert not {name for name in needed if name.startswith("live")}
