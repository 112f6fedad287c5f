"""A failed test says the one command that repeats it, with what Hypothesis drew."""

from __future__ import annotations

import random
import shlex
from collections.abc import Generator

import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Draw the seed here: one that Hypothesis draws by itself is told for few failures only."""
    if config.option.hypothesis_seed is None:
        config.option.hypothesis_seed = str(random.SystemRandom().randrange(1 << 32))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.failed:
        words = ["python", "-m", "pytest", item.nodeid]
        if getattr(getattr(item, "obj", None), "is_hypothesis_test", False):
            words.append(f"--hypothesis-seed={item.config.option.hypothesis_seed}")
        report.sections.append(("to repeat it", shlex.join(words)))
    return report
