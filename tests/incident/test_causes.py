"""The cause of seeded failures is named first, without being told, and none where none is.

Run as a program it prints the table of confusions: ``python -m incidents.test_causes`` in tests/.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import pytest
from incident.rig import judged
from incident.seeds import NOTHING, SEEDS
from incident.seeds_tried import NAMED
from weekly import first

from fsoe_net.incident.causes_table import CAUSES

# Names of seeds: one of each cause, then the others.
OF_EACH_CAUSE = {wanted: name for name, (_, wanted) in reversed(SEEDS.items())}.values()
IN_TURN = sorted(SEEDS, key=lambda name: name not in OF_EACH_CAUSE)


@pytest.mark.shows("R21")
@pytest.mark.parametrize("name", first(len(OF_EACH_CAUSE), IN_TURN))
def test_the_cause_is_named_first(name, tmp_path):
    seed, wanted = SEEDS[name]
    found = judged(seed(tmp_path))
    assert found.likely is not None, found.others
    assert found.likely.key == wanted, (found.likely, [c.key for c in found.others])
    assert found.likely.evidence
    assert "{" not in found.likely.title + found.likely.measure + found.likely.change
    for device in NAMED.get(name, ()):
        assert device in found.likely.title


@pytest.mark.uncounted
@pytest.mark.shows("R21")
@pytest.mark.parametrize("name", NOTHING)
def test_nothing_is_named_where_nothing_is(name, tmp_path):
    found = judged(NOTHING[name](tmp_path))
    assert found.likely is None, found.likely


@pytest.mark.shows("R21")
def test_every_cause_has_a_seed():
    assert set(CAUSES) == {wanted for _, wanted in SEEDS.values()}


def confusion() -> int:
    """Print scenario x first cause."""
    wrong = 0
    rows = [(n, s, w) for n, (s, w) in SEEDS.items()] + [(n, s, "-") for n, s in NOTHING.items()]
    for name, seed, wanted in rows:
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = judged(seed(Path(folder)))
                first = f"{found.likely.key} {found.likely.score}" if found.likely else "-"
                rest = ", ".join(f"{c.key} {c.score}" for c in found.others)
            except AssertionError as exc:
                first, rest = "NO FILE", str(exc)[:200]
        good = first.split(" ")[0] == wanted
        wrong += not good
        print(  # noqa: T201 - the table is what it is run for
            f"{'  ' if good else '! '}{name:42} {wanted:24} {first:28} {rest}"
        )
    print(f"{len(rows) - wrong} of {len(rows)}")  # noqa: T201
    return wrong


if __name__ == "__main__":
    sys.exit(int(confusion() > 0))
