"""Fixtures for pytest: ``pytest_plugins = ["fsoe_net.testing.fixtures"]`` in ``conftest.py``."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from fsoe_net.testing.emulated import EmulatedNetwork
from fsoe_net.testing.fake_master import FakeMaster


@pytest.fixture
def fake_fsn_master() -> Iterator[FakeMaster]:
    """Serve a control socket; its path is ``fake_fsn_master.path``."""
    with FakeMaster() as master:
        yield master


@pytest.fixture
def emulated_network() -> Callable[..., EmulatedNetwork]:
    """Create networks on the emulated bus: ``emulated_network("network.yaml")``."""
    return EmulatedNetwork
