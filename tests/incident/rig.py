"""Runs on the emulated bus with something wrong, and the incident files they leave."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from networks import EXAMPLES, resolved
from uncounted import not_counted

from fsoe_net.core.snapshot import CycleImage
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.incident.causes import Verdicts, judge
from fsoe_net.incident.evidence import IncidentEvidence, gather
from fsoe_net.incident.incident_read import IncidentReader
from fsoe_net.model.resolve import Resolution
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.device import EmulatedDevice
from fsoe_net.simulate.incidents import IncidentRecorder
from fsoe_net.simulate.session import Session, counted_session_ids

ROOT = Path(__file__).parents[2]
MS = 1_000_000
CELL, ESTOP = "el6910", "estop"
DRIVE = "el6910-drive_1"
COUPLER = "el1918-ek1914"
Seed = tuple[Callable[[Path], Path], str]
"""What makes the file in a folder, and the cause that is to be named."""
START = datetime(2026, 3, 1, 12, 0, 0, tzinfo=UTC)


def network(name: str, tmp: Path, *edits: tuple[str, str]) -> Resolution:
    """Load an example; ``edits`` replace text of its network file."""
    text = (EXAMPLES / name / "network.yaml").read_text("utf-8")
    for old, new in edits:
        assert old in text, f"{old!r} is not in the network file"
        text = text.replace(old, new)
    folder = tmp / f"net{len(list(tmp.iterdir()))}"
    folder.mkdir()
    (folder / "devices").symlink_to(EXAMPLES / name / "devices")
    (folder / "network.yaml").write_text(text, "utf-8")
    return resolved(folder / "network.yaml")


class Device:
    """An emulated device that only steps when it shall."""

    def __init__(self, device: EmulatedDevice, runs: Callable[[int], bool]) -> None:
        self._device = device
        self._runs = runs

    def step(self, now_ns: int, io: Any) -> None:
        if self._runs(now_ns):
            self._device.step(now_ns, io)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)


class Wire:
    """Process data of a device with somebody else's hand in it."""

    def __init__(
        self,
        io: Any,
        *,
        outputs: Callable[[int, bytes], bytes] = lambda _, data: data,
        inputs: Callable[[int, bytes], bytes] = lambda _, data: data,
    ) -> None:
        self._io = io
        self._outputs = outputs
        self._inputs = inputs

    def read_outputs(self, sm: int) -> bytes:
        return self._outputs(sm, self._io.read_outputs(sm))

    def write_inputs(self, sm: int, data: bytes) -> None:
        self._io.write_inputs(sm, self._inputs(sm, data))

    def operational(self) -> bool:
        return bool(self._io.operational())


def changed_cycle(image: CycleImage, **changes: Any) -> CycleImage:
    """Return what the recorder sees of a cycle with other values; counts of frames by name."""
    frames = {name: changes.pop(name, count) for name, count in image.frames.items()}
    return replace(image, frames=frames, **changes)


class CoreProxy:
    """A core whose cycle images somebody changes."""

    def __init__(self, core: Any, change: Callable[[Any], Any]) -> None:
        self._core = core
        self._change = change

    def cycle_image(self) -> Any:
        return self._change(self._core.cycle_image())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._core, name)


@dataclass
class Rig:
    """A run step by step.

    Args:
        devices: Network the devices are made of.
        plan: Network the plan is made of; default the same.
        steps: Steps of a scenario as YAML.
    """

    devices: Resolution
    tmp: Path
    plan: Resolution | None = None
    steps: str = ""
    now_ns: int = 0
    session: Session = field(init=False)
    recorder: IncidentRecorder = field(init=False)

    def __post_init__(self) -> None:
        scenario = None
        if self.steps:
            path = self.tmp / "scenario.yaml"
            path.write_text(f"version: 1\nsteps:\n{self.steps}", "utf-8")
            scenario, found = load_scenario(str(path))
            assert scenario is not None, found
        data = compile_plan(self.plan or self.devices).to_bytes()
        self.session = Session(self.devices, data, scenario, session_ids=counted_session_ids())
        folder = self.tmp / "incidents"
        folder.mkdir(exist_ok=True)
        self.recorder = IncidentRecorder(self.session, folder, start=START)

    def ports(self, name: str) -> tuple[Any, Any]:
        """Return main and sub port of a connection."""
        return self.session.network.mains[name], self.session.network.subs[name]

    def runs(self, device: str, when: Callable[[int], bool]) -> None:
        """Let a device step only at certain times."""
        devices = self.session.network.devices
        devices[device] = Device(devices[device], when)  # type: ignore[assignment]

    def wire(self, device: str, **hands: Callable[[int, bytes], bytes]) -> None:
        """Put a hand between bus and device."""
        ports = self.session._ports
        ports[device] = Wire(ports[device], **hands)  # type: ignore[assignment,arg-type]

    def cycle_images(self, change: Callable[[Any], Any]) -> None:
        """Change what the recorder sees of the cycles."""
        self.session.core = CoreProxy(self.session.core, change)  # type: ignore[assignment]

    def run(self, duration_ms: int, extra_ns: Callable[[int], int] = lambda _: 0) -> None:
        """Run; ``extra_ns`` says how much later than planned each cycle comes."""
        cycle_ns = self.session.cycle_ns
        with not_counted():  # what runs here has tests of its own
            for _ in range(duration_ms * 1_000_000 // cycle_ns):
                self.now_ns += cycle_ns + extra_ns(self.now_ns)
                self.session.core.cycle(self.now_ns)
                self.recorder.cycle(self.now_ns)
                self.session.step_devices(self.now_ns)

    def end(self) -> Path:
        """End the run and return the first file."""
        self.recorder.finish(self.now_ns)
        assert self.recorder.files, self.session.engine.events[-5:]
        return self.recorder.files[0]


def read(path: Path) -> IncidentEvidence:
    """Read a file to its end."""
    with open(path, "rb") as stream:
        return gather(IncidentReader(path.name, stream))


def judged(path: Path) -> Verdicts:
    """Return what is said of a file."""
    return judge(read(path))


def edited(path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """Change the head of a file: what only a bus with AL states knows."""
    first, rest = path.read_text("utf-8").split("\n", 1)
    head = json.loads(first)
    change(head)
    path.write_text(json.dumps(head) + "\n" + rest, "utf-8")
    return path


def found_codes() -> dict[str, int]:
    """Return the table of the C header: text of ``enum fsn_found`` to number."""
    header = (ROOT / "master_core/include/fsn/bus.h").read_text("utf-8")
    rows = re.findall(
        r'^    X\((?:[A-Z]+), (\d+), "([^"]+)"\)', header.split("FSN_RING_TABLE")[0], re.M
    )
    return {text: int(number) for number, text in rows}


FOUND = found_codes()


def found(path: Path, name: str, **what: Any) -> Path:
    """Say what the bus found of a SubDevice."""
    if "found_text" in what:
        what["found"] = FOUND[what["found_text"]]

    def change(head: dict[str, Any]) -> None:
        row = next(s for s in head["subdevices"] if s["name"] == name)
        row |= what

    return edited(path, change)


def config(port: Any, **changes: Any) -> None:
    """Change the configuration of a SubInstance or MainInstance."""
    instance = port.instance
    port.instance = type(instance)(
        replace(instance.config, **changes), session_ids=counted_session_ids()
    )
