"""The live page without a browser: an emulated run, a real fsn-master, a recorded run."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from master.rig import running as master_running
from studio.server_rig import Browser, running

EXAMPLES = Path(__file__).parents[2] / "examples"
CONNECTION = "el1918-ek1914"
INPUTS = ("ek1914.0x6001:01", "ek1914.0x6001:02")

Picture = dict[str, Any]


class Page:
    """What a page does with a stream of pictures: it keeps the events, and looks."""

    def __init__(self, lines: Iterator[bytes]) -> None:
        self._lines = lines
        self.events: list[dict[str, Any]] = []
        self.rows: list[list[float | None]] = []

    def picture(self) -> Picture:
        """Return the next picture."""
        for line in self._lines:
            if line.startswith(b"data: "):
                found: Picture = json.loads(line[6:])
                assert found["first"] == len(self.events) or not found["events"]
                self.events += found["events"]
                self.rows += found["scope"]["rows"]
                return found
        pytest.fail("the stream ended")

    def rest(self) -> list[bytes]:
        """Return what still comes, until the stream ends."""
        return list(self._lines)

    def until(self, holds: Callable[[Picture], object]) -> Picture:
        """Wait for a picture."""
        while not holds(found := self.picture()):
            pass
        return found

    def texts(self, source: str) -> list[str]:
        return [e["text"] for e in self.events if e["source"] == source]


@contextmanager
def following(browser: Browser, source: str) -> Iterator[Page]:
    with browser.events(f"/api/live/stream?source={source}") as lines:
        yield Page(lines)


def outputs_on(picture: Picture) -> bool:
    (logic,) = picture["machine"]["logics"]
    return bool(logic["on"])


def state(picture: Picture) -> str:
    return str(picture["connections"][0]["state"])


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    folder = tmp_path_factory.mktemp("live")
    shutil.copytree(EXAMPLES / "estop", folder / "estop")
    with running(folder / "estop" / "network.yaml") as studio:
        browser = Browser(studio.url)
        browser.enter()
        yield browser


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An emulated run, in Data with outputs on."""
    status, answer = browser.post("live/start", {})
    assert (status, answer["error"]) == (200, "")
    with following(browser, "emulated") as page:
        page.until(outputs_on)
        yield page


def order(browser: Browser, *lines: str) -> None:
    status, answer = browser.post("live/command", {"lines": lines})
    assert (status, answer["error"]) == (200, "")


def test_a_page_without_a_run_is_reported_what_to_do(browser: Browser) -> None:
    assert json.loads(browser.ask("/api/live")[2])["run"] is None
    for path in ("stream", "signals", "machine", "document"):
        status, _, body = browser.ask(f"/api/live/{path}?source=emulated")
        assert status == 422
        assert b"start a run, or name a bus with --socket" in body
    for act, body in (
        ("command", {"lines": ["press"]}),
        ("hold", {"ms": 50}),
        ("cable", {"number": 0, "whole": False}),
        ("scope", {"signals": []}),
    ):
        status, answer = browser.post(f"live/{act}", body)
        assert status == 422, answer
    assert browser.post("live/end", {}) == (200, {"error": ""})


def test_a_run_comes_up_and_the_e_stop_is_pressed(browser: Browser, page: Page) -> None:
    first = page.picture()
    (row,) = first["connections"]
    assert (row["name"], row["state"], row["resets"]) == (CONNECTION, "Data · ProcessData", 0)
    assert row["watchdog_ms"] == 100
    assert 0 < row["share"] < 1
    assert [s["al"] for s in first["subdevices"]] == ["OP", "OP"]
    assert first["statistics"]["actual_wkc"] == first["statistics"]["expected_wkc"] > 0
    wire = [t for t in page.texts(CONNECTION) if t.startswith("wire: ")]
    states = ("Session", "Connection", "Parameter", "Data · FailSafeData")
    assert [t for t in wire if t[6:] in states] == [f"wire: {s}" for s in states]
    assert {e["end"] for e in page.events} == {"", "main", "sub", "wire"}
    order(browser, *(f"set {name} 0" for name in INPUTS))
    page.until(lambda p: not outputs_on(p))
    assert page.texts("command") == [f"set {name} = 0" for name in INPUTS]
    order(browser, "press", "release")
    order(browser, *(f"set {name} 1" for name in INPUTS))
    released = page.picture()
    assert not outputs_on(released)  # pressed before: does not count
    # Reset counts where the logic has every input already.
    later = page.until(lambda p: p["now_ms"] > released["now_ms"] + 100)
    assert not outputs_on(later)
    order(browser, "press", "release")
    page.until(outputs_on)


