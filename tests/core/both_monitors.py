"""The monitor in C and the one in Python, given the same frames."""

from __future__ import annotations

from fsoe_net.core.monitor import CoreMonitor
from fsoe_net.fsoe.monitor import Monitor

TO_SUB, TO_MAIN = 0, 1


class Both:
    """Feeds both monitors and compares all they know."""

    def __init__(self, out, inn):
        self.python, self.c = Monitor(out, inn), CoreMonitor(out, inn)
        self.now_ns = 0
        self.seen = []

    def frame(self, direction, data):
        self.now_ns += 1_000_000
        verdict = self.python.frame(direction, data, self.now_ns)
        assert self.c.frame(direction, data, self.now_ns) is verdict
        for way in (TO_SUB, TO_MAIN):
            assert self.c.counts(way) == self.python.counts(way)
            assert self.c.sequence(way) == self.python.sequence(way)
        assert (self.c.state, self.c.gaps) == (self.python.state, self.python.gaps)
        assert self.c.parameters == self.python.parameters
        self.seen.append(verdict)
        return verdict
