"""The fuzz bodies without a fuzzer: good inputs, then the same mutations of them every time."""

from __future__ import annotations

import os
import random

import pytest
from fuzz import bodies
from fuzz.bodies import TARGETS, mutated

from fsoe_net.formats.registry import all_formats

ROUNDS = int(os.environ.get("FSN_FUZZ_MUTATIONS", "60"))


@pytest.mark.shows("R7")
@pytest.mark.parametrize("name", TARGETS)
def test_mutated_inputs_are_read_or_refused(name, tmp_path):
    target = TARGETS[name]
    target.prepare(tmp_path)
    seeds = target.seeds()
    assert seeds
    for seed in seeds:
        target.run(seed, tmp_path)
    dice = random.Random(name)  # seeded by the text, the same on every machine
    for number in range(ROUNDS):
        data = mutated(seeds[number % len(seeds)], dice)
        try:
            target.run(data, tmp_path)
        except Exception as exc:
            raise AssertionError(f"{name}, mutation {number}: {data[:2000]!r}") from exc


def test_the_reader_of_each_format_has_a_target():
    readers = {f.kind: f.read.partition(":")[2] for f in all_formats().values() if f.read}
    assert [kind for kind, name in readers.items() if not hasattr(bodies, name)] == []
    assert "soem" in readers
