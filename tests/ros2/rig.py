"""A node and another vendor's DDS in one domain, which no other test has at the same time."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib
import os
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import pytest
from patience import PATIENCE_S
from tied import tied

ROOT = Path(__file__).parents[2]
_SOURCE = Path(__file__).with_name("fast_dds_peer.cpp")
_HEADER = Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp")
_REQUIRED = "ros2" in os.environ.get("FSN_REQUIRE", "").split(",")


def needed(module: str, extra: str) -> ModuleType:
    """Return a module; absent it skips, but fails where FSN_REQUIRE names ``ros2``."""
    if _REQUIRED:
        return importlib.import_module(module)
    return pytest.importorskip(module, reason=f"needs pip install -e '.[{extra}]'")


needed("cyclonedds", "ros2")
needed("mcap", "ros2")
needed("rosbags", "peers")

from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

_SERVICES = {
    "std_srvs/srv/Trigger": ("", "bool success\nstring message\n"),
    "rcl_interfaces/srv/SetParameters": (
        "rcl_interfaces/Parameter[] parameters\n",
        "rcl_interfaces/SetParametersResult[] results\n",
    ),
    # Of ethercat_msgs, as its repository has them.
    "ethercat_msgs/srv/GetSdo": (
        "int16 master_id\nuint16 slave_position\nuint16 sdo_index\nuint8 sdo_subindex\n"
        "string sdo_data_type\n",
        "bool success\nstring sdo_return_message\nstring sdo_return_value_string\n"
        "float64 sdo_return_value\n",
    ),
    "ethercat_msgs/srv/SetSdo": (
        "int16 master_id\nint16 slave_position\nint16 sdo_index\nint16 sdo_subindex\n"
        "string sdo_data_type\nstring sdo_value\n",
        "bool success\nstring sdo_return_message\n",
    ),
}

# Of control_msgs 6.8.0, without constants.
_CONTROL_MSGS = {
    "GenericHardwareState": "uint8 health_status\nuint8[] error_domain\nuint8 operational_mode\n"
    "uint8 power_state\nuint8 connectivity_status\nstring manufacturer\nstring model\n"
    "string firmware_version\ndiagnostic_msgs/KeyValue[] state_details\n",
    "CANopenState": "uint8 node_id\nuint8 nmt_state\nuint8 dsp_402_state\nuint32 last_emcy_code\n",
    "EtherCATState": "uint16 slave_position\nstring vendor_id\nstring product_code\n"
    "uint8 al_state\nbool has_error\nuint16 al_status_code\n",
    "VDA5050State": "string order_id\nstring action_status\nuint32 last_node_id\nbool driving\n"
    "float64 battery_charge\nstring operating_mode\nstring error_type\n"
    "string error_description\n",
    "HardwareDeviceStatus": "std_msgs/Header header\nstring device_id\n"
    "GenericHardwareState[] hardware_status\nCANopenState[] canopen_states\n"
    "EtherCATState[] ethercat_states\nVDA5050State[] vda5050_states\n",
    "HardwareStatus": "std_msgs/Header header\nstring hardware_id\n"
    "HardwareDeviceStatus[] hardware_device_states\n",
}


def typestore() -> Any:
    """Return the types of ROS 2 Jazzy as `rosbags` has them, of services and of control_msgs."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in _CONTROL_MSGS.items():
        store.register(get_types_from_msg(text, f"control_msgs/msg/{name}"))
    for service, texts in _SERVICES.items():
        for part, text in zip(("Request", "Response"), texts, strict=True):
            found = get_types_from_msg(text, f"{service}_{part}")
            store.register({name.replace("/srv/msg/", "/srv/"): row for name, row in found.items()})
    return store


@contextlib.contextmanager
def own_domain() -> Iterator[int]:
    """Yield a domain ID that no other test of this machine has until the block ends."""
    for domain in range(1, 100):  # above, ports are those that Linux gives away by itself
        with open(Path(tempfile.gettempdir()) / f"fsn-dds-domain-{domain}", "w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield domain
            return
    pytest.fail("all domains are taken")


def peer_program() -> Path:
    """Return the peer, which is compiled once; absent its library skips, as `needed`."""
    compiler = shutil.which("g++")
    if not _HEADER.is_file() or compiler is None:
        if _REQUIRED:
            pytest.fail("needs g++ and Fast DDS (package libfastrtps-dev of Debian)")
        pytest.skip("needs g++ and Fast DDS (package libfastrtps-dev of Debian)")
    digest = hashlib.sha256(_SOURCE.read_bytes()).hexdigest()[:16]
    folder = ROOT / "build" / "fast-dds-peer"
    folder.mkdir(parents=True, exist_ok=True)
    program = folder / digest
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not program.exists():
            made = folder / "made"
            words = [compiler, "-std=c++14", "-o", str(made), str(_SOURCE)]
            subprocess.run([*words, "-lfastrtps", "-lfastcdr"], check=True)
            made.rename(program)
    return program


class Peer:
    """Fast DDS as a process; a context manager.

    Args:
        words: ``listen`` or ``send``, domain, topic, type and so on, as its source says.
    """

    def __init__(self, *words: object) -> None:
        self.process = subprocess.Popen(
            tied(peer_program(), *map(str, words)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.stdin: IO[str] = self.process.stdin
        self.stdout: IO[str] = self.process.stdout

    def lines(self) -> Iterator[str]:
        """Yield what it prints."""
        for line in self.stdout:
            yield line.rstrip("\n")

    def payloads(self) -> Iterator[bytes]:
        """Yield the samples that it receives, with the encapsulation in front."""
        for line in self.lines():
            if not line.startswith("offer "):
                yield b"\x00\x01\x00\x00" + bytes.fromhex(line)

    def send(self, payload: bytes) -> None:
        """Have it write a sample."""
        self.stdin.write(payload.hex() + "\n")
        self.stdin.flush()

    def done(self) -> int:
        """Send no more; return its exit code once all was acknowledged."""
        self.stdin.close()
        return self.process.wait(PATIENCE_S)

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self.stdin.close()
        self.stdout.close()


class System:
    """The adapter as a process that takes one line and answers one; a context manager."""

    def __init__(self, program: Path, *words: str) -> None:
        self.process = subprocess.Popen(
            tied(program, *words),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def ask(self, line: str) -> str:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def goes(self, *lines: str) -> None:
        for line in lines:
            assert self.ask(line) in ("SUCCESS", "OK"), (line, self.end())

    def until(self, line: str, answer: str) -> None:
        while self.ask(line) != answer:
            assert self.ask("cycle 5") == "OK"

    def sends(self, arrived: Callable[[], object]) -> None:
        """Run cycles until a client of fsn-master sees something."""
        while not arrived():
            assert self.ask("cycle 5") == "OK"

    def end(self) -> str:
        """Let it end; return what it has logged."""
        return self.process.communicate()[1]

    def __enter__(self) -> System:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.communicate()


@contextlib.contextmanager
def bridged(path: Path | str, **more: Any) -> Iterator[Any]:
    """Run a bridge in a domain of its own, on the loopback; yield it with its ``domain``."""
    from fsoe_net.ros2.bridge import Bridge, BridgeOptions

    with own_domain() as domain:
        options = {"name": "cell", "rate_hz": 50.0, "allow_control": False} | more
        with Bridge(str(path), BridgeOptions(domain=domain, here_only=True, **options)) as bridge:
            ending = threading.Event()

            def follow() -> None:
                while not ending.is_set():
                    bridge.look(ending)

            thread = threading.Thread(target=follow, daemon=True)
            thread.start()
            try:
                yield domain
            finally:
                ending.set()
                thread.join()