def test_a_pulled_subdevice_resets_its_connection_and_it_comes_back(
    browser: Browser, page: Page
) -> None:
    order(browser, "break ek1914")
    gone = page.until(lambda p: p["connections"][0]["resets"])
    assert gone["connections"][0]["cause"] == "watchdog expired"
    assert [s["al"] for s in gone["subdevices"]] == ["none", "OP"]
    resets = [e for e in page.events if e["kind"] == "reset"]
    assert resets[-1]["text"].endswith("resets: watchdog expired")
    order(browser, "heal ek1914")
    back = page.until(lambda p: p["connections"][0]["in_data"])
    assert back["subdevices"][0]["returns"] == 1


def test_a_cut_cable_separates_what_is_after_it_until_it_is_repaired(
    browser: Browser, page: Page
) -> None:
    def cable(whole: bool) -> None:
        assert browser.post("live/cable", {"number": 1, "whole": whole}) == (200, {"error": ""})

    cable(False)
    cut = page.until(lambda p: p["connections"][0]["resets"])
    assert (cut["machine"]["cut"], cut["machine"]["separated"]) == ([1], ["el1918"])
    assert [s["al"] for s in cut["subdevices"]] == ["OP", "none"]
    order(browser, "heal el1918")  # nothing returns through a cut cable
    assert page.picture()["subdevices"][1]["al"] == "none"
    cable(True)
    back = page.until(lambda p: p["connections"][0]["in_data"])
    assert (back["machine"]["cut"], back["machine"]["separated"]) == ([], [])
    ends = "cable between ek1914 and el1918"
    assert page.texts("bus") == [f"{ends} cut", f"{ends} repaired"]


def test_frames_are_held_on_both_sides_of_the_watchdog(browser: Browser, page: Page) -> None:
    """Simulated time: how busy this machine is changes nothing."""
    assert browser.post("live/hold", {"ms": 50}) == (200, {"error": ""})
    held = page.until(lambda p: p["connections"][0]["max_ms"] > 50)
    assert page.texts("bus") == ["no frames for 50 ms"]
    (row,) = page.until(lambda p: p["now_ms"] > held["now_ms"] + 200)["connections"]
    assert (row["resets"], row["state"]) == (0, "Data · ProcessData")
    assert row["max_ms"] < row["watchdog_ms"] == 100
    assert browser.post("live/hold", {"ms": 150}) == (200, {"error": ""})
    gone = page.until(lambda p: p["connections"][0]["resets"])
    assert gone["connections"][0]["cause"] == "watchdog expired"
    (begin,) = [e for e in page.events if e["text"] == "no frames for 150 ms"]
    page.until(lambda p: p["connections"][0]["in_data"])
    later = [e for e in page.events if e["time_ms"] > begin["time_ms"]]
    first = next(e for e in later if e["kind"] == "reset")
    assert 50 < first["time_ms"] - begin["time_ms"] <= 110
    wire = [e for e in later if e["end"] == "wire"]
    assert wire[0]["time_ms"] >= begin["time_ms"] + 150  # nothing was on the wire meanwhile
    for ms in (None, 0, 10_001, 1.5, True, "50"):
        status, answer = browser.post("live/hold", {"ms": ms})
        assert (status, "for 1 to 10000 ms" in str(answer["error"])) == (422, True)


