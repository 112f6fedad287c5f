"""Tests that run in real time come first: what only computes gets a lower priority.

A bus that waits for a processor runs, and is watched, for longer, so it also costs more of them.
The priority is that of the thread that runs the tests, and of the programs that they start.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

_TESTS = Path(__file__).parent
_COMPUTING = {
    *("acceptance", "campaign", "compare", "diagnostics", "document", "formats", "fsoe"),
    *("incident", "intervention_log", "model", "plan", "project", "proposal", "report"),
    *("rules", "timing"),
}
_LOWER = 10
_CAP_SYS_NICE = 23  # without this capability a thread cannot raise its priority again
_capabilities = re.search(r"^CapEff:\s*(\w+)", Path("/proc/self/status").read_text(), re.MULTILINE)
_MAY_RAISE = bool(_capabilities and int(_capabilities[1], 16) >> _CAP_SYS_NICE & 1)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Lower the priority for a test that only computes."""
    if not _MAY_RAISE or item.path.relative_to(_TESTS).parts[0] not in _COMPUTING:
        return (yield)
    before = os.getpriority(os.PRIO_PROCESS, 0)
    os.setpriority(os.PRIO_PROCESS, 0, before + _LOWER)
    try:
        return (yield)
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)
