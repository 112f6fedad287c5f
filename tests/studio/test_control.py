"""Control of a bus from the page, without a browser: who may, how long, what is written down."""

from __future__ import annotations

import json
import os
import pwd
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from master.rig import Master
from master.rig import running as master_running
from studio.server_rig import Browser, running
from tied import tied

from fsoe_net.cli.main import cli
from fsoe_net.errors import InputError
from fsoe_net.studio import live_control
from fsoe_net.testing.fake_master import FakeMaster

LAMP = "el2904.standard_1"
START = "el6910.logic_control"  # restart relevant, stop value 0
ACTS = (
    *("take-control", "keep-control", "set-output", "arm-output"),
    *("start-bus", "stop-bus", "restart-bus", "give-control"),
)


class Controlling:
    """A page that has control."""

    def __init__(self, browser: Browser) -> None:
        self.browser = browser
        status, answer = browser.post("live/take-control", {})
        assert status == 200, answer
        self.answer: dict[str, Any] = answer

    def ask(self, act: str, **body: object) -> tuple[int, dict[str, Any]]:
        return self.browser.post(f"live/{act}", {"token": self.answer["token"], **body})

    def good(self, act: str, **body: object) -> dict[str, Any]:
        status, answer = self.ask(act, **body)
        assert status == 200, answer
        return answer

    def refused(self, act: str, **body: object) -> str:
        status, answer = self.ask(act, **body)
        assert status == 422, answer
        return str(answer["error"])

    def outputs(self) -> dict[str, dict[str, Any]]:
        return {row["name"]: row for row in self.good("keep-control")["outputs"]}

    def until(self, holds: Callable[[dict[str, dict[str, Any]]], object]) -> None:
        while not holds(self.outputs()):
            pass


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("log")


@pytest.fixture(scope="module")
def master(log: Path) -> Iterator[Master]:
    with master_running("--intervention-log", str(log)) as master:
        yield master


