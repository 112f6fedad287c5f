"""What the live page rarely meets: long histories, slow machines, odd values, forgotten runs."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import struct
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from networks import example
from patience import PATIENCE_S
from studio.browser import needed

from fsoe_net.errors import CoreError, EnvironmentFault, InputError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.live.result import RunEvent, state_fields
from fsoe_net.plan.model import PlanSymbol
from fsoe_net.project.simulate import simulate

needed("starlette", "studio")

from fsoe_net.studio import live_emulated, live_feed  # noqa: E402
from fsoe_net.studio.live_emulated import EmulatedFeed, Pace  # noqa: E402
from fsoe_net.studio.live_feed import EventHistory, ScopeRing  # noqa: E402
from fsoe_net.studio.live_master import MasterFeed, _notes, _title  # noqa: E402
from fsoe_net.studio.live_rows import event_row, recorded_view  # noqa: E402
from fsoe_net.studio.live_signals import reader  # noqa: E402


def event(number: int) -> RunEvent:
    return RunEvent(time_ms=float(number), source="a\x1b", text=f"event {number}")


def test_of_very_many_events_the_newest_stay_with_their_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(live_feed, "KEPT_EVENTS", 3)
    history = EventHistory()
    history.add(map(event, range(5)))
    row, known = history.since(0)
    assert (row["first"], row["left_out"], known) == (2, 2, 5)
    assert [e["text"] for e in row["events"]] == ["event 2", "event 3", "event 4"]
    assert row["events"][0]["source"] == r"a\u001b"
    assert history.since(4)[0]["events"] == row["events"][2:]
    assert history.since(99) == ({"first": 5, "left_out": 2, "events": []}, 5)
    assert history.kept() == (tuple(map(event, (2, 3, 4))), 2)


def test_the_scope_keeps_ten_seconds_and_begins_again_with_another_run() -> None:
    ring = ScopeRing(("a",), 1)
    for n in range(12_000):
        ring.add(float(n), (n,))
    row, known = ring.since(1, 0)
    assert (row["first"], len(row["rows"]), known) == (12_000 - 10_001, 10_001, 12_000)
    assert ring.since(1, 11_999)[0]["rows"] == [(11_999.0, 11_999)]
    assert len(ring.since(0, 11_999)[0]["rows"]) == 10_001  # another choice: all of it
    ring.add(5.0, (0,))
    assert ring.since(1, 0)[0]["rows"] == [(5.0, 0)]


def test_an_event_without_facts_is_not_a_state_whatever_its_text() -> None:
    for text in ("wire: Data · ProcessData", "SubInstance resets: watchdog expired", "outputs on"):
        row = event_row(RunEvent(time_ms=0.0, source="a", text=text, code=8))
        assert (row["kind"], row["end"], row["state"]) == ("other", "", "")
    facts = state_fields("main", "Session", in_data=False)
    row = event_row(RunEvent(time_ms=0.0, source="a", text="anything", **facts))
    assert (row["kind"], row["end"], row["state"]) == ("state", "main", "Session")


def symbol(kind: int, bits: int, bit: int = 0, **more: object) -> PlanSymbol:
    plain = PlanSymbol(
        name="a", sm=0, bit_offset=bit, bits=bits, kind=kind, output=False, restart_relevant=False
    )
    return dataclasses.replace(plain, **more)


def test_a_signal_is_read_from_its_bits() -> None:
    image = bytes(3) + bytes([0b1010_0000, 0xFF]) + struct.pack("<f", 1.5) + struct.pack("<d", -2.0)
    assert reader(symbol(1, 1, 5), 3)(image) == 1
    assert reader(symbol(1, 1, 6), 3)(image) == 0
    assert reader(symbol(1, 4, 6), 3)(image) == 0b1110
    assert reader(symbol(2, 8), 4)(image) == -1
    assert reader(symbol(1, 8, factor=2.0, offset=1.0), 4)(image) == 511
    assert reader(symbol(1, 8, factor=2.0, offset=1.0, output=True), 4)(image) == 127
    assert reader(symbol(4, 32), 5)(image) == 1.5
    assert reader(symbol(4, 64), 9)(image) == -2.0
    assert reader(symbol(4, 32), 0)(struct.pack("<f", math.nan)) is None


def test_lost_time_is_not_made_up_for(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0]
    monkeypatch.setattr(time, "monotonic_ns", lambda: now[0])
    pace, end = Pace(), threading.Event()
    end.set()  # no wait in earnest
    assert pace.share(0) is None
    now[0] = 2_000_000_000
    assert pace.share(500_000_000) == 0.25
    pace.keep(500_000_000, end)  # far behind: begins anew from here
    now[0] = 3_000_000_000
    pace.keep(1_500_000_000, end)
    assert pace.share(1_500_000_000) == 1.0


def wait_for_the_end(feed: EmulatedFeed) -> None:
    feed._thread.join(PATIENCE_S)
    assert feed.closed


def test_a_run_that_no_one_looks_at_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_emulated, "FORGOTTEN_S", 0.0)
    feed = EmulatedFeed(example("estop"), "")
    feed.start()
    wait_for_the_end(feed)
    assert feed.message(0, 0, 0)[0]["events"][-1]["text"] == "ended: no page has listened for long"


def test_a_run_that_fails_gives_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    feed = EmulatedFeed(example("estop"), "")

    def fails(_now_ns: int) -> None:
        raise CoreError("the core has stopped", -1)

    monkeypatch.setattr(feed._session.core, "cycle", fails)
    feed.start()
    wait_for_the_end(feed)
    view = feed.message(0, 0, 0)[0]
    assert (view["away"], view["state"], view["ended"]) == ("the core has stopped", "ended", True)


def document() -> dict[str, Any]:
    return simulate(example("estop"), duration_ns=50_000_000).to_json("0")


def test_a_document_holds_numbers_where_numbers_are() -> None:
    good = json.loads(json.dumps(document()))
    view = recorded_view(good)
    assert view["connections"][0]["state"] == "Data · FailSafeData"
    assert view["statistics"]["histograms"] == {}
    for part, key, value in (
        ("connections", "resets", {"<b>": 1}),
        ("connections", "watchdog_ms", "soon"),
        ("connections", "fsoe_cycle_ms", 3),
        ("connections", "observed", {"evil": 1}),
        ("events", "time_ms", None),
    ):
        bad = json.loads(json.dumps(good))
        bad[part][0][key] = value
        with pytest.raises(InputError, match="this is not a recorded run"):
            recorded_view(bad)
    bad = json.loads(json.dumps(good))
    bad["statistics"]["cycles"] = []
    with pytest.raises(InputError, match="this is not a recorded run"):
        recorded_view(bad)


def test_text_next_to_the_tables() -> None:
    client = SimpleNamespace(text="client 3 reads in the cycle")
    status = SimpleNamespace(
        ring=SimpleNamespace(text="ring open: between a and b"),
        clocks=SimpleNamespace(text="distributed clocks synchronous"),
        buses=[SimpleNamespace(name="main", interface="eth1", actual_wkc=2, expected_wkc=3)],
        groups=[SimpleNamespace(name="drill", state="wrong", detail="another one stands there")],
        in_cycle=[client],
        interface="",
        backend="soem",
    )
    assert list(_notes(status)) == [
        "ring open: between a and b",
        "distributed clocks synchronous",
        "bus main: working counter 2 of 3",
        "group drill: wrong",
        "client 3 reads in the cycle",
    ]
    assert _title(status) == "fsn-master, soem on eth1"


def test_a_scope_without_a_bus_is_reported(tmp_path: Path) -> None:
    feed = MasterFeed(str(tmp_path / "nobody"))
    with pytest.raises(EnvironmentFault, match="no answer"):
        feed.choose(["a"])
    feed.scope = ScopeRing(("a",), 1)
    feed.start()
    with feed.listening():
        until = time.monotonic() + PATIENCE_S
        while not feed.scope.fault and time.monotonic() < until:
            pass
    feed.close()
    assert "no answer" in str(feed.scope.fault)
    assert feed.document()["socket"] == str(tmp_path / "nobody")


def test_the_page_draws_each_state_of_a_connection():
    past = Path(live_feed.__file__).with_name("assets") / "live_past.js"
    text = past.read_text("utf-8")
    states = re.findall(r"^export const (?:DATA|FAILSAFE|PROCESS) = \"(.*)\";$", text, re.M)
    states += re.findall(r'^  "(.*)",$', text.partition("LEVELS = [")[2].partition("]")[0], re.M)
    # The ends also know Data without its kind.
    assert set(states) == {state.text for state in ConnectionState} | {"Data"}
