"""The package `ros/fsoe_net_ros` in an installation of ROS 2, and a DDS domain of its own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from ros2.manager import PYTHON
from ros2.package import built_with_ros
from ros2.rig import own_domain


@pytest.fixture(scope="session")
def package() -> Path:
    return built_with_ros(PYTHON)


@pytest.fixture
def domain() -> Iterator[int]:
    with own_domain() as domain:
        yield domain
