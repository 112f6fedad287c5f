"""Shared settings: correctness tests have no time limits; a loaded machine is no failure.

What hangs is ended by the time-out of the suite (``pyproject.toml``), with what it was doing.
"""

import signal

import pytest
from count_child import count_confined_children
from hypothesis import HealthCheck, settings
from priority import pytest_runtest_protocol  # noqa: F401 - a hook
from repeat import pytest_cmdline_main, pytest_runtest_makereport  # noqa: F401 - hooks
from stuck import pytest_configure, pytest_timeout_set_timer  # noqa: F401 - hooks
from uncounted import pytest_runtest_call  # noqa: F401 - a hook
from weekly import examples

settings.register_profile(
    "fsn",
    deadline=None,
    max_examples=examples(100),
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("fsn")

# A shell starts background jobs with SIGINT ignored, and the programs of tests would inherit it:
# those that a test ends by Ctrl-C would never end.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# So does nohup with SIGHUP.
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

count_confined_children()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--shows", help="only tests that show this requirement, such as R5")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    wanted = config.getoption("--shows")
    if wanted:
        items[:] = [i for i in items if any(wanted in m.args for m in i.iter_markers("shows"))]
