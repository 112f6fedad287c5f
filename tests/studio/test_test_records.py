"""What is entered into a test record is in its file, and nothing that was there is lost."""

from __future__ import annotations

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import yaml
from report.made import BASE
from studio.server_rig import Browser, running

from fsoe_net.errors import InputError
from fsoe_net.test_record.entries import Conflict, MachineEntry, enter, step_fields
from fsoe_net.test_record.trial import Trial, read_test_record

EMPTY = {"result": "", "measured_ms": "", "remark": "", "by": "", "date": ""}
DONE = EMPTY | {"result": "as expected", "by": "A. Person", "date": "2026-11-21"}
TRIGGER = "trigger estop"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    shutil.copytree(BASE / "devices", folder / "devices")
    shutil.copy(BASE / "timed.yaml", folder / "network.yaml")
    Trial.of([str(folder / "network.yaml")]).save(str(folder / "test-record.yaml"))
    return folder


@pytest.fixture
def network(made: Path, tmp_path: Path) -> Path:
    """Return a network without a test record."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    (tmp_path / "test-record.yaml").unlink()
    return tmp_path / "network.yaml"


@pytest.fixture
def path(made: Path, network: Path) -> str:
    """Return the test record of that network."""
    return str(shutil.copy(made / "test-record.yaml", network.parent))


def _fields(path: str, step: str = TRIGGER) -> dict[str, str]:
    return next(step_fields(s) for s in read_test_record(path)[1].steps if s.id == step)


def test_an_entry_is_written_once_and_the_rest_stays(path: str) -> None:
    before = read_test_record(path)[1]
    Path(path).write_text("# of hall 3\n" + Path(path).read_text("utf-8"), "utf-8")
    now = DONE | {"measured_ms": "61,5", "remark": "scope,\n contact  of K1"}
    entry = MachineEntry(step=TRIGGER, before=EMPTY, now=now)
    written = enter(path, entry)
    assert written == now | {"measured_ms": "61.5", "remark": "scope, contact of K1"}
    assert _fields(path) == written
    text = Path(path).read_bytes()
    assert text.startswith(b"# of hall 3\n# Test record.")
    assert b"measured_ms: 61.5\n" in text
    assert enter(path, entry) == written  # its answer was lost, and it comes again
    assert Path(path).read_bytes() == text
    after = read_test_record(path)[1]
    assert [s.id for s in after.steps] == [s.id for s in before.steps]
    assert [s for s in after.steps if s.machine.filled] == [s for s in after.steps if s.is_done]
    assert enter(path, MachineEntry(step="loss io", before=EMPTY, now=DONE)) == DONE
    assert _fields(path) == written


def test_a_correction_keeps_what_was_there(path: str) -> None:
    first = enter(path, MachineEntry(step=TRIGGER, before=EMPTY, now=DONE | {"remark": "K1"}))
    late = first | {"result": "not as expected", "measured_ms": "900", "remark": "K1 sticks"}
    second = enter(path, MachineEntry(step=TRIGGER, before=first, now=late))
    assert second["remark"] == "K1 sticks; before: as expected, A. Person, 2026-11-21"
    assert enter(path, MachineEntry(step=TRIGGER, before=first, now=late)) == second
    third = enter(path, MachineEntry(step=TRIGGER, before=second, now=DONE))
    assert third["remark"] == (
        "before: not as expected, 900 ms, K1 sticks; before: as expected, A. Person, 2026-11-21, "
        "A. Person, 2026-11-21"
    )
    assert enter(path, MachineEntry(step=TRIGGER, before=third, now=third)) == third


def test_an_entry_based_on_an_older_state_changes_nothing(path: str) -> None:
    enter(path, MachineEntry(step=TRIGGER, before=EMPTY, now=DONE))
    text = Path(path).read_bytes()
    with pytest.raises(Conflict) as caught:
        enter(path, MachineEntry(step=TRIGGER, before=EMPTY, now=DONE | {"by": "B. Other"}))
    assert caught.value.present == DONE
    assert Path(path).read_bytes() == text


def test_readings_of_a_subdevice_are_entered(path: str) -> None:
    blank = {"firmware": "", "serial": "", "safety_project_crc": ""}
    now = {"firmware": "07", "serial": "not applicable: worn", "safety_project_crc": "0x8F1C"}
    assert enter(path, MachineEntry(subdevice="logic", before=blank, now=now)) == now
    assert enter(path, MachineEntry(subdevice="io", before=blank, now=now)) == {
        key: now[key] for key in ("firmware", "serial")
    }
    rows = {d.subdevice: d for d in read_test_record(path)[1].devices}
    assert (rows["logic"].firmware, rows["logic"].safety_project_crc) == ("07", "0x8F1C")
    assert rows["io"].safety_project_crc is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"result": "good"}, "result is one of as expected, not as expected, not run"),
        ({"measured_ms": "soon"}, "'soon' is not a time in ms"),
        ({"measured_ms": "1e999"}, "not entered: "),
        ({"measured_ms": "-1"}, "not entered: "),
        ({"measured_ms": "900"}, "900 ms is longer than the limit"),
        ({"date": "21.11.2026"}, "is not a date; write year, month and day"),
        ({"by": "x" * 5000}, "by is longer than 4000 characters"),
        ({"remark": "a\u202eb"}, "does not print"),
    ],
)
def test_an_entry_that_the_file_cannot_hold_is_rejected(
    path: str, wrong: dict[str, str], said: str
) -> None:
    text = Path(path).read_bytes()
    with pytest.raises(InputError) as caught:
        enter(path, MachineEntry(step=TRIGGER, before=EMPTY, now=DONE | wrong))
    assert said in str(caught.value)
    assert Path(path).read_bytes() == text


def test_only_steps_of_the_test_record_are_entered(path: str) -> None:
    for step in ("no such", "fault bit flip", ""):
        with pytest.raises(InputError, match="no such step"):
            enter(path, MachineEntry(step=step, before=EMPTY, now=DONE))
    document = yaml.safe_load(Path(path).read_text("utf-8"))
    for row in document["steps"]:
        row.pop("machine", None)
    Path(path).write_text(yaml.safe_dump(document), "utf-8")
    assert enter(path, MachineEntry(step=TRIGGER, before=EMPTY, now=DONE)) == DONE
    Path(path).write_text("version: 1\n", "utf-8")
    with pytest.raises(InputError, match="not entered"):
        enter(path, MachineEntry(step=TRIGGER, before=EMPTY, now=DONE))


def _sent(state: dict[str, Any], **more: object) -> dict[str, object]:
    sent = {"file": state["number"], "key": state["key"], "step": TRIGGER, "subdevice": ""}
    return sent | {"before": EMPTY, "now": DONE} | more


def test_the_page_makes_shows_and_fills_a_test_record(network: Path) -> None:
    with running(network) as studio:
        browser = Browser(studio.url)
        browser.enter()
        assert browser.get("test-record")[1]["number"] is None
        _, text = browser.get("state")
        changed = {"version": text["version"], "text": f"{text['text']}# more\n"}
        _, changed = browser.post("text", changed)
        status, answer = browser.post("test-record/new", {})
        assert (status, "save the network first" in str(answer["error"])) == (422, True)
        browser.post("save", {"version": changed["version"]})
        status, state = browser.post("test-record/new", {})
        assert (status, state["error"], state["notes"]) == (200, "", [])
        assert {"trigger estop", "loss io"} <= {step["name"] for step in state["steps"]}
        assert all(not step["name"].startswith("fault") for step in state["steps"])
        assert {d["name"]: len(d["fields"]) for d in state["devices"]} == {
            "io": 2,
            "io2": 2,
            "logic": 3,
        }
        assert browser.post("test-record/new", {})[0] == 422
        status, answer = browser.post("test-record/enter", _sent(state))
        assert (status, answer["present"]) == (200, DONE)
        other = DONE | {"by": "B. Other"}
        status, answer = browser.post("test-record/enter", _sent(state, now=other))
        assert (status, answer["present"]) == (409, DONE)
        (step,) = (s for s in browser.get("test-record")[1]["steps"] if s["name"] == TRIGGER)
        assert (step["is_open"], step["is_failed"], step["fields"]) == (False, False, DONE)
        for wrong in ({"file": 99}, {"key": "x"}, {"step": 1}, {"before": []}, {"now": {"by": 1}}):
            assert browser.post("test-record/enter", _sent(state, **wrong))[0] == 422
        assert browser.post("test-record/enter", [])[0] == 400
        own = {"Origin": f"http://{browser.host}", "X_Fsoe_Net": "1"}
        assert browser.ask("/api/test-record/enter", "POST", b"{", **own)[0] == 400
        browser.post("text", {"version": changed["version"] + 1, "text": "nets: ["})
        assert browser.get("test-record?file=7")[1]["notes"] == []  # nothing to compare it with


def test_a_test_record_of_another_configuration_is_reported(network: Path, path: str) -> None:
    Path(path).write_text(
        Path(path)
        .read_text("utf-8")
        .replace(
            "emulated: null",
            ("emulated: {result: as expected, measured_ms: 5.0, time_is: to, remark: x}"),
        ),
        "utf-8",
    )
    network.write_text(network.read_text("utf-8").replace("watchdog_ms: 100", "watchdog_ms: 90"))
    with running(network) as studio:
        browser = Browser(studio.url)
        browser.enter()
        _, state = browser.get("test-record")
    assert "made for another configuration" in state["notes"][0]
    assert state["steps"][0]["emulated"] == "as expected, 5 ms to, x"
    assert "no evidence" in state["note"] or "not evidence" in state["note"]


def test_many_at_once_lose_nothing(network: Path, path: str) -> None:
    with running(network) as studio:
        browser = Browser(studio.url)
        browser.enter()
        _, state = browser.get("test-record")
        names = [step["name"] for step in state["steps"]][:4]
        with ThreadPoolExecutor(4) as pool:
            sent = (_sent(state, step=name) for name in names)
            found = list(pool.map(lambda body: browser.post("test-record/enter", body)[0], sent))
    assert found == [200] * len(names)
    assert all(_fields(path, name) == DONE for name in names)
