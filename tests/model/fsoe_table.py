"""Reads tests/model/fsoe_pdos.tsv, and entry lists in its notation."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from fsoe_net.model.bus import Direction, Entry, Pdo

WORD = re.compile(r"(?:-|(\w{4}):(\w\w)(?:-(\w\w))?)/(\d+)(?:x(\d+))?(?:=(.*))?\Z")


@dataclass(frozen=True)
class Row:
    device: str
    direction: Direction
    pdo: Pdo
    frame_bytes: int


def entries(text: str) -> tuple[Entry, ...]:
    """Read ``6000:01/8=Name_of_it``; ``_`` is a blank in a name."""
    found = []
    for word in text.split():
        index, low, high, bits, times, name = WORD.match(word).groups()
        subs = range(int(low or "0", 16), int(high or low or "0", 16) + 1)
        found += [
            Entry(
                index=int(index or "0", 16),
                subindex=sub,
                bits=int(bits),
                name=(name or "").replace("_", " "),
            )
            for sub in subs
            for _ in range(int(times or 1))
        ]
    return tuple(found)


def pdo(text: str, *, index: int = 0x1A00, name: str = "") -> Pdo:
    return Pdo(index=index, entries=entries(text), name=name)


def rows() -> list[Row]:
    lines = Path(__file__).with_name("fsoe_pdos.tsv").read_text("utf-8").splitlines()
    table = []
    for line in lines:
        if not line.startswith("#"):
            device, way, index, size, text = line.split("\t")
            direction = Direction.OUTPUT if way == "out" else Direction.INPUT
            table.append(Row(device, direction, pdo(text, index=int(index, 16)), int(size)))
    return table
