"""Common parts of every run: a plan, the devices of its network, a scenario, and the engine."""

from __future__ import annotations

import abc
import functools
import hashlib
from collections.abc import Callable
from typing import Protocol

from fsoe_net.core.core import CorePlan
from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.errors import CoreError
from fsoe_net.model.resolve import Resolution
from fsoe_net.model.scenario import LogicChoice, Scenario, ScenarioStep
from fsoe_net.plan.codec import decode_plan
from fsoe_net.simulate.bus import build_network
from fsoe_net.simulate.commands import CommandError, EmulationCommand, parse_command
from fsoe_net.simulate.engine import Engine
from fsoe_net.simulate.scenario_check import ScenarioNames, check_scenario, check_step

DEFAULT_CYCLE_NS = 1_000_000  # if no file states a bus cycle


class DeviceSide(Protocol):
    """The device side of a bus; sync managers by their number in the plan."""

    def read_outputs(self, sm: int) -> bytes:
        """Return the newest outputs of one cycle."""

    def write_inputs(self, sm: int, data: bytes) -> None:
        """Publish inputs, all at once."""


class _Port:
    """Process data of one SubDevice; sync managers by their SM number."""

    def __init__(
        self, bus: DeviceSide, numbers: dict[int, int], operational: Callable[[], bool]
    ) -> None:
        self._bus = bus
        self._numbers = numbers
        self.operational = operational

    def read_outputs(self, sm: int) -> bytes:
        return self._bus.read_outputs(self._numbers[sm])

    def write_inputs(self, sm: int, data: bytes) -> None:
        self._bus.write_inputs(self._numbers[sm], data)


class ScenarioRun(abc.ABC):
    """The devices of a network, and a scenario that controls them.

    Args:
        resolution: A network without errors and with at least one connection.
        plan_bytes: Its plan.
        scenario: Steps and expectations, or ``None``.
        session_ids: Source of FSoE session ids.

    Raises:
        PlanFormatError: The core rejects the plan.
        CoreMissing: The compiled part is missing.
    """

    has_segment = False

    def __init__(
        self,
        resolution: Resolution,
        plan_bytes: bytes,
        scenario: Scenario | None,
        *,
        session_ids: Callable[[], int],
    ) -> None:
        self.resolution = resolution
        self.scenario = scenario
        self.plan_bytes = plan_bytes
        self.plan_sha256 = hashlib.sha256(plan_bytes).hexdigest()
        self.plan = CorePlan.load(plan_bytes)
        self.records = decode_plan(plan_bytes)
        self.network = build_network(resolution, session_ids)
        # With a scenario, the engine selects the logic.
        if scenario is None:
            self.network.choose_logic(LogicChoice())
        self._engine: Engine | None = None
        self._ports: dict[str, _Port] = {}
        # Of groups with the same place, only the first one is present at the start.
        self.away = {
            self.plan.subdevice_names[group.first_subdevice + number]
            for group in self.records.groups
            if not self.records.is_first_choice(group)
            for number in range(group.subdevice_count)
        }
        self._tell_logic()
        bus = self._open()
        for sub in self.records.subdevices:
            numbers = range(sub.first_sm, sub.first_sm + sub.sm_count)
            sms = {self.records.sync_managers[n].index: n for n in numbers}
            operational = functools.partial(self._is_operational, sub.name)
            self._ports.setdefault(sub.name, _Port(bus, sms, operational))

    @abc.abstractmethod
    def _open(self) -> DeviceSide:
        """Create the bus of the plan and return its device side."""

    def scenario_findings(self) -> list[Diagnostic]:
        """Return names in the scenario that the network does not have."""
        if self.scenario is None:
            return []
        return check_scenario(self.scenario, self.names())

    def do_command(self, line: str, number: int, now_ns: int) -> EmulationCommand | None:
        """Run a line as a step of a scenario now.

        Args:
            line: See `parse_command`.
            number: Line number, for messages.
            now_ns: Current time.

        Returns:
            The command; ``None`` for an empty line.

        Raises:
            CommandError: The line is not a command, or is invalid for the network.
        """
        command = parse_command(line, number)
        if command is not None and command.step is not None:
            found = check_step(command.step, self.names())
            if found:
                raise CommandError(f"{found[0].message}; {found[0].hint}")
            try:
                self.engine.do(command.step, now_ns, "command")
            except CoreError as fault:
                raise CommandError(str(fault)) from fault
        return command

    def names(self) -> ScenarioNames:
        """Return the names that are valid in a scenario for this run."""
        return ScenarioNames.of(self.network, self.records, segment=self.has_segment)

    @property
    def engine(self) -> Engine:
        """The engine of this run; created on first use, after the scenario was checked."""
        if self._engine is None:
            self._engine = Engine(
                self.network,
                self.scenario,
                set_present=self.set_present,
                plug=self._plug,
                is_due=self.is_due,
                set_output=self._set_output,
                set_input=self._set_input,
                on_bus=self._on_bus,
            )
        return self._engine

    @abc.abstractmethod
    def set_present(self, name: str, present: bool) -> None:
        """Unplug a SubDevice or plug it in."""

    @abc.abstractmethod
    def _is_operational(self, name: str) -> bool:
        """Return whether outputs reach a SubDevice."""

    def is_due(self, connection: str) -> bool:
        """Return whether both ends of a connection are present or always required."""
        setup = self.network.subs[connection].setup.connection
        return not {setup.main.name, setup.sub.name} & self.away

    def _plug(self, name: str, present: bool) -> None:
        group = next(g for g in self.records.groups if g.name == name)
        for number in range(group.subdevice_count):
            member = self.plan.subdevice_names[group.first_subdevice + number]
            self.set_present(member, present)
            # A device that is plugged in starts from power-on.
            if present and member in self.network.devices:
                self.network.devices[member].power_cycle()
            (self.away.discard if present else self.away.add)(member)
        # After all members have changed: the logic must not see an incomplete group.
        self._tell_logic()

    def _tell_logic(self) -> None:
        """Make safety logic ignore connections whose other end is absent by design."""
        away = {name for name in self.network.mains if not self.is_due(name)}
        for device in self.network.masters:
            device.away = away

    @abc.abstractmethod
    def _set_output(self, name: str, value: int) -> None:
        """Set a standard output."""

    @abc.abstractmethod
    def _on_bus(self, step: ScenarioStep) -> None:
        """Apply a step to the bus itself."""

    def _set_input(self, name: str, value: int) -> None:
        symbol = self.records.symbols[self.plan.inputs[name]]
        sm = self.records.sync_managers[symbol.sm]
        device = self.network.devices[self.plan.subdevice_names[sm.subdevice]]
        device.set_input(sm.index, symbol.bit_offset, symbol.bits, value)

    def step_devices(self, now_ns: int) -> None:
        """Let the scenario act, advance every device by one step, and check the result."""
        engine = self.engine
        engine.act(now_ns)
        for name, device in self.network.devices.items():
            device.step(now_ns, self._ports[name])
        engine.watch(now_ns)
