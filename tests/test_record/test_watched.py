"""What a live test record tells of a bus, watched on one that is made up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import pytest
from test_record.filled import by_id, fresh_record, timed

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fsoe.observed import ConnectionState
from fsoe_net.model.test_record import EMULATED_NOTE, StepKind, StepOutcome, TestRecord, TestStep
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import Fingerprint, fingerprint_of, fingerprint_of_sections
from fsoe_net.test_record.live import LossTimes, run_tests_live

PAIRS = {"logic-io": {"logic", "io"}, "logic-io2": {"logic", "io2"}}
CYCLE_NS = 1_000_000


@dataclass
class Bus:
    """A running fsn-master with two connections; SubDevices in ``off`` are unplugged.

    Its clock goes on by what is waited for events; a lost connection resets after ``react_ns``.
    """

    plan_sha256: str
    off: set[str] = field(default_factory=set)
    fingerprint: Fingerprint | None = None
    react_ns: int = 101 * CYCLE_NS
    cycle_ns: int = CYCLE_NS
    interface: str = "eth1"
    backend: str = "soem"
    now_ns: int = 0
    stuck: str = ""
    lost: dict[str, int] = field(default_factory=dict)
    told: list[dict[str, object]] = field(default_factory=list)
    broken: bool = False

    def status(self) -> SimpleNamespace:
        return SimpleNamespace(
            plan_sha256=self.plan_sha256,
            fingerprint=self.fingerprint,
            cycle_ns=self.cycle_ns,
            interface=self.interface,
            backend=self.backend,
        )

    def state(self, name: str) -> ConnectionState:
        since = -(10**9) if name == self.stuck else self.lost.get(name)
        if since is None or self.now_ns < since + self.react_ns:
            return ConnectionState.DATA_PROCESS
        return ConnectionState.RESET

    def connections(self) -> tuple[SimpleNamespace, ...]:
        if self.broken:
            raise EnvironmentFault("the connection broke")
        return tuple(SimpleNamespace(name=name, state=self.state(name)) for name in PAIRS)

    def subdevices(self) -> tuple[SimpleNamespace, ...]:
        return tuple(
            SimpleNamespace(name=name, in_op=name not in self.off)
            for name in ("io", "io2", "logic")
        )

    def unplug(self, name: str) -> None:
        self.off.add(name)
        self.told.append({"event": "wkc", "complete": False, "now_ns": self.now_ns})
        for connection, ends in PAIRS.items():
            if name in ends:
                self.lost[connection] = self.now_ns
                self.told.append(
                    {
                        "event": "connection",
                        "connection": connection,
                        "before": "process data",
                        "after": "reset",
                        "now_ns": self.now_ns + self.react_ns,
                    }
                )

    def plug(self, name: str) -> None:
        self.off.discard(name)
        self.told.append({"event": "wkc", "complete": True, "now_ns": self.now_ns})
        self.lost.clear()

    def clock(self) -> float:
        return self.now_ns / 1e9

    def subscribe(self) -> None:
        pass

    def events(self, wait_s: float = 0.0) -> list[dict[str, object]]:
        self.now_ns += round(wait_s * 1e9)
        due = [e for e in self.told if int(str(e["now_ns"])) <= self.now_ns]
        self.told = [e for e in self.told if e not in due]
        return due


@dataclass
class Person:
    """Does what is asked, if willing; ``wrong`` is taken off instead."""

    bus: Bus
    confirms: bool = True
    acts: bool = True
    wrong: str = ""
    told: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def guarded(self, step: TestStep) -> bool:
        self.asked.append(step.id)
        return self.confirms

    def tell(self, text: str) -> None:
        self.told.append(text)
        if self.acts and text.startswith("Take "):
            self.bus.unplug(self.wrong or text.split()[1])
        elif text.startswith("Put "):
            self.bus.plug(text.split()[1])


def live(
    person: Person,
    test_record: TestRecord,
    *,
    wanted: Fingerprint | None = None,
    on_step: Callable[[TestRecord, TestStep], None] | None = None,
) -> dict[str, TestStep]:
    done = run_tests_live(
        test_record,
        timed(),
        person.bus,  # type: ignore[arg-type]
        person,
        fingerprint=wanted,
        clock=person.bus.clock,
        on_step=on_step,
    )
    return by_id(done)


def test_each_loss_is_confirmed_watched_and_measured() -> None:
    test_record, _ = fresh_record(timed())
    person = Person(Bus(test_record.plan_sha256))
    steps = live(person, test_record)
    assert person.asked == ["loss io", "loss io2", "loss logic"]
    for name in ("start-up logic-io", "loss io", "loss logic"):
        seen = steps[name].live
        assert seen is not None
        assert seen.outcome is StepOutcome.AS_EXPECTED
        assert seen.remark.startswith("soem on eth1; ")
        assert "outputs" in seen.remark  # what it did not see
    loss = steps["loss io"].live
    assert loss is not None
    assert loss.measured_ms == 102
    assert "last bus cycle with it" in loss.time_is
    assert "bus cycle of 1 ms" in loss.time_is
    assert "1 of 2 connections in Data" in loss.remark
    assert steps["trigger estop"].live is None
    assert steps["fault delay"].live is None
    assert all(step.is_open or step.kind is StepKind.FAULT for step in steps.values())
    assert all(step.emulated is None for step in steps.values())


def test_a_live_reaction_that_comes_too_late_is_said() -> None:
    test_record, _ = fresh_record(timed())
    steps = live(Person(Bus(test_record.plan_sha256, react_ns=200 * CYCLE_NS)), test_record)
    seen = steps["loss io"].live
    assert seen is not None
    assert (seen.outcome, seen.measured_ms) == (StepOutcome.NOT_AS_EXPECTED, 201)
    assert "later than 200 ms" in seen.remark


@pytest.mark.parametrize(
    ("more", "remark"),
    [
        ({"confirms": False}, "it was not confirmed that the area is guarded"),
        ({"acts": False}, "stayed on the bus"),
        ({"wrong": "io2"}, "io stayed on the bus; io2 left instead"),
    ],
)
def test_without_confirmation_or_deed_a_loss_is_not_run(more: dict[str, Any], remark: str) -> None:
    test_record, _ = fresh_record(timed())
    person = Person(Bus(test_record.plan_sha256), **more)
    seen = live(person, test_record)["loss io"].live
    assert seen is not None
    assert seen.outcome is StepOutcome.NOT_RUN
    assert seen.remark.endswith(remark)
    assert bool(person.told) is person.confirms


def test_a_step_that_is_left_out_keeps_what_was_seen_before() -> None:
    test_record, _ = fresh_record(timed())
    first = live(Person(Bus(test_record.plan_sha256)), test_record)
    again = replace(test_record, steps=tuple(first.values()))
    second = live(Person(Bus(test_record.plan_sha256), confirms=False), again)
    assert second["loss io"].live == first["loss io"].live


def test_a_connection_that_is_not_in_data_is_said() -> None:
    test_record, _ = fresh_record(timed())
    person = Person(Bus(test_record.plan_sha256, stuck="logic-io2"))
    steps = live(person, test_record)
    seen = steps["start-up logic-io2"].live
    assert seen is not None
    assert seen.outcome is StepOutcome.NOT_AS_EXPECTED
    assert "loss io2" not in person.asked
    loss = steps["loss io2"].live
    assert loss is not None
    assert loss.remark.endswith("were not in Data: logic-io2 in Reset")


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"interface": "veth0"}, "veth0 is not a network card (veth)"),
        ({"interface": "", "backend": "emulated"}, "the bus of fsn-master is emulated"),
    ],
)
def test_a_rig_is_not_a_machine(
    more: dict[str, Any], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fsoe_net.live.in_use.network_driver", lambda *_: "veth")
    test_record, _ = fresh_record(timed())
    person = Person(Bus(test_record.plan_sha256, **more))
    steps = live(person, test_record)
    assert person.told[0] == f"{EMULATED_NOTE}: {why}."
    for step in steps.values():
        assert step.live is None or step.live.remark.startswith(f"{EMULATED_NOTE}: {why}; ")


def test_results_before_an_interruption_are_reported() -> None:
    test_record, _ = fresh_record(timed())
    bus = Bus(test_record.plan_sha256)
    kept: list[TestRecord] = []

    def on_step(so_far: TestRecord, step: TestStep) -> None:
        kept.append(so_far)
        bus.broken = step.id == "loss io"

    with pytest.raises(EnvironmentFault):
        live(Person(bus), test_record, on_step=on_step)
    seen = by_id(kept[-1])
    assert seen["loss io"].live is not None
    assert seen["loss io2"].live is None


def test_another_plan_is_refused() -> None:
    test_record, _ = fresh_record(timed())
    with pytest.raises(InputError, match="another plan"):
        live(Person(Bus("0" * 64)), test_record)


def test_another_configuration_is_refused_and_the_same_taken() -> None:
    test_record, _ = fresh_record(timed())
    ours = fingerprint_of(compile_plan(timed()))
    other = fingerprint_of_sections({**ours.sections, "copies": "0" * 64})
    with pytest.raises(InputError, match="differs in copies"):
        live(Person(Bus(test_record.plan_sha256, fingerprint=other)), test_record, wanted=ours)
    slow = Bus(test_record.plan_sha256, fingerprint=ours, cycle_ns=2 * CYCLE_NS)
    with pytest.raises(InputError, match="differs in cycle"):
        live(Person(slow), test_record, wanted=ours)
    same = live(Person(Bus("0" * 64, fingerprint=ours)), test_record, wanted=ours)
    assert same["start-up logic-io"].live is not None


def connection(after: str, now_ns: int, name: str = "a") -> dict[str, object]:
    before = "failsafe data"
    row = {"event": "connection", "connection": name, "before": before, "after": after}
    return row | {"now_ns": now_ns}


def wkc(complete: bool, now_ns: int) -> dict[str, object]:
    return {"event": "wkc", "complete": complete, "now_ns": now_ns}


@pytest.mark.parametrize(
    ("events", "took_ms"),
    [
        ([wkc(False, 0), connection("reset", 5_000_000)], 5),
        ([wkc(False, 0), wkc(True, 1), wkc(False, 2_000_000), connection("reset", 5_000_000)], 3),
        ([connection("reset", 5_000_000)], None),  # nothing was lost
        ([connection("reset", 1), wkc(False, 5_000_000)], None),  # it left before
        ([wkc(False, 0), connection("silent", 5_000_000)], None),  # both ends are gone
        ([wkc(False, 0), connection("process data", 5_000_000)], None),
        ([wkc(False, 0), connection("reset", 5_000_000, "b")], None),  # of another SubDevice
        ([{"event": "wkc"}, {"event": "state"}], None),
        # whole before anything was lost
        ([wkc(True, 0), wkc(False, 1_000_000), connection("reset", 5_000_000)], 4),
        ([{"event": "state", "now_ns": 1}], None),
    ],
)
def test_times_of_a_loss(events: list[dict[str, object]], took_ms: float | None) -> None:
    times = LossTimes({"a"})
    for event in events:
        times.take(event)
    assert times.took_ms() == took_ms


def test_a_loss_of_two_is_timed_when_both_have_left() -> None:
    times = LossTimes({"a", "b"})
    for event in (wkc(False, 0), connection("reset", 5_000_000)):
        times.take(event)
    assert times.took_ms() is None
    times.take(connection("silent", 9_000_000, "b"))
    assert (times.took_ms(), times.silent) == (5, ["b"])


def _io(person: Person) -> str:
    test_record, _ = fresh_record(timed())
    seen = live(person, test_record)["loss io"].live
    assert seen is not None
    return seen.remark


def _bus(**more: Any) -> Bus:
    return Bus(fresh_record(timed())[0].plan_sha256, **more)


def test_a_connection_that_fsn_master_does_not_have(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(PAIRS, "logic-io")
    test_record, _ = fresh_record(timed())
    steps = live(Person(_bus()), test_record)
    for name, remark in (
        ("start-up logic-io", "soem on eth1; fsn-master has no connection of this name"),
        ("loss io", "soem on eth1; fsn-master has no connection logic-io"),
    ):
        seen = steps[name].live
        assert seen is not None
        assert (seen.outcome, seen.remark) == (StepOutcome.NOT_RUN, remark)


def test_a_bus_that_changes_while_a_person_walks() -> None:
    class Slow(Person):
        def guarded(self, step: TestStep) -> bool:
            self.bus.stuck = "logic-io"
            return True

    assert _io(Slow(_bus())) == (
        "soem on eth1; its connections were not in Data: logic-io in Reset"
    )


def test_connections_that_stay_in_data_and_do_not_come_back() -> None:
    class Lazy(Person):
        def tell(self, text: str) -> None:
            if not text.startswith("Put "):
                super().tell(text)

    assert _io(Lazy(_bus(react_ns=10**15))) == (
        "soem on eth1; 2 of 2 connections in Data without it; its connections stayed in Data; not "
        "all came back into Data; outputs are not seen here"
    )


def test_frames_that_were_lost_before_it() -> None:
    class Loose(Person):
        def tell(self, text: str) -> None:
            if text.startswith("Take "):
                self.bus.told += [wkc(False, self.bus.now_ns), wkc(True, self.bus.now_ns)]
            super().tell(text)

    assert "; 1 time the bus lost frames before it: the time is uncertain; " in _io(Loose(_bus()))
