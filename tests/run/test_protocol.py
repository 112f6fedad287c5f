"""Test protocols: steps, what the emulated and the live bus fill in, what people wrote is kept."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import pytest
import yaml
from run.support import ESTOP, needs_core, resolution_of

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fsoe.campaign import CATALOGUE, EXHAUSTIVE, CampaignConfig
from fsoe_net.load import Collector, load_network, load_protocol, read_schema
from fsoe_net.model import (
    EMULATED_NOTE,
    AtMachine,
    Outcome,
    Protocol,
    ProtocolStep,
    Resolution,
    Seen,
    StepKind,
    resolve,
)
from fsoe_net.plan import (
    Fingerprint,
    compile_plan,
    fingerprint_of,
    fingerprint_of_sections,
)
from fsoe_net.report import protocol_page
from fsoe_net.run import (
    compare_protocol,
    keep_machine,
    make_protocol,
    run_protocol_live,
    run_protocol_virtual,
)
from fsoe_net.run.protocol_times import LossTimes
from fsoe_net.save import write_protocol

TIMED = Path(__file__).parents[1] / "diagnostics" / "base" / "timed.yaml"
DONE = AtMachine(outcome=Outcome.AS_EXPECTED, measured_ms=61.5, by="A. Person", date="2026-11-21")


def timed() -> Resolution:
    network = load_network([TIMED]).network
    assert network is not None
    return resolve(network)


def protocol_of(resolution: Resolution) -> tuple[Protocol, bytes]:
    plan = compile_plan(resolution).to_bytes()
    return make_protocol(resolution, plan), plan


def only(protocol: Protocol, *kinds: StepKind) -> Protocol:
    return replace(protocol, steps=tuple(s for s in protocol.steps if s.kind in kinds))


def by_id(protocol: Protocol) -> dict[str, ProtocolStep]:
    return {step.id: step for step in protocol.steps}


def test_steps_of_functions_connections_devices_and_faults() -> None:
    protocol, _ = protocol_of(timed())
    ids = list(by_id(protocol))
    assert ids[:6] == [
        "start-up logic-io",
        "start-up logic-io2",
        "trigger estop",
        "loss io",
        "loss io2",
        "loss logic",
    ]
    assert ids[6:] == [f"fault {name}" for name in CATALOGUE]
    trigger = by_id(protocol)["trigger estop"]
    assert "ES1 is pressed" in trigger.what
    assert "K1 opens" in trigger.expected
    assert trigger.limit_ms == 230
    assert protocol.open_steps == protocol.machine_steps == protocol.steps[:6]
    assert protocol.failed_steps == ()


@needs_core
def test_the_emulated_bus_measures_and_closes_no_step() -> None:
    resolution = timed()
    empty, plan = protocol_of(resolution)
    wanted = only(empty, StepKind.START_UP, StepKind.TRIGGER, StepKind.LOSS)
    done = run_protocol_virtual(wanted, resolution, plan)
    assert [s.emulated.outcome for s in done.steps if s.emulated] == [Outcome.AS_EXPECTED] * 6
    steps = by_id(done)
    times = {name: s.emulated.measured_ms for name, s in steps.items() if s.emulated}
    said = {name: s.emulated.time_is for name, s in steps.items() if s.emulated}
    assert "from safe inputs 0 to safe outputs 0" in said["trigger estop"]
    assert "from the last bus cycle with it" in said["loss io"]
    assert all("to the bus cycle of 1 ms" in text for text in said.values())
    assert 0 < (times["trigger estop"] or 0) < 20  # two handshakes of a few bus cycles
    assert 100 <= (times["loss io"] or 0) <= 110  # its watchdog is 100 ms
    assert len(done.open_steps) == len(wanted.open_steps) == len(wanted.steps)
    assert not any(step.is_done for step in done.steps)
    assert all(not s.machine.filled and s.live is None for s in done.steps)
    assert run_protocol_virtual(wanted, resolution, plan) == done


@needs_core
def test_a_reaction_that_comes_too_late_is_said() -> None:
    resolution = timed()
    empty, plan = protocol_of(resolution)
    trigger = replace(by_id(empty)["trigger estop"], limit_ms=1.0)
    (step,) = run_protocol_virtual(replace(empty, steps=(trigger,)), resolution, plan).steps
    assert step.emulated is not None
    assert step.emulated.outcome is Outcome.NOT_AS_EXPECTED
    assert step.emulated.remark.startswith("later than 1 ms")


@needs_core
def test_faults_are_counted_per_class() -> None:
    resolution = resolution_of(ESTOP)
    empty, plan = protocol_of(resolution)
    wanted = [s for s in empty.steps if s.subject in ("delay", "repetition", "masquerade")]
    done = run_protocol_virtual(replace(empty, steps=tuple(wanted)), resolution, plan, faults=20)
    for step in done.steps:
        assert step.emulated is not None
        assert step.emulated.outcome is Outcome.AS_EXPECTED
        assert step.emulated.remark.startswith("20 faults: ")
        assert "0 wrongly accepted" in step.emulated.remark


@needs_core
def test_all_bit_errors_of_a_size_are_tried_once(monkeypatch: pytest.MonkeyPatch) -> None:
    resolution = timed()
    empty, plan = protocol_of(resolution)
    wanted = [s for s in empty.steps if s.subject == EXHAUSTIVE]
    tried: list[tuple[str, ...]] = []

    def stopped(config: CampaignConfig, *_: object) -> SimpleNamespace:
        tried.append(tuple(link.name for link in config.links))
        return SimpleNamespace(interrupted=True)

    monkeypatch.setattr("fsoe_net.run.protocol_virtual.run_campaign", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_protocol_virtual(replace(empty, steps=tuple(wanted)), resolution, plan)
    assert tried == [("logic-io",)]  # logic-io2 has the same sizes


@needs_core
def test_a_function_without_emulated_inputs_stays_open_with_the_reason() -> None:
    network = load_network([TIMED]).network
    assert network is not None
    (function,) = network.safety_functions
    elements = tuple(replace(e, sub="logic") if e.sub == "io" else e for e in function.elements)
    network = replace(network, safety_functions=(replace(function, elements=elements),))
    resolution = resolve(network)
    empty, plan = protocol_of(resolution)
    (step,) = run_protocol_virtual(only(empty, StepKind.TRIGGER), resolution, plan).steps
    assert step.emulated is not None
    assert step.emulated.outcome is Outcome.NOT_RUN
    assert "no emulated safe input bits" in step.emulated.remark


# -- the file -------------------------------------------------------------------------------------


def test_the_file_is_read_back_as_it_was(tmp_path: Path) -> None:
    protocol, _ = protocol_of(timed())
    first = replace(protocol.steps[0], machine=DONE)
    protocol = replace(protocol, steps=(first, *protocol.steps[1:]))
    path = tmp_path / "protocol.yaml"
    text = write_protocol(protocol)
    path.write_text(text, "utf-8")
    out = Collector()
    assert load_protocol(path, out) == protocol
    assert out.diagnostics == []
    assert EMULATED_NOTE in text
    jsonschema.validate(yaml.safe_load(text), read_schema("protocol"))
    assert protocol.steps[0] not in protocol.open_steps
    assert protocol.steps[0].is_done


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("kind: trigger", "kind: triggered", "triggered"),
        ("result: ''", "result: fine", "fine"),
        ("limit_ms: 230.0", "limit_ms: soon", "soon"),
        ("limit_ms: 230.0", "limit_ms: -1", "-1"),
        ("id: loss io2", "id: loss io", "twice"),
        ("emulated: null", "emulatd: null", "emulatd"),
        ("date: ''", "date: 21.11.2026", "such as 2026-11-21"),
        ("date: ''", "date: 2026-02-30", "is no date"),
        ("    measured_ms: ''", "    measured_ms: 61,5", "61,5"),
    ],
)
def test_mistakes_of_people_are_located(
    before: str, after: str, words: str, tmp_path: Path
) -> None:
    protocol, _ = protocol_of(timed())
    text = write_protocol(protocol)
    assert before in text
    path = tmp_path / "protocol.yaml"
    path.write_text(text.replace(before, after, 1), "utf-8")
    out = Collector()
    assert load_protocol(path, out) is None
    found = out.diagnostics[0]
    assert words in f"{found.message} {found.hint}"
    assert found.span.line > 4


def test_a_date_and_a_number_by_hand_are_read(tmp_path: Path) -> None:
    protocol, _ = protocol_of(timed())
    text = write_protocol(protocol)
    text = text.replace(
        "    result: ''\n    measured_ms: ''", "    result: as expected\n    measured_ms: 61.5", 1
    )
    text = text.replace("by: ''", "by: A. Person", 1).replace("date: ''", "date: 2026-11-21", 1)
    path = tmp_path / "protocol.yaml"
    path.write_text(text, "utf-8")
    out = Collector()
    read = load_protocol(path, out)
    assert out.diagnostics == []
    assert read is not None
    assert read.steps[0].machine == DONE


def written(tmp_path: Path, **machine: object) -> tuple[Collector, Protocol | None]:
    """Return what is read when people have written into one step, and nothing else."""
    protocol, _ = protocol_of(timed())
    document = yaml.safe_load(write_protocol(protocol))
    for step in document["steps"]:
        if step["id"] == machine.get("step", "trigger estop"):
            step["machine"] = {k: v for k, v in machine.items() if k != "step"}
    path = tmp_path / "protocol.yaml"
    path.write_text(yaml.safe_dump(document, sort_keys=False), "utf-8")
    out = Collector()
    return out, load_protocol(path, out)


@pytest.mark.parametrize(
    ("machine", "missing"),
    [
        ({"result": "as expected"}, "by and date not filled in"),
        ({"result": "as expected", "by": "A. Person"}, ": date not filled in"),
        ({"by": "A. Person", "date": "2026-11-21"}, ": result not filled in"),
        ({"measured_ms": 61.5}, "result and by and date"),
    ],
)
def test_an_unfinished_entry_is_named_and_stays_open(
    machine: dict[str, Any], missing: str, tmp_path: Path
) -> None:
    out, read = written(tmp_path, **machine)
    (found,) = out.diagnostics
    assert (found.code, found.span.line > 4) == ("FSN160", True)
    assert missing in found.message
    assert "2026-11-21" in (found.hint or "")
    assert read is not None
    assert by_id(read)["trigger estop"].is_open


SIGNED = {"result": "as expected", "by": "A. Person", "date": "2026-11-21"}


def test_a_time_above_the_limit_is_not_as_expected(tmp_path: Path) -> None:
    out, read = written(tmp_path, **SIGNED, measured_ms=231)
    assert read is None
    assert "231 ms is longer than the limit of 230 ms" in out.diagnostics[0].message
    out, read = written(tmp_path, **{**SIGNED, "result": "not as expected"}, measured_ms=231)
    assert read is not None
    assert out.diagnostics == []
    assert [step.id for step in read.failed_steps] == ["trigger estop"]


def test_a_step_on_the_emulated_bus_only_takes_no_entry_at_the_machine(tmp_path: Path) -> None:
    out, read = written(tmp_path, **SIGNED, step="fault delay")
    assert read is None
    assert "emulated bus only" in out.diagnostics[0].message


def test_a_protocol_is_held_against_the_files() -> None:
    resolution = timed()
    plan = compile_plan(resolution)
    whole = fingerprint_of(plan).whole
    fresh = make_protocol(resolution, plan.to_bytes(), fingerprint=whole)

    def said(given: Protocol) -> list[str]:
        out = Collector()
        compare_protocol(given, fresh, out)
        assert all(d.code == "FSN161" and d.hint for d in out.diagnostics)
        return [d.message for d in out.diagnostics]

    assert said(fresh) == []
    assert said(replace(fresh, plan_sha256="0" * 64)) == []  # the fingerprint counts
    first, *others = fresh.steps
    assert said(replace(fresh, steps=tuple(others))) == [
        f"step {first.id} of these files is missing"
    ]
    strange = replace(first, id="loss other")
    assert said(replace(fresh, steps=(*fresh.steps, strange))) == [
        "step loss other is none of these files"
    ]
    trigger = by_id(fresh)["trigger estop"]
    wide = replace(trigger, limit_ms=900.0)
    steps = tuple(wide if step is trigger else step for step in fresh.steps)
    assert said(replace(fresh, steps=steps)) == [
        "step trigger estop: limit_ms is not what these files give"
    ]
    (words,) = said(replace(fresh, fingerprint="0" * 64))
    assert words.startswith("made for another configuration (0000 0000 0000 0000)")


def test_a_step_stays_open_without_name_and_date() -> None:
    protocol, _ = protocol_of(timed())
    step = protocol.steps[0]
    assert not replace(step, machine=DONE).is_open
    assert replace(step, machine=replace(DONE, by="")).is_open
    assert replace(step, machine=replace(DONE, date="")).is_open
    assert replace(step, machine=replace(DONE, outcome=Outcome.NOT_RUN)).is_open
    assert replace(step, machine=replace(DONE, outcome=None)).is_open


FINE = Seen(outcome=Outcome.AS_EXPECTED, measured_ms=5.0)
WRONG = replace(FINE, outcome=Outcome.NOT_AS_EXPECTED)


def test_what_programs_saw_closes_no_step() -> None:
    protocol, _ = protocol_of(timed())
    seen = replace(
        protocol, steps=tuple(replace(s, emulated=FINE, live=FINE) for s in protocol.steps)
    )
    assert seen.open_steps == seen.machine_steps
    assert not any(step.is_done for step in seen.steps)


def test_a_step_that_failed_is_never_done() -> None:
    protocol, _ = protocol_of(timed())
    trigger = by_id(protocol)["trigger estop"]
    fine = replace(trigger, machine=DONE)
    assert fine.is_done
    failed = replace(trigger, machine=replace(DONE, outcome=Outcome.NOT_AS_EXPECTED))
    assert (failed.is_open, failed.is_failed, failed.is_done) == (False, True, False)
    unsigned = replace(failed, machine=replace(failed.machine, by=""))
    assert (unsigned.is_open, unsigned.is_failed) == (True, True)
    late = replace(trigger, machine=replace(DONE, measured_ms=230.1))
    assert (late.is_late, late.is_failed, late.is_done) == (True, True, False)
    assert replace(protocol, steps=(fine, failed, late)).failed_steps == (failed, late)
    disputed = replace(fine, live=WRONG)
    assert disputed.is_done
    assert replace(protocol, steps=(fine, disputed)).disputed_steps == (disputed,)


def test_a_class_of_faults_is_not_tried_at_the_machine() -> None:
    protocol, _ = protocol_of(timed())
    fault = by_id(protocol)["fault delay"]
    for step in (fault, replace(fault, emulated=FINE), replace(fault, machine=DONE)):
        assert (step.is_open, step.is_done, step.is_failed) == (False, False, False)
    assert replace(fault, emulated=WRONG, machine=DONE).is_failed


def test_what_people_wrote_is_kept_or_nothing_is_written() -> None:
    fresh, _ = protocol_of(timed())
    written = replace(fresh, steps=(replace(fresh.steps[0], machine=DONE), *fresh.steps[1:]))
    assert keep_machine(fresh, written) == written
    with pytest.raises(InputError, match="of another plan"):
        keep_machine(replace(fresh, plan_sha256="0" * 64), written)
    with pytest.raises(InputError, match="are no more"):
        keep_machine(replace(fresh, steps=fresh.steps[1:]), written)
    changed = replace(fresh.steps[0], expected="something else")
    with pytest.raises(InputError, match="asks for something else"):
        keep_machine(replace(fresh, steps=(changed, *fresh.steps[1:])), written)
    empty = replace(written, steps=fresh.steps, plan_sha256="0" * 64)
    assert keep_machine(fresh, empty) == fresh


def test_the_page_says_what_is_emulated_and_leaves_room() -> None:
    protocol, _ = protocol_of(timed())
    strange = replace(protocol.steps[0], subject="<b>", what="a & b")
    page = protocol_page(replace(protocol, steps=(strange,)), version="0")
    assert EMULATED_NOTE in page
    assert "MACHINE" in page
    assert "1 of 1 steps open" in page
    assert "a &amp; b" in page


# -- live -----------------------------------------------------------------------------------------


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

    def state(self, name: str) -> str:
        since = -(10**9) if name == self.stuck else self.lost.get(name)
        return "data_process" if since is None or self.now_ns < since + self.react_ns else "reset"

    def connections(self) -> tuple[SimpleNamespace, ...]:
        if self.broken:
            raise EnvironmentFault("the connection broke")
        return tuple(
            SimpleNamespace(
                name=name, seen=SimpleNamespace(state=SimpleNamespace(word=self.state(name)))
            )
            for name in PAIRS
        )

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

    def guarded(self, step: ProtocolStep) -> bool:
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
    protocol: Protocol,
    *,
    wanted: Fingerprint | None = None,
    on_step: Callable[[Protocol, ProtocolStep], None] | None = None,
) -> dict[str, ProtocolStep]:
    done = run_protocol_live(
        protocol,
        timed(),
        person.bus,  # type: ignore[arg-type]
        person,
        fingerprint=wanted,
        clock=person.bus.clock,
        on_step=on_step,
    )
    return by_id(done)


def test_each_loss_is_confirmed_watched_and_measured() -> None:
    protocol, _ = protocol_of(timed())
    person = Person(Bus(protocol.plan_sha256))
    steps = live(person, protocol)
    assert person.asked == ["loss io", "loss io2", "loss logic"]
    for name in ("start-up logic-io", "loss io", "loss logic"):
        seen = steps[name].live
        assert seen is not None
        assert seen.outcome is Outcome.AS_EXPECTED
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
    protocol, _ = protocol_of(timed())
    steps = live(Person(Bus(protocol.plan_sha256, react_ns=200 * CYCLE_NS)), protocol)
    seen = steps["loss io"].live
    assert seen is not None
    assert (seen.outcome, seen.measured_ms) == (Outcome.NOT_AS_EXPECTED, 201)
    assert "later than 200 ms" in seen.remark


@pytest.mark.parametrize(
    ("more", "remark"),
    [
        ({"confirms": False}, "nobody confirmed that the area is guarded"),
        ({"acts": False}, "stayed on the bus"),
        ({"wrong": "io2"}, "io stayed on the bus; io2 left instead"),
    ],
)
def test_without_confirmation_or_deed_a_loss_is_not_run(more: dict[str, Any], remark: str) -> None:
    protocol, _ = protocol_of(timed())
    person = Person(Bus(protocol.plan_sha256), **more)
    seen = live(person, protocol)["loss io"].live
    assert seen is not None
    assert seen.outcome is Outcome.NOT_RUN
    assert seen.remark.endswith(remark)
    assert bool(person.told) is person.confirms


def test_a_step_that_is_left_out_keeps_what_was_seen_before() -> None:
    protocol, _ = protocol_of(timed())
    first = live(Person(Bus(protocol.plan_sha256)), protocol)
    again = replace(protocol, steps=tuple(first.values()))
    second = live(Person(Bus(protocol.plan_sha256), confirms=False), again)
    assert second["loss io"].live == first["loss io"].live


def test_a_connection_that_is_not_in_data_is_said() -> None:
    protocol, _ = protocol_of(timed())
    person = Person(Bus(protocol.plan_sha256, stuck="logic-io2"))
    steps = live(person, protocol)
    seen = steps["start-up logic-io2"].live
    assert seen is not None
    assert seen.outcome is Outcome.NOT_AS_EXPECTED
    assert "loss io2" not in person.asked
    loss = steps["loss io2"].live
    assert loss is not None
    assert loss.remark.endswith("were not in Data: logic-io2 in Reset")


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"interface": "veth0"}, "veth0 is no network card (veth)"),
        ({"interface": "", "backend": "emulated"}, "the bus of fsn-master is emulated"),
    ],
)
def test_a_rig_is_no_machine(
    more: dict[str, Any], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fsoe_net.run.in_use.network_driver", lambda *_: "veth")
    protocol, _ = protocol_of(timed())
    person = Person(Bus(protocol.plan_sha256, **more))
    steps = live(person, protocol)
    assert person.told[0] == f"{EMULATED_NOTE}: {why}."
    for step in steps.values():
        assert step.live is None or step.live.remark.startswith(f"{EMULATED_NOTE}: {why}; ")


def test_what_was_seen_before_it_broke_off_is_told() -> None:
    protocol, _ = protocol_of(timed())
    bus = Bus(protocol.plan_sha256)
    kept: list[Protocol] = []

    def on_step(so_far: Protocol, step: ProtocolStep) -> None:
        kept.append(so_far)
        bus.broken = step.id == "loss io"

    with pytest.raises(EnvironmentFault):
        live(Person(bus), protocol, on_step=on_step)
    seen = by_id(kept[-1])
    assert seen["loss io"].live is not None
    assert seen["loss io2"].live is None


def test_another_plan_is_refused() -> None:
    protocol, _ = protocol_of(timed())
    with pytest.raises(InputError, match="another plan"):
        live(Person(Bus("0" * 64)), protocol)


def test_another_configuration_is_refused_and_the_same_taken() -> None:
    protocol, _ = protocol_of(timed())
    ours = fingerprint_of(compile_plan(timed()))
    other = fingerprint_of_sections({**ours.sections, "copies": "0" * 64})
    with pytest.raises(InputError, match="differs in copies"):
        live(Person(Bus(protocol.plan_sha256, fingerprint=other)), protocol, wanted=ours)
    slow = Bus(protocol.plan_sha256, fingerprint=ours, cycle_ns=2 * CYCLE_NS)
    with pytest.raises(InputError, match="differs in cycle"):
        live(Person(slow), protocol, wanted=ours)
    same = live(Person(Bus("0" * 64, fingerprint=ours)), protocol, wanted=ours)
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
    ],
)
def test_times_of_a_loss(events: list[dict[str, object]], took_ms: float | None) -> None:
    times = LossTimes({"a"})
    for event in events:
        times.take(event)
    assert times.took_ms() == took_ms


def test_the_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(read_schema("protocol"))
    assert json.dumps(read_schema("protocol")).count("description") > 20
