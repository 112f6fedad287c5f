"""A bus described by a capture, and what is expected of it."""

from __future__ import annotations

from formats.startup import (
    FRAMES,
)

from fsoe_net.capture.start_up import load_capture
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.shared.files import Collector


def read(data):
    out = Collector()
    content = load_capture(data, out)
    return content, [(d.code, d.level, d.span.line, d.message) for d in out.diagnostics]


def described(data):
    """Return a description that must be there, and the findings that are no mere notes."""
    content, found = read(data)
    assert content is not None, found
    return content, [row for row in found if row[1] is not Severity.INFO]


def layout(sub):
    """Return PDOs as object words, by sync manager."""
    return {
        sm.index: [
            (p.index, tuple(e.index << 16 | e.subindex << 8 | e.bits for e in p.entries))
            for p in sm.pdos
        ]
        for sm in sub.device.sync_managers
    }


def expected(station):
    outputs, inputs = FRAMES[station]
    return {2: [outputs], 3: [inputs]}
