"""Results as documents: one, or two next to each other."""

from __future__ import annotations

import statistics

from fsoe_net.bench.result import (
    BUSY_SHARE,
    LEAST_FREE_SHARE,
    MOST_ADDED_NS,
    BenchResult,
    Loop,
    Measured,
)
from fsoe_net.diag.words import counted
from fsoe_net.document.model import Cell, Column, Document, Level, Part, Table, Verdict, cell, words

_NAMES = {
    Measured.TIMER: "empty timer, wake-up late",
    Measured.WAKE_UP: "cycle, wake-up late",
    Measured.WORK: "cycle, execution time",
    Measured.COPY: "cycle, copies alone",
    Measured.MONITORED_WAKE_UP: "with a monitor, wake-up late",
    Measured.MONITORED_WORK: "with a monitor, execution time",
    Measured.CLIENT: "real-time client in Python, after the start of the cycle",
    Measured.WIRE_BARE: "wire, bare send() and recv()",
    Measured.WIRE_SOEM: "wire, SOEM's own loop",
    Measured.WIRE_CORE: "wire, cycle: receive, copy, send",
    Measured.WIRE_XDP: "wire, the same with --xdp",
    Measured.WIRE_ROUND_TRIP: "wire, round trip of a frame of the cycle",
}
_LOOPS = {
    Loop.BARE: "bare send() and recv()",
    Loop.SOEM: "SOEM's own loop",
    Loop.CORE: "fsn-master's cycle",
    Loop.XDP: "fsn-master's cycle, --xdp",
}
_HEADS = ("50 %", "99 %", "99.9 %", "most")
_NOTE = (
    "Rows without a wire: in memory, on the emulated bus of fsn-master. The figures describe this "
    "machine at this time. They are not a bound and not a safety statement."
)
_NOT_ON_A_WIRE = "Not measured: frames on a wire. fsoe-net bench --wire measures them as root."
_PAIR = (
    "Wire: a veth pair with emulated SubDevices on the same processor, without a network card. The "
    "loops took turns."
)
_INTERFACE = (
    "Wire: {}, with one NOP datagram in each frame, which no SubDevice executes. The cycle of "
    "fsn-master was not measured there, because it would change states of SubDevices."
)


def bench_document(result: BenchResult) -> Document:
    """Return the document of a result."""
    rows = tuple(
        (cell(_NAMES[name]), *(cell(_us(ns)) for ns in _times(result, name)), _count(result, name))
        for name in Measured
        if name in result.times
    )
    columns = (
        Column("times in us"),
        *(Column(head, number=True) for head in _HEADS),
        Column("times", number=True, rank=1),
    )
    rate = f"Emulator in virtual time: {result.emulated_per_s:.0f} bus cycles per second."
    return Document(
        title="Measurement of a machine",
        subtitle=f"{result.utc}, cycle {result.cycle_ns / 1e6:g} ms",
        version=result.version,
        lead=(
            *_machine("", result),
            Table(name="times", columns=columns, rows=rows),
            words(rate),
            words(_NOTE, note=True),
            *_wire(result),
        ),
    )


def _goals(result: BenchResult) -> tuple[tuple[Cell, ...], ...]:
    """Return a row for each figure that has a goal: the figure, the goal, and whether it is met."""
    return (
        *_goals_of(result, Measured.WIRE_CORE, Loop.CORE, ""),
        *_goals_of(result, Measured.WIRE_XDP, Loop.XDP, "--xdp: "),
    )


def _goals_of(
    result: BenchResult, cycle: Measured, loop: Loop, name: str
) -> tuple[tuple[Cell, ...], ...]:
    added_ns = result.added_ns(cycle)
    share = None if result.wire is None else result.wire.free_share(loop)
    if share is None or added_ns is None:
        return ()
    return (
        _goal(
            f"{name}added to bare send() and recv(), 50 %",
            f"{_us(added_ns)} us",
            f"<= {_us(MOST_ADDED_NS)} us",
            added_ns <= MOST_ADDED_NS,
        ),
        _goal(
            f"{name}free rate, of bare send() and recv()",
            f"{share:.3f}",
            f">= {LEAST_FREE_SHARE}",
            share >= LEAST_FREE_SHARE,
        ),
    )