@pytest.fixture(scope="module")
def browser(master: Master, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    path = tmp_path_factory.mktemp("control") / "network.yaml"
    with running(path, master.path, allow_control=True) as studio:
        browser = Browser(studio.url)
        browser.enter()
        yield browser


@pytest.fixture
def page(browser: Browser, monkeypatch: pytest.MonkeyPatch) -> Iterator[Controlling]:
    """With the longest lease: a busy machine loses no control."""
    monkeypatch.setattr(live_control, "LEASE_MS", 600_000)
    page = Controlling(browser)
    yield page
    page.ask("give-control")


def entries(log: Path, *, until: tuple[str, str]) -> list[dict[str, Any]]:
    """Return what is in the intervention log once it has an entry: a thread writes it."""
    while True:
        lines = [x for path in sorted(log.iterdir()) for x in path.read_bytes().splitlines(True)]
        found = [json.loads(line) for line in lines if line.endswith(b"\n")]
        if any(row.get(until[0]) == until[1] for row in found):
            return found


def test_each_act_is_an_event_of_the_page_and_an_entry_of_the_log(
    page: Controlling, master: Master, log: Path
) -> None:
    assert page.answer["access"] == "maintainer"
    with page.browser.events("/api/live/stream?source=master") as stream:
        texts: list[str] = []

        def until(state: str, said: str = "") -> dict[str, Any]:
            for line in stream:
                if line.startswith(b"data: "):
                    picture = json.loads(line[6:])
                    texts.extend(f"{e['source']}: {e['text']}" for e in picture["events"])
                    if picture["state"] == state and (not said or said in texts):
                        return picture
            pytest.fail("the stream ended")

        assert until("running")["control"] == page.answer["turn"]
        rows = page.outputs()
        assert (rows[LAMP]["kind"], rows[LAMP]["value"], rows[LAMP]["mine"]) == ("bool", "0", False)
        assert rows[START]["restart_relevant"]
        assert not any("FSoE" in name for name in rows)
        page.good("set-output", name=LAMP, value=" 1 ")
        page.until(lambda rows: rows[LAMP]["value"] == "1" and rows[LAMP]["mine"])
        page.good("arm-output", name=START, value="0x1")
        page.until(lambda rows: rows[START]["value"] == "1")
        page.good("stop-bus")
        until("stopped")
        assert page.outputs() == {}
        assert "the bus is stopped" in page.refused("set-output", name=LAMP, value="1")
        page.good("start-bus")
        until("running")
        assert page.outputs()[LAMP]["value"] == "0"
        page.good("restart-bus")
        with master.client() as client:
            while client.good("status")["state"] != "running":
                pass
        page.good("give-control")
        until("running", "page: gives control back")
    said = [text.removeprefix("page: ") for text in texts if text.startswith("page: ")]
    assert said[-7:] == [
        "takes control",
        f"sets {LAMP} to 1",
        f"arms {START} and sets it to 1",
        "requests stop of the bus",
        "requests start of the bus",
        "requests restart of the bus",
        "gives control back",
    ]
    assert any("requests stop" in text for text in texts if text.startswith("fsn-master: "))
    found = entries(log, until=("request", "restart"))
    (me,) = (row["client"] for row in found if row.get("request") == "restart")
    mine = [row for row in found if row.get("client") == me]
    assert [(row["event"], row.get("request")) for row in mine] == [
        ("taken", None),
        ("arm", None),
        ("taken", None),
        ("edge", None),
        ("request", "stop"),
        ("request", "set"),  # refused
        ("request", "start"),
        ("request", "restart"),
    ]
    assert {row["user"] for row in mine} == {pwd.getpwuid(os.getuid()).pw_name}
    assert mine[0]["outputs"] == {LAMP: 1}
    assert mine[5]["error"] == "FSN_E_STATE"
    after = found[found.index(mine[4]) :]
    fallen = next(row for row in after if row["event"] == "fallback")
    assert (fallen["why"], sorted(fallen["outputs"])) == ("stop", [LAMP, START])


def test_an_output_that_can_restart_a_machine_stays_armed_by_nothing(
    page: Controlling, master: Master
) -> None:
    with master.client() as watch:
        watch.good("events on")
        assert "not armed" in page.refused("set-output", name=START, value="1")
        for value in ("256", "-1", "x", "1.5"):
            text = page.refused("arm-output", name=START, value=value)
            assert text == f"{START} takes a whole number from 0 to 255"
        page.good("arm-output", name=START, value="0")  # its stop value needs no arming
        page.good("arm-output", name=START, value="3")
        page.good("arm-output", name=START, value="3")  # no change
        assert "armed for each change" in page.refused("set-output", name=START, value="4")
        page.good("arm-output", name=START, value="0")
        page.good("stop-bus")  # it falls back
        while watch.event("state")["state"] != "stopped":
            pass
        page.good("start-bus")
        while watch.event("state")["state"] != "running":
            pass
        page.good("arm-output", name=START, value="3")
        for name in (LAMP, "nothing"):
            text = page.refused("arm-output", name=name, value="1")
            assert text == f"{name!r} is not an output that is armed"
        page.good("give-control")
        whys = [watch.event("fallback")["why"] for _ in range(2)]
        assert whys == ["stop", "disconnected"]
        raws = [event["raw"] for event in watch.events if event["event"] in ("arm", "edge")]
        assert raws == [0, 3, 0, 0, 3]  # armed twice, raw 0; each change away used it up


def test_fsoe_frames_and_safety_objects_are_out_of_reach(page: Controlling) -> None:
    for name in ("el2904.0x7000:01", "el6910.0x7000:01", "el2904.safety_output"):
        assert name not in page.outputs()
        text = page.refused("set-output", name=name, value="1")
        assert f"no input or output is called {name}" in text
    for act in ("sdo-write", "alias-write", "shutdown"):
        assert page.ask(act, name="el2904", value="0xF980 1 uint16 7")[0] == 404


def test_one_page_has_control(browser: Browser, page: Controlling) -> None:
    status, answer = browser.post("live/take-control", {})
    assert status == 422
    assert str(answer["error"]).startswith("another page has control")
    for token in (None, "", "x", "\ud800", 7):
        status, answer = browser.post("live/set-output", {"token": token})
        assert (status, "does not have control" in str(answer["error"])) == (422, True)
    for body in ({}, {"name": 1, "value": "1"}, {"name": LAMP, "value": 1}):
        assert page.refused("set-output", **body) == "name and value are texts"
    for name, value in (
        (LAMP, " "),
        (LAMP, "1\nstop"),
        (LAMP, f"1={LAMP}"),
        ("a\nb", "1"),
        (LAMP, "\x01"),
    ):
        assert page.refused("set-output", name=name, value=value).startswith("give a value as one")
    page.good("give-control")
    Controlling(browser).good("give-control")  # free for the next one


def test_a_silent_page_loses_control_and_its_outputs_fall_back(
    browser: Browser, master: Master, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_control, "LEASE_MS", 500)
    with master.client() as watch:
        watch.good("events on")
        while True:  # on a busy machine the lease can end before the first value
            page = Controlling(browser)
            if page.ask("set-output", name=LAMP, value="1")[0] == 200:
                break
        fallen = watch.event("fallback")
        assert (fallen["why"], fallen["outputs"]) == ("silent", [LAMP])
    assert "hidden or silent for 0.5 s, and what it had set took" in page.refused("keep-control")
    assert "does not have control" in page.refused("keep-control")
    page = Controlling(browser)  # free again
    assert page.answer["lease_ms"] == 500


def test_without_the_option_every_act_is_refused(master: Master, tmp_path: Path) -> None:
    with running(tmp_path / "network.yaml", master.path) as studio:
        browser = Browser(studio.url)
        browser.enter()
        assert browser.json("/api/state")["may_control"] is False
        for act in ACTS:
            assert browser.post(f"live/{act}", {"token": "", "name": LAMP, "value": "1"})[0] == 422
        assert "only reads the bus" in str(browser.post("live/take-control", {})[1]["error"])
        with browser.events("/api/live/stream?source=master") as stream:
            line = next(line for line in stream if line.startswith(b"data: "))
        assert json.loads(line[6:])["control"] is None


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[FakeMaster, Browser]]:
    monkeypatch.setattr(live_control, "LEASE_MS", 600_000)
    with (
        FakeMaster() as fake,
        running(tmp_path / "network.yaml", fake.path, allow_control=True) as studio,
    ):
        browser = Browser(studio.url)
        browser.enter()
        yield fake, browser


