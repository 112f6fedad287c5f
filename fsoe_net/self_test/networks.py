"""Reference networks: valid ones give their plan, broken ones their findings, a run its result."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator

from fsoe_net.project.installed import shipped
from fsoe_net.self_test.model import TriedValue, reference

_FINDING = re.compile(r":(\d+):(\d+): (?:error|warning)\[(FSN\d+)\]")


def reference_networks() -> Iterator[TriedValue]:
    """Check and compile the valid examples: no finding, and the known bytes."""
    from fsoe_net.network import load

    for name, known in reference()["networks"].items():
        network = load(shipped("examples") / name / "network.yaml")
        found = [str(d) for d in network.check() if d.level.value != "info"]
        yield TriedValue(f"{name}: findings", [], found)
        plan = hashlib.sha256(network.compile().to_bytes()).hexdigest()
        yield TriedValue(f"{name}: SHA-256 of the plan", known["plan_sha256"], plan)
        whole = network.fingerprint.whole
        yield TriedValue(f"{name}: fingerprint", known["fingerprint"], whole)


def broken_networks() -> Iterator[TriedValue]:
    """Check the broken examples: exactly the findings in the text next to each, at their places."""
    from fsoe_net.project.check import check_files

    files = sorted((shipped("examples") / "broken").glob("*.yaml"))
    yield TriedValue("broken networks", reference()["broken_networks"], len(files))
    for file in files:
        expected = _FINDING.findall(file.with_suffix(".txt").read_text("utf-8"))
        found = [
            (str(d.span.line), str(d.span.column), d.code)
            for d in check_files([str(file)]).diagnostics
            if d.level.value != "info"
        ]
        yield TriedValue(f"{file.name}: line, column, code", expected, found)


def emulated_runs() -> Iterator[TriedValue]:
    """Run the scenarios of the examples in virtual time: Data, e-stop, fail-safe, loss, return."""
    from fsoe_net.network import load

    for name, known in reference()["runs"].items():
        folder = shipped("examples") / name
        run = load(folder / "network.yaml").simulate(folder / "scenario.yaml")
        failed = [f"{v.place}: {v.text}: {v.seen}" for v in run.verdicts if not v.held]
        yield TriedValue(f"{name}: expectations that do not hold", [], failed)
        yield TriedValue(f"{name}: expectations", known["expectations"], len(run.verdicts))
        for c in run.connections:
            row = [c.time_to_data_ms, c.resets, c.wrong_to_sub + c.wrong_to_main, c.state]
            expected = known["connections"].get(c.name)
            yield TriedValue(f"{name}: {c.name}: ms to Data, resets, wrong, state", expected, row)
        rows = sorted(c.name for c in run.connections)
        yield TriedValue(f"{name}: connections", sorted(known["connections"]), rows)


def safety_functions() -> Iterator[TriedValue]:
    """Compare reaction times and PFH of the e-stop example with values calculated by hand."""
    from fsoe_net.network import load

    known = reference()["safety_function"]
    budget = load(shipped("examples") / "estop" / "network.yaml").timing()
    function = budget.functions[0]
    reaction = function.reaction
    for name, expected in known["reaction_ms"].items():
        got = None if reaction is None else round(getattr(reaction, name), 6)
        yield TriedValue(f"{name}, ms", expected, got)
    late = {} if reaction is None else {case.way: case.ms for case in reaction.late}
    for way, expected in known["late_ms"].items():
        yield TriedValue(f"{way}, ms", expected, late.get(way))
    decides = None if reaction is None else reaction.decides.way
    yield TriedValue("case that decides", known["decides"], decides)
    pfh = function.pfh
    yield TriedValue("PFH per hour", known["pfh_per_hour"], f"{pfh.total:.3e}")
    yield TriedValue("limit of PFH per hour", known["pfh_limit"], pfh.limit)
    claims = [[c.lowest, *c.weakest, c.by_sum, c.judgement.value] for c in function.levels]
    yield TriedValue("lowest claim, of whom, PL of the sum, judged", known["claims"], claims)