def test_the_scope_has_every_cycle(browser: Browser, page: Page) -> None:
    scope = page.picture()["scope"]
    assert scope["signals"][:2] == list(INPUTS)
    times = [row[0] for row in page.rows]
    assert times == [round(times[0] + n, 3) for n in range(len(times))]  # 1 ms each, from the begin
    signals = json.loads(browser.ask("/api/live/signals?source=emulated")[2])["signals"]
    assert {s["kind"] for s in signals} >= {"safe input", "safe output"}
    status, refused = browser.post("live/scope", {"source": "emulated", "signals": ["ek1914.no"]})
    assert (status, "unknown signal 'ek1914.no'" in str(refused["error"])) == (422, True)
    many = [s["name"] for s in signals] * 20
    status, refused = browser.post("live/scope", {"source": "emulated", "signals": many[:21]})
    assert (status, "at most 20 signals" in str(refused["error"])) == (422, True)
    browser.post("live/scope", {"source": "emulated", "signals": [INPUTS[1]]})
    changed = page.until(lambda p: p["scope"]["choice"] != scope["choice"])
    assert changed["scope"]["signals"] == [INPUTS[1]]
    page.rows.clear()
    order(browser, f"set {INPUTS[1]} 0")
    page.until(lambda _: any(row[1] == 0 for row in page.rows))
    assert len({len(row) for row in page.rows}) == 1


def test_a_recording_is_saved_and_opened_again(browser: Browser, page: Page) -> None:
    order(browser, f"local-reset {CONNECTION}")
    page.until(lambda p: p["connections"][0]["resets"] and p["connections"][0]["in_data"])
    for ended in (False, True):
        if ended:
            assert browser.post("live/end", {})[0] == 200
            last = page.until(lambda p: p["ended"])
            assert (last["state"], last["current"]) == ("ended", False)
            for act, sent in (("command", {"lines": ["press"]}), ("hold", {"ms": 50})):
                status, answer = browser.post(f"live/{act}", sent)
                assert (status, "the run has ended" in str(answer["error"])) == (422, True)
        _, headers, body = browser.ask("/api/live/document?source=emulated")
        assert headers["Content-Disposition"] == 'attachment; filename="emulated-run.json"'
        document = json.loads(body)
        assert (document["mode"], document["network"]) == ("live", "estop")
        status, answer = browser.post("live/open", {"text": body.decode()})
        assert status == 200
        view = answer["view"]
        assert isinstance(view, dict)
        assert [e for e in page.events if e not in view["events"]] == []
        assert view["connections"][0]["resets"] == 1
        assert [s["al"] for s in view["subdevices"]] == ["OP", "OP"]
        assert [(n["name"], n["kind"]) for n in view["picture"]["nodes"]] == [
            ("ek1914", "terminal"),
            ("el1918", "logic"),
        ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "text is missing"),
        ("{", "not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ('{"tool": "fsoe-net", "events": NaN}', "NaN is not a JSON number"),
        ("[]", "not a recorded run"),
        ('{"tool": "other"}', "not a recorded run"),
        ('{"tool": "fsoe-net", "events": [{"time_ms": "x"}]}', "--format json > run.json"),
        ('{"tool": "fsoe-net", "events": [], "subdevices": [1]}', "not a recorded run"),
    ],
)
def test_a_file_that_is_not_a_recorded_run_names_what_makes_one(
    browser: Browser, text: str | None, said: str
) -> None:
    status, answer = browser.post("live/open", {"text": text})
    assert status == 422
    assert said in str(answer["error"])


def test_odd_requests_are_answered(browser: Browser, page: Page) -> None:
    own = {"Origin": f"http://{browser.host}", "X_Fsoe_Net": "1"}
    assert browser.ask("/api/live/end", "POST", b"{", **own)[0] == 400
    assert browser.ask("/api/live/end", "POST", b"[]", **own)[0] == 400
    assert browser.post("live/nothing", {})[0] == 404
    for lines in (None, [], [1], ["press"] * 101):
        assert browser.post("live/command", {"lines": lines})[0] == 422
    assert browser.post("live/scope", {"source": "emulated", "signals": [1]})[0] == 422
    for number, whole in ((2, True), (-1, True), (True, True), ("0", True), (0, 1)):
        assert browser.post("live/cable", {"number": number, "whole": whole})[0] == 422
    for run, said in ((1, "run is true or false"), (True, "has no drive with controlword")):
        status, answer = browser.post("live/axes", {"run": run})
        assert (status, said in str(answer["error"])) == (422, True)
    for line, said in (
        ("explode", "unknown command 'explode'"),
        ("break me", "no SubDevice 'me'"),
        ("delay 5ms", "a run has none; use this scenario with fsoe-net emulate"),
    ):
        status, answer = browser.post("live/command", {"lines": [line]})
        assert status == 422
        assert said in str(answer["error"])
    with browser.events("/api/live/stream?source=emulated&since=x&run=y") as lines:
        assert Page(lines).picture()["first"] == 0


