"""What both halves of `scripts/mutate` share: a mutant, a seeded draw, the results file.

A half is a module with

    PARTS: dict[str, ...]                         its parts by name
    ask_quick_tests_only() -> None                for CI's small sample: some parts may go
    mutants(part, root) -> list[Mutant]           all of them, in an order that never changes
    class Runner(part, work, root):               one for each job, with a folder of its own
        run(mutant) -> "killed" | "survived" | "invalid"
        close() -> None
"""

from __future__ import annotations

import json
import math
import random
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import yaml

KILLED, SURVIVED, INVALID = "killed", "survived", "invalid"
RESULTS = "tests/mutation.yaml"
# A line with mutants that cannot change behaviour says why, in Python or C.
LEFT_OUT = re.compile(r"(#|/\*) mutants: \w")
CHANCE = 0.001


@dataclass(frozen=True)
class Mutant:
    """One change of one file; `before`, `after`: the changed lines, `source`: the whole file."""

    path: str
    line: int
    operator: str
    before: str
    after: str
    source: str

    def __str__(self) -> str:
        return (
            f"{self.path}:{self.line} {self.operator}\n"
            + textwrap.indent(self.before, "  - ", lambda _: True)
            + "\n"
            + textwrap.indent(self.after, "  + ", lambda _: True)
        )


def left_out(line: str) -> bool:
    """Return whether the line says that its mutants cannot change behaviour."""
    return LEFT_OUT.search(line) is not None


def changed_lines(old: str, new: str) -> tuple[int, str, str]:
    """Return the number of the first changed line, the lines before and the lines after."""
    a, b = old.splitlines(), new.splitlines()
    head = 0
    while head < min(len(a), len(b)) and a[head] == b[head]:
        head += 1
    tail = 0
    while tail < min(len(a), len(b)) - head and a[-1 - tail] == b[-1 - tail]:
        tail += 1
    return head + 1, "\n".join(a[head : len(a) - tail]), "\n".join(b[head : len(b) - tail])


def drawn(mutants: list[Mutant], seed: int) -> Iterator[Mutant]:
    """Yield the mutants in an order that the seed decides, each change of a text once."""
    order = sorted(mutants, key=lambda m: (m.path, m.line, m.operator, m.after))
    random.Random(seed).shuffle(order)
    seen: set[tuple[str, int, str]] = set()
    for mutant in order:
        key = (mutant.path, mutant.line, mutant.after)
        if key not in seen:
            seen.add(key)
            yield mutant


@dataclass
class Score:
    """What became of the mutants of one part."""

    part: str
    seed: int
    killed: int = 0
    survivors: list[Mutant] = field(default_factory=list)

    @property
    def number(self) -> int:
        """How many were run."""
        return self.killed + len(self.survivors)

    @property
    def percent(self) -> float:
        """How many of 100 were killed."""
        return 100 * self.killed / self.number if self.number else 100.0

    def below(self, floor: float) -> bool:
        """Whether so few of a sample are hardly killed by chance where `floor` of 100 are."""
        share = min(floor, 100.0) / 100
        at_most = sum(
            math.comb(self.number, k) * share**k * (1 - share) ** (self.number - k)
            for k in range(self.killed + 1)
        )
        return self.percent < floor and at_most < CHANCE

    def __str__(self) -> str:
        return (
            f"{self.part}: {self.percent:.1f} % of {self.number} mutants killed, "
            f"{len(self.survivors)} survived (seed {self.seed})"
        )

    def write(self, folder: Path) -> Path:
        """Write PART.json and PART.txt with each survivor; returns the text's path."""
        folder.mkdir(parents=True, exist_ok=True)
        names = ("path", "line", "operator", "before", "after")
        document = {
            **self.entry(),
            "survivors": [{name: getattr(m, name) for name in names} for m in self.survivors],
        }
        (folder / f"{self.part}.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
        text = folder / f"{self.part}.txt"
        ordered = sorted(self.survivors, key=lambda m: (m.path, m.line))
        text.write_text("\n".join([str(self), *map(str, ordered)]) + "\n", "utf-8")
        return text

    def entry(self) -> dict[str, float]:
        """Return what the results file keeps."""
        return {
            "seed": self.seed,
            "mutants": self.number,
            "killed": self.killed,
            "survived": len(self.survivors),
            "score": round(self.percent, 1),
        }


def last_run(folder: Path, part: str) -> tuple[Score, dict[str, bool]]:
    """Return the killed mutants of the last run of a part, and the survivors by what is printed."""
    document = json.loads((folder / f"{part}.json").read_text("utf-8"))
    survivors = [Mutant(**row, source="") for row in document["survivors"]]
    score = Score(part, document["seed"], killed=document["killed"])
    return score, dict.fromkeys(map(str, survivors), True)


def read_results(root: Path) -> dict[str, dict[str, float]]:
    """Return the results by part, each with its `floor`; empty without a file."""
    path = root / RESULTS
    return yaml.safe_load(path.read_text("utf-8")) or {} if path.is_file() else {}


def keep_result(root: Path, score: Score) -> None:
    """Put the score in the results file; the floor may rise, a person lowers it by hand."""
    path = root / RESULTS
    head = [x for x in path.read_text("utf-8").splitlines() if x.startswith("#")]
    results = read_results(root)
    # Another seed draws other mutants: two points are chance.
    floor = max(results.get(score.part, {}).get("floor", 0), math.floor(score.percent) - 2)
    results[score.part] = {**score.entry(), "floor": floor}
    lines = [
        f"{part}: {{{', '.join(f'{k}: {v}' for k, v in entry.items())}}}"
        for part, entry in results.items()
    ]
    path.write_text("\n".join([*head, *lines]) + "\n", "utf-8")
