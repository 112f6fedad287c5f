"""Statistics of a campaign: the plausible range of a number of rare events."""

from __future__ import annotations

import math

CONFIDENCE = 0.99


def count_interval(mean: float, confidence: float = CONFIDENCE) -> tuple[int, int]:
    """Return the fewest and most events that are plausible when ``mean`` are expected.

    Each tail outside has at most half of ``1 - confidence``. Rare independent events follow a
    Poisson distribution; at a probability of 2^-16, each of its probabilities differs from the
    binomial distribution by less than 2^-16.

    Args:
        mean: Expected number, at least 0.
        confidence: Share of campaigns that end inside, at least.
    """
    if mean <= 0:
        return 0, 0
    tail = (1 - confidence) / 2
    low, n, below = 0, 0, 0.0  # ``below``: probability of fewer than n events
    while True:
        # In logarithms: the factorial of a large number does not fit into a float.
        up_to = below + math.exp(n * math.log(mean) - mean - math.lgamma(n + 1))
        if below <= tail:
            low = n
        if n >= mean and 1 - up_to <= tail:
            return low, n
        below, n = up_to, n + 1