def test_a_page_that_comes_back_gets_what_it_lacks(browser: Browser, page: Page) -> None:
    known, run = len(page.events), page.picture()["run"]
    order(browser, "power-cycle ek1914")
    page.until(lambda p: p["connections"][0]["resets"] and p["connections"][0]["in_data"])
    with browser.events(f"/api/live/stream?source=emulated&since={known}&run={run}") as lines:
        second = Page(lines)
        second.events = page.events[:known]
        second.picture()
        assert second.events[: len(page.events)] == page.events
    browser.post("live/start", {})  # another run: the stream of the first ends
    page.rest()


def test_a_text_with_errors_starts_nothing(tmp_path: Path) -> None:
    (tmp_path / "network.yaml").write_text("nets: [")
    with running(tmp_path / "network.yaml") as studio:
        browser = Browser(studio.url)
        browser.enter()
        status, answer = browser.post("live/start", {})
    assert status == 422
    assert str(answer["error"]).startswith("nothing started: 1 error")


# -- a real fsn-master ----------------------------------------------------------------------------


def test_a_running_bus_is_followed_over_stop_kill_and_restart(tmp_path: Path) -> None:
    """The page is there first, and waits for fsn-master."""
    path = tmp_path / "s"
    with running(tmp_path / "network.yaml", path) as studio:
        browser = Browser(studio.url)
        browser.enter()
        status, _, body = browser.ask("/api/live/signals?source=master")
        assert (status, b"no answer" in body) == (422, True)
        with following(browser, "master") as page:
            away = page.picture()
            assert (away["state"], away["connections"]) == ("away", [])
            assert "no answer" in away["away"]
            with master_running() as master:
                os.symlink(master.path, path)
                up = page.until(lambda p: p["state"] == "running" and p["statistics"])
                assert up["connections"][0]["name"] == "el6910-el1904"
                assert "el2904" in [s["name"] for s in up["subdevices"]]
                picture = browser.get("live/machine?source=master")[1]["machine"]
                assert [(n["name"], n["kind"], n["parent"]) for n in picture["nodes"]] == [
                    ("el6910", "logic", None),
                    ("el1904", "terminal", 0),
                    ("el2904", "terminal", 1),
                    ("drive_1", "drive", 2),
                    ("drive_2", "drive", 3),
                ]
                assert up["machine"] is None  # nothing acts on a real bus
                assert "stops" not in picture
                names = ["el2904.standard_1"]
                assert browser.post("live/scope", {"source": "master", "signals": names})[0] == 200
                page.until(lambda _: len(page.rows) > 20)
                with master.client() as client:
                    client.good("stop")
                    page.until(lambda p: p["state"] == "stopped" and not p["current"])
                    client.good("start")
                page.until(lambda p: p["state"] == "running" and p["current"])
                document = json.loads(browser.ask("/api/live/document?source=master")[2])
                assert document["socket"] == str(path)
                text = json.dumps(document)
                assert browser.post("live/open", {"text": text})[0] == 200
                master.process.kill()
                gone = page.until(lambda p: p["away"])
                assert gone["connections"]  # what was seen stays
            path.unlink()
            with master_running() as master:
                os.symlink(master.path, path)
                page.until(lambda p: p["state"] == "running" and p["current"])
                with following(browser, "master") as second:
                    assert second.picture()["connections"]
        assert any("fsn-master answers again" in e["text"] for e in page.events)
