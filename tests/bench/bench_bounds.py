"""Adversarial search of the bounds of `fsoe_net.timing`.

Prints the worst response of each attack, the bound and the share reached. Exit code 1 when a bound
that must hold is exceeded or less than 95 % of it is reached.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from signal_path.search import EXCEEDED, HANDSHAKE, PRINTED, Found
from signal_path.seeds import ATTACKS, KeptSearch, Schedule, pieces, run_all, worst_found

from fsoe_net.cli.progress import progress_bar
from fsoe_net.errors import FsnError

_GROUPS = (
    ("as printed, schedules restricted to what the formula leaves out", PRINTED, True),
    ("with the handshake of FSoE, schedules not restricted", HANDSHAKE, True),
    (
        "as printed, against the handshake: exceeded, see docs/explanation/timing.md",
        EXCEEDED,
        False,
    ),
)


def search(
    each: int, seeds: range, cluster: str | None, resume: Path | None
) -> tuple[dict[int, tuple[Found, int]], bool]:
    """Return the worst of each attack with its seed, and whether Ctrl-C ended the search."""
    work = pieces(each, seeds)
    number = {piece: index for index, piece in enumerate(work)}
    interrupted = False
    with (
        nullcontext() if resume is None else KeptSearch(resume, work) as kept,
        progress_bar("search") as bar,
    ):
        parts: dict[int, Schedule] = {} if kept is None else kept.parts
        left = [piece for piece in work if number[piece] not in parts]
        try:
            for piece, schedule in run_all(left, cluster):
                parts[number[piece]] = schedule
                if kept is not None:
                    kept.add(number[piece], schedule)
                if bar is not None:
                    bar(len(parts), len(work), ATTACKS[piece[0]].name)
        except KeyboardInterrupt:
            interrupted = True
    return worst_found({work[index]: part for index, part in parts.items()}), interrupted


def report(worst: dict[int, tuple[Found, int]], each: int, seeds: range) -> bool:
    """Print the worst of each attack; return whether all bounds that must hold are tight."""
    last = f" to {seeds[-1]}" if len(seeds) > 1 else ""
    at, tight = 0, True
    for title, group, must_hold in _GROUPS:
        print(f"{title}; {each} schedules each, seed {seeds[0]}{last}")
        for _ in group:
            if at in worst:
                found, seed = worst[at]
                held = found.worst <= found.bound + 1e-6
                print(
                    f"  {found.name:36} worst {found.worst:9.4f} ms  bound {found.bound:9.4f} ms "
                    f"{100 * found.share:7.2f} %{f'  seed {seed}' if last else ''}"
                    f"{'' if held else '  exceeded'}"
                )
                tight &= not must_hold or (held and found.share >= 0.95)
            at += 1
    return tight


def main() -> int:
    """Search and print; return the exit code."""

    def number(text: str) -> int:
        value = float(text)
        if not value.is_integer():
            raise ValueError
        return int(value)

    parser = argparse.ArgumentParser("scripts/bench bounds", description=__doc__)
    parser.add_argument("schedules", type=number, nargs="?", default=1_000_000, help="of one seed")
    parser.add_argument("seed", type=number, nargs="?", default=1)
    parser.add_argument("--seeds", type=number, default=1, help="how many, from SEED on")
    parser.add_argument("--cluster", metavar="ADDRESS", help="run on the workers of this scheduler")
    parser.add_argument("--resume", type=Path, metavar="FILE", help="keep completed work here")
    options = parser.parse_args()
    if options.seeds < 1:
        parser.error("--seeds must be 1 or more")
    each = max(1, options.schedules // len(ATTACKS))
    seeds = range(options.seed, options.seed + options.seeds)
    try:
        worst, interrupted = search(each, seeds, options.cluster, options.resume)
    except FsnError as exc:
        print(f"bench bounds: {exc}", file=sys.stderr)
        return 3
    tight = report(worst, each, seeds)
    if interrupted:
        print("interrupted: incomplete", file=sys.stderr)
        return 130
    return 0 if tight else 1


if __name__ == "__main__":
    sys.exit(main())
