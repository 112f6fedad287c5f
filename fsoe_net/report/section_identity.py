"""Blocks 1 and 2: scope of this report, and its limits."""

from __future__ import annotations

from collections.abc import Sequence

from fsoe_net.document.model import (
    Bullets,
    Cell,
    Column,
    Heading,
    Level,
    Paragraph,
    Part,
    Table,
    Text,
    Verdict,
    cell,
    code,
    stated,
)
from fsoe_net.model.network import SourceFile
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.report.inputs import GivenPlan, ReportInputs
from fsoe_net.report.model import Point, ReportSection, open_point
from fsoe_net.report.self_test_result import self_test_parts

ROLE = (
    "The EtherCAT MainDevice is part of the black channel: it copies FSoE frames and takes no part "
    "in the safety function. This tool is not certified and is an off-line support tool; this "
    "report is evidence for a review, not a certificate. It is not for personnel protection by "
    "itself. The safety manuals of the devices prevail."
)


def _cycle(ns: int | None) -> Cell:
    return cell(stated(None if ns is None else ns / 1e6, "ms", "network file"))


def identity(inputs: ReportInputs) -> ReportSection:
    """Return machine, network, tool, files."""
    resolution = inputs.resolution
    network = None if resolution is None else resolution.network
    project = "" if network is None else network.project
    points = []
    # People sign for a machine: without its name, the report could belong to another one.
    if not project:
        points.append(open_point("the machine is not named; write project: in the network file"))
    rows: list[tuple[Cell, Cell]] = [
        (
            cell("Machine, project"),
            cell(project) if project else cell(Verdict("not stated", Level.OPEN)),
        ),
        (cell("Network"), cell(inputs.name)),
        (cell("Made with"), cell(f"fsoe-net {inputs.version}")),
    ]
    if resolution is not None:
        files = "network files"
        for what, count, unit in (
            ("SubDevices", len(resolution.network.subdevices), "SubDevices"),
            ("FSoE connections", len(resolution.connections), "connections"),
            ("Copies", len(resolution.transfers), "copies per bus cycle"),
        ):
            rows.append((cell(what), cell(stated(count, unit, files))))
    ns = None if network is None else network.cycle_ns
    rows.append((cell("Bus cycle"), _cycle(ns)))
    if network is not None:
        rows += [(cell(f"Bus {bus.name}"), _cycle(bus.cycle_ns)) for bus in network.buses]
    if ns is None:
        points.append(open_point("the bus cycle is not stated"))
    parts: list[Part] = [
        Table(name="identity", columns=(Column("What"), Column("Value")), rows=tuple(rows)),
        Heading("Input files"),
        files_table("input files", () if network is None else network.sources),
    ]
    if inputs.references:
        parts += [Heading("Compared with"), files_table("compared with", inputs.references)]
    if inputs.given is not None:
        parts += _given(inputs.given, inputs, points)
    if inputs.self_test is not None:
        shown, found = self_test_parts(inputs.self_test)
        parts += shown
        points += found
    return ReportSection(key="identity", title="Identity", parts=tuple(parts), points=tuple(points))


def _given(given: GivenPlan, inputs: ReportInputs, points: list[Point]) -> list[Part]:
    # Plans are compared by value: two files can differ only in bytes.
    same = inputs.plan is not None and given.plan == inputs.plan
    if same:
        verdict = Verdict("is the plan of these files", Level.CLEAR)
    elif inputs.plan is None:
        verdict = Verdict("not compared: these files make no plan", Level.OPEN)
    else:
        # The differing sections of the fingerprint show what has changed.
        changed = fingerprint_of(given.plan).changed(fingerprint_of(inputs.plan))
        where = f" (sections: {', '.join(changed)})" if changed else ""
        verdict = Verdict(f"is NOT the plan of these files{where}", Level.ERROR)
    # A plan file that was not compared, or differs, stays open until a person decides.
    if not same:
        points.append(open_point(f"{given.source.path} {verdict.word}"))
    row = (cell(code(given.source.path)), cell(code(given.source.sha256)), cell(verdict))
    columns = (Column("File"), Column("SHA-256"), Column("Verdict"))
    return [Heading("Plan file"), Table(name="plan file", columns=columns, rows=(row,))]


def files_table(name: str, files: Sequence[SourceFile]) -> Table:
    """Return files with their hashes."""
    return Table(
        name=name,
        columns=(Column("File"), Column("SHA-256")),
        rows=tuple((cell(code(f.path)), cell(code(f.sha256))) for f in files),
    )


def role(_: ReportInputs) -> ReportSection:
    """State the roles of the MainDevice and this tool, and their limits."""
    rows = (
        "Shown: which bytes are copied where, that each copy is whole and unmodified in the "
        "configuration, how watchdogs relate to the bus, what differs from what was compared.",
        "Not shown: whether the safety functions, the wiring and the safety project of each logic "
        "are the right ones; category, diagnostic coverage and common causes of the parts.",
        "Runs on an emulated bus are marked EMULATED and are not evidence for this machine.",
    )
    parts: tuple[Part, ...] = (
        Paragraph((Text(ROLE),), note=True),
        Bullets(tuple((Text(r),) for r in rows)),
    )
    return ReportSection(key="role", title="Role of the MainDevice and of this report", parts=parts)