def test_a_role_that_may_not_is_refused_in_words(fake: tuple[FakeMaster, Browser]) -> None:
    master, browser = fake
    master.access = "observer"
    status, answer = browser.post("live/take-control", {})
    assert status == 422
    assert "your role at this fsn-master is observer, which only reads" in str(answer["error"])
    master.access = "operator"
    master.refuse["stop"] = {"error": "FSN_E_CLOSED", "text": "only for maintainers"}
    page = Controlling(browser)
    assert page.answer["access"] == "operator"
    assert "only for maintainers" in page.refused("stop-bus")
    master.outputs["drive_1.position"] = None  # a real that is no number
    assert page.outputs()["drive_1.position"]["value"] == "not a number"
    taken = next(row for row in master.symbols if row["name"] == "drive_2.0x6040:00")
    taken["open"] = False  # a safety connection or a transfer writes it
    assert set(page.outputs()) == set(master.outputs) - {taken["name"]}
    master.refuse["get"] = {"error": "FSN_E_BUSY", "text": "no stable picture of a cycle"}
    answer = page.good("keep-control")
    assert (answer["outputs"], answer["why"]) == ([], "get: no stable picture of a cycle")


def test_control_ends_with_the_connection_and_with_a_refusal_after_arming(
    fake: tuple[FakeMaster, Browser],
) -> None:
    master, browser = fake
    row = next(row for row in master.symbols if row["name"] == "drive_1.position")
    row["restart_relevant"] = True
    page = Controlling(browser)
    assert "from -2147483648 to 2147483647" in page.refused(
        "arm-output", name=row["name"], value="-2147483649"
    )
    page.good("arm-output", name=row["name"], value="-5")
    assert master.asked[-2:] == [f"arm {row['name']}", f"set {row['name']}=-5"]
    master.refuse["set"] = {"error": "FSN_E_ARG", "text": "no"}
    assert "control has ended: nothing stays armed" in page.refused(
        "arm-output", name="logic.ack", value="1"
    )
    assert "does not have control" in page.refused("keep-control")
    page = Controlling(browser)
    master.drop()
    assert page.refused("keep-control").startswith("control has ended: ")
    master.refuse["lease"] = {"error": "FSN_E_BUSY", "text": "not now"}
    assert "not now" in str(browser.post("live/take-control", {})[1]["error"])
    master.close()
    assert "no answer" in str(browser.post("live/take-control", {})[1]["error"])


def test_control_ends_with_its_lease(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a page that has control, until its lease is over; each of its requests renews it."""
    now_s = 1000.0
    monkeypatch.setattr(live_control, "time", SimpleNamespace(monotonic=lambda: now_s))
    with FakeMaster() as master:
        control = live_control.LiveControl(str(master.path), lambda _text: None)
        assert control.turn == 0
        token = control.acts["take-control"]({})["token"]
        lease_s = live_control.LEASE_MS / 1000
        now_s += 0.9 * lease_s
        assert control.turn == 1
        control.acts["keep-control"]({"token": token})
        now_s += 0.9 * lease_s
        assert control.turn == 1
        with pytest.raises(InputError, match="another page has control"):
            control.acts["take-control"]({})
        now_s += 0.2 * lease_s
        assert control.turn == 0
        with pytest.raises(InputError, match="control has ended"):
            control.acts["keep-control"]({"token": token})
        assert control.acts["take-control"]({})["turn"] == 2
        control.close()


def test_the_option_needs_a_bus_and_one_person(tmp_path: Path) -> None:
    for given, said in (
        ([], "--allow-control needs --socket PATH or --interface IF"),
        (["--socket", "s", "--listen", "::1"], "the intervention log could not name the person"),
    ):
        done = CliRunner().invoke(cli, ["studio", "--allow-control", *given])
        assert (done.exit_code, said in done.output) == (2, True)
    command = tied(sys.executable, "-m", "fsoe_net.cli", "studio", "--no-browser")
    command += ["--socket", "s", "--allow-control"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        lines = [process.stdout.readline() for _ in range(3)]
        browser = Browser(lines[0].split()[-1].partition("#")[0])
        browser.enter()
        state = browser.json("/api/state")
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert lines[2].endswith("start and stop the bus at s, and set outputs: no emergency stop\n")
    assert state["may_control"] is True
