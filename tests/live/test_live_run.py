"""A live run against an ``fsn-master`` of a few lines: no bus, no luck with times."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from live.made_run import OPTIONS, PLAN, RESOLUTION, Process

from fsoe_net.errors import ControlRefused, EnvironmentFault, InputError
from fsoe_net.live import live_bus
from fsoe_net.live.client import Client
from fsoe_net.live.live_bus import BusOptions, run_on_bus
from fsoe_net.live.result import Run, RunUpdate
from fsoe_net.testing.fake_master import FakeMaster

AT_STATE = {"error": "FSN_E_STATE", "text": "the bus does not run"}


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch) -> Iterator[Process]:
    with FakeMaster() as fake:
        found = Process(fake)
        monkeypatch.setattr(live_bus, "Master", found)
        monkeypatch.setattr(live_bus, "_UPDATE_S", 0.01)
        yield found


def run(process: Process, updates: Any = None, **more: Any) -> Run:
    """Run; ``updates`` is called with the number of each update and the event that ends the run."""
    stop = threading.Event()
    seen: list[RunUpdate] = []

    def update(found: RunUpdate) -> None:
        seen.append(found)
        (updates or (lambda _n, stop: stop.set()))(len(seen), stop)

    return run_on_bus(RESOLUTION, PLAN, OPTIONS, None, on_update=update, stop=stop, **more)


def texts(result: Run) -> list[str]:
    return [e.text for e in result.events if e.source == "run"]


@pytest.mark.parametrize(
    ("options", "duration_ns", "words"),
    [
        ({}, None, ""),
        ({"redundant": "eth2", "cycle_ns": 500_000}, None, "--redundant eth2 --cycle 500000ns"),
        ({"priority": 80, "cpu": 3}, None, "--policy fifo --priority 80 --cpu 3"),
        ({"wait_s": 1.5, "incidents": "x"}, None, "--wait 1500ms --incidents x"),
        ({"intervention_log": "log"}, None, "--intervention-log log"),
        ({}, 2_000_000_000, "--duration 12000ms"),
    ],
)
def test_options_of_fsn_master(options: dict[str, Any], duration_ns: int | None, words: str):
    found = BusOptions(backend="igh", interface="0", **options).arguments(duration_ns)
    assert found == ["--bus", "igh", "--interface", "0", *words.split()]


def test_a_run_ends_when_it_is_interrupted(process: Process):
    started = []
    result = run(process, on_start=started.append)
    assert started == [process]
    assert process.words[-2:] == ["--accepted", hashlib.sha256(PLAN).hexdigest()]
    assert texts(result) == ["interrupted by the user"]
    assert result.passed
    assert [c.name for c in result.connections] == ["el1918-ek1914"]


def test_report_of_a_run(process: Process):
    """Its events stand in the order of their times, whenever they came."""

    def updates(number: int, stop: threading.Event) -> None:
        if number == 1:
            for n in (3, 2):
                process.fake.send_event(event="wkc", text=f"event {n}", now_ns=n)
        elif number == 5:
            stop.set()

    result = run(process, updates)
    assert [e.text for e in result.events if e.source == "bus"] == ["event 2", "event 3"]
    document = result.to_json("1")
    kept = ("tool", "version", "network", "plan_sha256", "mode", "bus", "stalled_ms", "result")
    assert [document[key] for key in kept] == [
        "fsoe-net", "1", RESOLUTION.network.name, hashlib.sha256(PLAN).hexdigest(), "live",
        {"backend": "soem", "interface": "eth1"}, 1.01, "pass",
    ]  # fmt: skip
    (row,) = result.connections
    assert (row.net, row.main, row.sub, row.connection_id, row.address, row.watchdog_ms) == (
        "safety_net", "el1918", "ek1914", 1, 14, 100,
    )  # fmt: skip
    assert [s.name for s in result.subdevices] == ["drive_1"]


def test_a_run_ends_after_its_time(process: Process):
    result = run_on_bus(RESOLUTION, PLAN, OPTIONS, 20_000_000)
    assert result.duration_ms >= 20
    assert (texts(result), result.events_lost) == ([], 0)


def test_a_bus_that_never_opened_has_nothing_to_tell(process: Process):
    process.fake.refuse["snapshot"] = AT_STATE
    stop = threading.Event()
    stop.set()
    with pytest.raises(KeyboardInterrupt):
        run_on_bus(RESOLUTION, PLAN, OPTIONS, None, stop=stop)


def test_a_bus_that_stops_is_shown_as_it_was_seen_last(process: Process):
    def updates(number: int, stop: threading.Event) -> None:
        process.fake.refuse["snapshot"] = AT_STATE
        if number == 2:
            stop.set()

    result = run(process, updates)
    assert not result.passed
    assert texts(result) == [
        "interrupted by the user",
        "the bus was not running at the end; what is shown was seen last",
    ]


def test_a_bus_that_is_busy_still_runs(process: Process):
    def updates(number: int, stop: threading.Event) -> None:
        process.fake.refuse["snapshot"] = {"error": "FSN_E_BUSY", "text": "later"}
        if number == 2:
            stop.set()

    assert run(process, updates).passed


def test_another_rejection_ends_the_run(process: Process):
    process.fake.refuse["snapshot"] = {"error": "FSN_E_MEMORY", "text": "no memory"}
    with pytest.raises(ControlRefused, match="snapshot: no memory"):
        run(process)


def test_a_connection_that_breaks_is_made_again(process: Process):
    def updates(number: int, stop: threading.Event) -> None:
        if number == 1:
            process.fake.drop()
        if number == 4:
            stop.set()

    result = run(process, updates)
    first, last = texts(result)
    assert first.endswith("fsn-master has closed it; connected again, events may be missing")
    assert last == "interrupted by the user"
    assert (result.events_lost, result.passed) == (1, True)


def test_an_fsn_master_that_has_ended_gives_reason_and_place(process: Process):
    def updates(_number: int, _stop: threading.Event) -> None:
        process.has_ended = True
        process.fake.drop()

    with pytest.raises(InputError) as refused:
        run(process, updates)
    (sub,) = [s for s in RESOLUTION.network.subdevices if s.name == "ek1914"]
    assert str(refused.value) == (f"SubDevice 0 (ek1914) is missing\n  ek1914 is at {sub.span}")


def test_fsn_master_no_longer_answers(process: Process):
    def updates(_number: int, _stop: threading.Event) -> None:
        process.fake.close()

    with pytest.raises(EnvironmentFault, match="no answer on"):
        run(process, updates)


@pytest.mark.parametrize(("has_ended", "said"), [(True, "is missing"), (False, "broke: ")])
def test_a_bus_that_is_refused_between_two_requests_is_explained(
    process: Process, monkeypatch: pytest.MonkeyPatch, has_ended: bool, said: str
):
    def connect() -> Client:
        client = Client(process.fake.path)
        process.fake.drop()
        return client

    monkeypatch.setattr(process, "connect", connect)
    process.has_ended = has_ended
    with pytest.raises(InputError if has_ended else EnvironmentFault, match=said):
        run(process)
