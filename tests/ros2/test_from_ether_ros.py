"""The page for users of ether_ros: its commands run, and what it names is there."""

from __future__ import annotations

import re
import shutil
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from patience import PATIENCE_S
from ros2.caller import Caller
from ros2.found import Found
from ros2.page import Session, page_commands
from ros2.rig import own_domain

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "ether-ros.md").read_text("utf-8")
COMMANDS = page_commands(PAGE)
NAMES = set(re.findall(r"/fsoe_net/[a-z0-9_/]+", PAGE))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Session, dict[str, str]]]:
    """Run every command of the page in its order; yield what each has said."""
    folder = tmp_path_factory.mktemp("page")
    for name in ("legs", "estop"):
        shutil.copytree(ROOT / "examples" / name, folder / name)
    with own_domain() as domain, ExitStack() as stack:
        session = Session(folder / "legs", domain, stack)
        said = {line: session.run(line) for line in COMMANDS}
        from cyclonedds.domain import Domain, DomainParticipant

        from fsoe_net.ros2.node import HERE

        here = Domain(domain, HERE)
        found = Found(DomainParticipant(domain))
        wanted = {ros_topic(name) for name in NAMES}
        callers = [Caller(domain, name) for name in NAMES if is_service(name)]
        while not wanted <= found.offers() | found.requests():
            pass
        del found, callers, here
        yield session, said


def ros_topic(name: str) -> str:
    """Return the topic of DDS behind a topic or service that the page names."""
    return f"rq{name}Request" if is_service(name) else f"rt{name}"


def is_service(name: str) -> bool:
    return name.count("/") == 2


def test_the_page_names_topics_and_services() -> None:
    assert {"/fsoe_net/start", "/fsoe_net/stop", "/fsoe_net/restart"} <= NAMES
    assert sum(name.endswith("/set") for name in NAMES) == 1
    assert len(COMMANDS) == 14


def test_each_command_does_what_the_page_states(session: tuple[Session, dict[str, str]]) -> None:
    shell, said = session
    words = "\n".join(said.values())
    assert "found/network.yaml: 2 SubDevices" in words
    assert "legs: no findings, 4 SubDevices, 1 FSoE connection" in words
    assert "2 copies, 1 connection" in words
    assert "stopped\nrunning\nrunning" in words
    assert re.search(r"^front_right_leg\.kp_100_knee +5$", words, re.M)
    assert "the legs have their gain" in words
    assert "may change once within 10 s" in words
    assert len(re.findall(r"^cycle \d+ +front_left_leg\.hip_angle = 0$", words, re.M)) >= 1
    assert (shell.folder / "times.csv").stat().st_size > 100
    assert (shell.folder / "times.svg").read_text("utf-8").startswith("<svg")


def test_a_parallel_process_ends_by_a_signal(session: tuple[Session, dict[str, str]]) -> None:
    from mcap.reader import make_reader

    shell, _ = session
    node = shell.beside["fsoe-net"]
    node.send_signal(signal.SIGTERM)
    assert node.wait(PATIENCE_S) == 0
    with open(shell.folder / "walk.mcap", "rb") as file:
        topics = {c.topic for _, c, _ in make_reader(file).iter_messages()}
    assert "/fsoe_net/outputs/front_left_leg/kp_100_knee" in topics


def test_every_part_of_the_program_is_on_the_page() -> None:
    """Facts of ether_ros: its parameters, topics, services and commands."""
    parts = """vendor_id product_code alias position assign_activate input_port output_port
        period_ns sync0_shift run_time slaves_count /pdo_raw /pdo_in_slave_0 /pdo_out
        /pdo_out_timer /pdo_listener /ethercat_communicatord thread clear /modify_output_bit
        !start !stop !restart !variable !run !help !q"""
    assert [part for part in parts.split() if part not in PAGE] == []
