"""The fuzz bodies without a fuzzer: good inputs, then the same mutations of them every time."""

from __future__ import annotations

import os
import random

import pytest
from fuzz.bodies import TARGETS, mutated

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
