"""Reports of a fault campaign: a document for people, and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fsoe_net.campaign.bit_errors import code_distance
from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.trials import EXHAUSTIVE, ClassResult
from fsoe_net.document.model import (
    Bullets,
    Column,
    Document,
    Level,
    Lines,
    Part,
    Table,
    Verdict,
    cell,
)
from fsoe_net.fsoe.pdu import reset_code_text
from fsoe_net.simulate.campaign import CampaignResult
from fsoe_net.version import __version__

Saved = Mapping[tuple[str, int], str]
"""Recordings of failing cases: class and trial, file."""

_CLASSES = (
    Column("class"),
    Column("injected", number=True, rank=5),
    Column("detected", number=True, rank=6),
    Column("tolerated", number=True, rank=2),
    Column("collisions", number=True, rank=3),
    Column("plausible", number=True, rank=7),
    Column("wrong", number=True, rank=1),
    Column("latency mean", number=True, rank=8),
    Column("max", number=True, rank=4),
    Column("max / watchdog", number=True, rank=9),
)
_CONNECTIONS = (
    Column("connection"),
    *(
        Column(title, number=True, rank=rank)
        for rank, title in enumerate(
            ("ConnID", "address", "bytes out", "bytes in", "watchdog", "bus cycle"), 1
        )
    ),
)


def to_json(result: CampaignResult, saved: Saved | None = None) -> dict[str, Any]:
    """Return the report as documented in ``docs/reference/json-output.md``."""
    return {
        "tool": "fsoe-net",
        "version": __version__,
        "seed": result.config.seed,
        "faults_per_class": result.faults,
        "passed": result.passed and not result.interrupted,
        "interrupted": result.interrupted,
        "connections": [
            {
                "name": link.name,
                "connection_id": link.main.connection_id,
                "address": link.main.address,
                "safe_out_bytes": link.sizes[0],
                "safe_in_bytes": link.sizes[1],
                "watchdog_ms": link.main.watchdog_ms,
                "bus_cycle_us": link.cycle_ns / 1000,
            }
            for link in result.config.links
        ],
        "classes": [_class_json(row, saved or {}) for row in result.classes],
    }


def _class_json(row: ClassResult, saved: Saved) -> dict[str, Any]:
    interval = row.interval
    return {
        "name": row.name,
        "kind": _kind(row.name),
        "exhaustive": row.name == EXHAUSTIVE,
        "injected": row.injected,
        "detected": row.detected,
        "tolerated": row.tolerated,
        "collisions": row.collisions,
        "wrongly_accepted": row.wrongly_accepted,
        "wrong_reactions": row.wrong_reactions,
        "most_tolerated": row.most_tolerated,
        "exposed": row.exposed,
        "exposed_collisions": row.exposed_collisions,
        "expected_collisions": round(row.expected, 9),
        "plausible_collisions": list(interval) if interval else None,
        "rate_ok": row.rate_ok,
        "passed": row.passed,
        "reset_codes": {str(code): row.codes[code] for code in sorted(row.codes) if code >= 0},
        "detected_without_code": row.codes[-1],
        "latency_ms": {
            "min": None if row.latency_min_ns is None else row.latency_min_ns / 1e6,
            "mean": _mean_ms(row),
            "max": row.latency_max_ns / 1e6 if row.detected else None,
        },
        "latency_max_of_watchdog": round(row.latency_max_share, 6) if row.detected else None,
        "failures": [
            {
                "trial": failure.trial,
                "connection": failure.link,
                "reason": failure.reason,
                "trace": saved.get((row.name, failure.trial)),
            }
            for failure in row.failures
        ],
        "shown_collisions": [
            {
                "trial": shown.trial,
                "connection": shown.link,
                "end": shown.proof.end,
                "accepted": shown.proof.frame.hex(),
                "sent": shown.proof.right.hex(),
                "old_crc": f"{shown.proof.old_crc:04x}",
                "sequence": shown.proof.sequence,
            }
            for shown in row.shown
        ],
    }


def _kind(name: str) -> str:
    return " + ".join(dict.fromkeys(CATALOGUE[part].kind for part in name.split("+")))


def _mean_ms(row: ClassResult) -> float | None:
    return round(row.latency_sum_ns / row.detected / 1e6, 6) if row.detected else None


def _cells(row: ClassResult) -> list[str]:
    interval = row.interval
    mean = _mean_ms(row)
    plausible = "-"
    # If the probability of a collision is unknown, no interval is shown.
    if interval is not None:
        plausible = str(interval[0]) if interval[0] == interval[1] else "{}..{}".format(*interval)
    collisions = str(row.collisions)
    # Only faults that nothing but the CRC can detect are compared with its probability.
    if interval is not None and row.collisions != row.exposed_collisions:
        collisions += f" ({row.exposed_collisions} of them counted)"
    return [
        row.name,
        str(row.injected),
        str(row.detected),
        str(row.tolerated) + ("" if row.tolerated <= row.most_tolerated else " !"),
        collisions,
        plausible + ("" if row.rate_ok else " !"),
        str(row.failed),
        "-" if mean is None else f"{mean:.2f} ms",
        f"{row.latency_max_ns / 1e6:.1f} ms" if row.detected else "-",
        f"{row.latency_max_share:.2f}" if row.detected else "-",
    ]


def campaign_document(result: CampaignResult, saved: Saved | None = None) -> Document:
    """Return the report for people."""
    connections = tuple(
        (
            cell(link.name),
            cell(str(link.main.connection_id)),
            cell(str(link.main.address)),
            cell(str(link.sizes[0])),
            cell(str(link.sizes[1])),
            cell(f"{link.main.watchdog_ms} ms"),
            cell(f"{link.cycle_ns / 1e6:g} ms"),
        )
        for link in result.config.links
    )
    classes = tuple(tuple(cell(text) for text in _cells(row)) for row in result.classes)
    codes = tuple((cell(r.name), cell(_codes(r))) for r in result.classes if r.detected)
    parts: list[Part] = [
        Table(name="connections", columns=_CONNECTIONS, rows=connections),
        Table(name="classes", columns=_CLASSES, rows=classes),
        Table(
            name="codes",
            columns=(Column("class"), Column("detected by", wraps=True)),
            rows=codes,
        ),
        Bullets(tuple(cell(note) for note in _notes(result))),
    ]
    failures = _failures(result, saved or {})
    if failures:
        parts.append(Lines(tuple(failures)))
    return Document(
        title="Fault campaign",
        subtitle=f"seed {result.config.seed}, {result.faults} faults per class",
        version=__version__,
        verdict=_verdict(result),
        lead=tuple(parts),
    )


def _codes(row: ClassResult) -> str:
    parts = [
        f"{count} x {'new Session or silence' if code < 0 else reset_code_text(code)}"
        for code, count in row.codes.most_common()
    ]
    return ", ".join(parts)


def _notes(result: CampaignResult) -> list[str]:
    exposed = sum(row.exposed for row in result.classes)
    lines = [
        "tolerated: no end had to notice (the same bytes again, a gap shorter than the watchdog).",
        "collisions: accepted because every CRC fits by accident, each shown by computing them; "
        f"plausible: 99 % interval of their number among the {exposed} faults against which only "
        "the CRC helps and whose chance is known.",
        "wrong: accepted without such an accident, or an end did otherwise than its state table: "
        "no Reset, another code, too early, too late.",
        "latency: from the first wrong image to the frame by which an end leaves; 0 when it is "
        "refused in the call that reads it.",
    ]
    for row in result.classes:
        # The exhaustive class does not depend on the number of cycles; otherwise a reader might
        # doubt it.
        if row.name == EXHAUSTIVE:
            distance = min(
                code_distance(min(size, 2)) for link in result.config.links for size in link.sizes
            )
            lines.append(
                f"{EXHAUSTIVE}: all patterns of 1 to {distance - 1} bits in a block, all of 1 and "
                "2 bits in a frame, whatever the number of cycles."
            )
    lines += [
        f"{row.name}: {row.tolerated} of {row.injected} tolerated, this class leaves at most "
        f"{row.most_tolerated}: an end does not notice what it has to"
        for row in result.classes
        if row.tolerated > row.most_tolerated
    ]
    return lines + [_rate_note(row) for row in result.classes if not row.rate_ok]


def _failures(result: CampaignResult, saved: Saved) -> list[str]:
    lines = []
    for row in result.classes:
        for failure in row.failures:
            lines.append(f"{row.name}, trial {failure.trial}, {failure.link}: {failure.reason}")
            trace = saved.get((row.name, failure.trial))
            if trace is not None:
                lines.append(f"  -> {trace}")
    return lines


def _rate_note(row: ClassResult) -> str:
    if row.name == EXHAUSTIVE:
        return f"{row.name}: {row.collisions} collisions where the code allows none"
    return (
        f"{row.name}: {row.exposed_collisions} collisions, {row.expected:.2f} expected; by chance "
        "that happens once in 100 classes: try another seed and more cycles"
    )


def _verdict(result: CampaignResult) -> Verdict:
    rows = result.classes
    parts = [
        f"{count} {what}"
        for what, count in (
            ("wrongly accepted", sum(row.wrongly_accepted for row in rows)),
            ("wrong reactions", sum(row.wrong_reactions for row in rows)),
        )
        if count
    ]
    # More tolerated faults than the class allows mean that an end misses errors.
    if any(row.tolerated > row.most_tolerated for row in rows):
        parts.append("more tolerated than the catalogue allows")
    # Too few collisions are as suspicious as too many: the injection may miss its target.
    if not all(row.rate_ok for row in rows):
        parts.append("collisions are not as many as the CRC allows")
    if parts:
        return Verdict(f"FAILED: {', '.join(parts)}", Level.ERROR)
    if result.interrupted:
        return Verdict("incomplete: nothing wrongly accepted so far", Level.OPEN)
    return Verdict("passed: nothing wrongly accepted, every reaction right", Level.CLEAR)