def _goal(name: str, figure: str, goal: str, is_met: bool) -> tuple[Cell, ...]:
    verdict = Verdict("met", Level.CLEAR) if is_met else Verdict("not met", Level.WARNING)
    return (cell(name), cell(figure), cell(goal), (verdict,))


def _wire(result: BenchResult) -> list[Part]:
    wire = result.wire
    if wire is None:
        return [words(_NOT_ON_A_WIRE, note=True)]
    loops = [
        (
            cell(_LOOPS[loop]),
            cell(f"{statistics.median(wire.free[loop].per_s):.0f}" if wire.free else "-"),
            cell(str(cycles.incomplete + (wire.free[loop].incomplete if wire.free else 0))),
            cell(str(cycles.left_out)),
        )
        for loop, cycles in wire.paced.items()
    ]
    heads = ("free, cycles/s", "incomplete", "left out")
    columns = (Column("loop"), *(Column(head, number=True) for head in heads))
    parts: list[Part] = [Table(name="loops", columns=columns, rows=tuple(loops))]
    if rows := _goals(result):
        columns = (Column("figure"), *(Column(h) for h in ("measured", "goal", "verdict")))
        parts.append(Table(name="goals", columns=columns, rows=rows))
    note = _INTERFACE.format(wire.interface) if wire.interface else _PAIR
    return [*parts, words(note, note=True)]


def comparison_document(first: BenchResult, second: BenchResult) -> Document:
    """Return two results next to each other; the factor is that of the second."""
    rows = []
    for name in Measured:
        if name in first.times and name in second.times:
            a, b = first.times[name], second.times[name]
            pairs = ((a.p50_ns, b.p50_ns), (a.p999_ns, b.p999_ns), (a.max_ns, b.max_ns))
            rows.append((cell(_NAMES[name]), *(c for pair in pairs for c in _pair(*pair))))
    heads = [
        f"{head} {side}" for head in ("50 %", "99.9 %", "most") for side in ("A", "B", "B / A")
    ]
    columns = (Column("times in us"), *(Column(head, number=True) for head in heads))
    return Document(
        title="Two measurements",
        subtitle=f"A {first.utc}, B {second.utc}",
        version=second.version,
        lead=(
            *_machine("A: ", first),
            *_machine("B: ", second),
            *_differences(first, second),
            Table(name="comparison", columns=columns, rows=tuple(rows)),
        ),
    )


def _machine(name: str, result: BenchResult) -> list[Part]:
    host = result.host
    priority = "real-time priority" if host.realtime else "no real-time priority"
    parts: list[Part] = [
        words(
            f"{name}{host.processor or 'unknown processor'}, {counted(host.cpus, 'CPU')}, Linux "
            f"{host.kernel}, {priority}, {counted(host.warnings, 'warning')} of fsoe-net doctor"
        )
    ]
    if host.is_busy:
        text = (
            f"{name}busy: other processes used {host.others_share:.0%} of the processors (limit "
            f"{BUSY_SHARE:.0%}); repeat the measurement on an idle machine"
        )
        parts.append(words(Verdict(text, Level.WARNING)))
    return parts


def _differences(first: BenchResult, second: BenchResult) -> list[Part]:
    """Name what makes the two hard to compare."""
    parts = []
    if first.cycle_ns != second.cycle_ns:
        parts.append("the cycles differ")
    if first.host.realtime != second.host.realtime:
        parts.append("only one has real-time priority")
    if first.version != second.version:
        parts.append("the versions of fsoe-net differ")
    return [words(Verdict(f"Compare with care: {part}", Level.WARNING)) for part in parts]


def _times(result: BenchResult, name: Measured) -> tuple[int, ...]:
    times = result.times[name]
    return (times.p50_ns, times.p99_ns, times.p999_ns, times.max_ns)


def _count(result: BenchResult, name: Measured) -> Cell:
    return cell(str(result.times[name].count))


def _pair(first_ns: int, second_ns: int) -> tuple[Cell, Cell, Cell]:
    factor = f"{second_ns / first_ns:.2f}" if first_ns else "-"
    return cell(_us(first_ns)), cell(_us(second_ns)), cell(factor)


def _us(ns: int) -> str:
    return f"{ns / 1000:.1f}"
