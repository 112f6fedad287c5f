"""Prints what the code decides, as JSON: with ``capitals`` every sentence of it is in capitals.

A sentence is a constant with a blank and a word of three small letters; those of the C core are the
texts of its documents. What is decided must not depend on them.
"""

from __future__ import annotations

import ast
import importlib.abc
import importlib.machinery
import importlib.util
import itertools
import json
import re
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent / "fsoe_net"
# Rooms whose constants are syntax: of files, pages, options, headers.
SYNTAX = ("formats", "document", "cli", "plan", "core", "diag")
# Keys of documents of the C core that are for people.
TEXTS = ("text", "detail", "found_text", "reset_text")
SENTENCE = re.compile(r"(?=.*\s)(?=.*[a-z]{3})", re.DOTALL)


def _upper(text: str) -> str:
    """Return a text in capitals; names of values in braces stay."""
    return re.sub(r"\{\w+\}|[^{]+|\{", lambda m: m[0] if m[0][-1] == "}" else m[0].upper(), text)


class _Capitals(ast.NodeTransformer):
    """Puts the sentences of a module into capitals; docstrings and patterns stay."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST:
        return node if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        function = node.func
        is_re = isinstance(function, ast.Attribute) and getattr(function.value, "id", "") == "re"
        return node if is_re else self.generic_visit(node)

    def visit_FormattedValue(self, node: ast.FormattedValue) -> ast.AST:
        node.value = self.visit(node.value)
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str) and SENTENCE.match(node.value):
            return ast.copy_location(ast.Constant(_upper(node.value)), node)
        return node


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name: str, _path: object, _target: object = None) -> Any:
        parts = name.split(".")
        if parts[0] != "fsoe_net" or len(parts) < 3 or parts[1] in SYNTAX:
            return None
        place = PACKAGE.joinpath(*parts[1:]).with_suffix(".py")
        if not place.is_file():
            return None
        loader = _Loader(name, str(place))
        return importlib.util.spec_from_file_location(name, place, loader=loader)


class _Loader(importlib.machinery.SourceFileLoader):
    def get_code(self, _fullname: str) -> Any:
        tree = ast.parse(Path(self.path).read_bytes())
        return compile(ast.fix_missing_locations(_Capitals().visit(tree)), self.path, "exec")


def in_capitals(value: Any) -> Any:
    """Return a document of the C core with its texts in capitals."""
    if isinstance(value, list):
        return [in_capitals(v) for v in value]
    if isinstance(value, dict):
        return {
            k: v.upper() if k in TEXTS and isinstance(v, str) else in_capitals(v)
            for k, v in value.items()
        }
    return value


def causes(capitals: bool) -> tuple[Any, str]:
    """Return key and score of each cause of seeded failures, and the words for the last one."""
    from incident.rig import edited, read
    from incident.seeds_start import START
    from incident.seeds_tried import TRIED
    from incident.seeds_wiring import WIRING

    from fsoe_net.incident.causes import judge

    found = {}
    some = [
        *START.items(),
        *itertools.islice(TRIED.items(), 6),
        *itertools.islice(WIRING.items(), 6),
    ]
    for name, (seed, _) in some:
        with tempfile.TemporaryDirectory() as folder:
            path = seed(Path(folder))
            if capitals:
                path = edited(path, lambda head: head.update(in_capitals(head)))
            verdicts = judge(read(path))
            rows = [verdicts.likely, *verdicts.others]
            found[name] = [(c.key, c.score) for c in rows if c is not None]
    return found, verdicts.likely.title


def reports() -> Any:
    """Return what a sign-off takes from reports: without and with evidence, untried and tried."""
    from acceptance.signed import filled, source
    from report.made import TIMED, inputs_of

    from fsoe_net.acceptance.signed_report import read_signed_report
    from fsoe_net.report.compose import compose_report
    from fsoe_net.report.evidence import Evidence
    from fsoe_net.report.formats import render_report
    from fsoe_net.report.inputs import Tried
    from fsoe_net.test_record.steps import make_test_record

    bare = inputs_of(TIMED)
    test_record = make_test_record(bare.resolution, b"")
    tried = replace(bare, tried=Tried(source=source("p.yaml"), test_record=filled(test_record)))
    at_machine = replace(tried, evidence=(Evidence(source=source("scan.json"), scan=_scan()),))
    found = []
    for inputs in (bare, tried, at_machine):
        signed = read_signed_report([(source("r.json"), render_report(inputs, "json").encode())])
        verdict = compose_report(inputs).verdict.level.value
        rows = (signed.of_machine, signed.open_points, signed.assumptions, bool(signed.against))
        found.append([*rows, verdict])
    return found


def _scan() -> Any:
    from fsoe_net.diag.diagnostic import Span
    from fsoe_net.model.scan import Scan

    return Scan(span=Span("scan.json"), interface="eth1", subdevices=())


def sign_offs() -> Any:
    """Return how many refusals a sign-off has with one ground after the other taken away."""
    from acceptance.signed import grounds_of, report_with, signed_report

    from fsoe_net.acceptance.sign_off import sign_off

    grounds = grounds_of()
    unread = replace(grounds, report=signed_report(report_with(of_machine=False)))
    return [len(sign_off(g)[1]) for g in (grounds, unread, replace(grounds, equipment=()))]


def events() -> Any:
    """Return kind and end of each event of a run with a fault, and which a person reads."""
    from networks import example

    from fsoe_net.cli.run_output import interesting
    from fsoe_net.project.simulate import simulate
    from fsoe_net.studio.live_rows import event_row

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.yaml"
        path.write_text(
            "version: 1\nduration_s: 0.9\nsteps:\n  - {at_ms: 500, break: ek1914}\n", "utf-8"
        )
        run = simulate(example("estop"), scenario_file=str(path))
    rows = [event_row(e) for e in run.events]
    return [
        [[row["kind"], row["end"]] for row in rows],
        [run.events.index(e) for e in interesting(run.events)],
    ]


def steps() -> Any:
    """Return the steps that a change of a connection, of a name and of a signal call for again."""
    from report.made import BASE, TIMED, inputs_of

    from fsoe_net.compare.diff import compare
    from fsoe_net.compare.sides import side_of_network
    from fsoe_net.report.steps_to_repeat import steps_to_repeat
    from fsoe_net.test_record.steps import make_test_record

    before = inputs_of(TIMED).resolution
    found = []
    edits = (("connection_id: 11", "connection_id: 12"), ("name: estop", "name: stop"))
    for old, new in edits:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "now.yaml"
            text = TIMED.read_text("utf-8").replace("devices/", f"{BASE}/devices/")
            path.write_text(text.replace(old, new), "utf-8")
            now = inputs_of(path).resolution
        changes = compare(side_of_network(before, "a"), side_of_network(now, "b")).changes
        again = steps_to_repeat(changes, now, make_test_record(now, b"").steps)
        found.append([step.lower() for step in again])
    return found


def main() -> None:
    capitals = sys.argv[1:] == ["capitals"]
    sys.path.insert(0, str(TESTS))
    if capitals:
        sys.meta_path.insert(0, _Finder())
    keys, title = causes(capitals)
    found = {
        "title": title,
        "causes": keys,
        "reports": reports(),
        "sign-offs": sign_offs(),
        "events": events(),
        "steps": steps(),
    }
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
