"""A test record: steps, expected results, observations at each place, and persons."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located
from fsoe_net.model.written import holds_a_place, says_something

EMULATED_NOTE = "EMULATED, not evidence for this machine"


class StepKind(enum.Enum):
    """The subject of a test step."""

    START_UP = "start_up"
    COMBINATION = "combination"
    TRIGGER = "trigger"
    LOSS = "loss"
    FAULT = "fault"

    @property
    def at_machine(self) -> bool:
        """Whether a person does it at the machine; faults are injected only on the emulated bus."""
        return self is not StepKind.FAULT


class StepOutcome(enum.Enum):
    """Outcome of a step."""

    AS_EXPECTED = "as expected"
    NOT_AS_EXPECTED = "not as expected"
    NOT_RUN = "not run"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult(Located):
    """Result determined by a program: on the emulated bus, or with a running ``fsn-master``.

    Attributes:
        outcome: The outcome.
        measured_ms: Measured time, ms; ``None`` if there is none.
        time_is: Meaning of that time: start, end and resolution.
        remark: Other observations, or why it was not run.
    """

    outcome: StepOutcome
    measured_ms: float | None = None
    time_is: str = ""
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class AtMachine(Located):
    """Entries of a person; initially empty, never filled in by a program.

    Attributes:
        outcome: ``None`` until filled in.
        measured_ms: Measured time, ms.
        remark: In words.
        by: Person present.
        date: Date of the test.
    """

    outcome: StepOutcome | None = None
    measured_ms: float | None = None
    remark: str = ""
    by: str = ""
    date: str = ""

    @property
    def filled(self) -> bool:
        """Whether any field is filled in."""
        return bool(
            self.outcome or self.measured_ms is not None or self.remark or self.by or self.date
        )

    @property
    def who(self) -> str:
        """The persons present, and the time; empty before the test."""
        return ", ".join(part for part in (self.by, self.date) if part)


@dataclass(frozen=True, slots=True, kw_only=True)
class TestStep(Located):
    """One step.

    Attributes:
        id: Unique in the test record; stable for the same network.
        kind: Kind of test.
        subject: Safety function, connection, SubDevice or class of faults.
        what: Instruction.
        expected: Expected result.
        limit_ms: Longest permitted time, ms; ``None`` if there is none.
        limit_source: Source of the limit.
        emulated: Result on the emulated bus: `EMULATED_NOTE`.
        live: Result with a running ``fsn-master``.
        machine: Observation of a person at the machine.
    """

    id: str
    kind: StepKind
    subject: str
    what: str
    expected: str
    limit_ms: float | None = None
    limit_source: str = ""
    emulated: StepResult | None = None
    live: StepResult | None = None
    machine: AtMachine = field(default_factory=AtMachine)

    @property
    def is_open(self) -> bool:
        """Whether the step still requires a person: results of programs never close it."""
        machine = self.machine
        return self.kind.at_machine and (
            machine.outcome in (None, StepOutcome.NOT_RUN)
            or not says_something(machine.by)
            or not says_something(machine.date)
        )

    @property
    def is_late(self) -> bool:
        """Whether a person measured a longer time than permitted."""
        measured, limit = self.machine.measured_ms, self.limit_ms
        return measured is not None and limit is not None and measured > limit

    @property
    def is_failed(self) -> bool:
        """Whether the result at the machine was unexpected, signed or not.

        A step that is not done at the machine has failed if it failed on the emulated bus.
        """
        if not self.kind.at_machine:
            return _otherwise(self.emulated)
        return self.machine.outcome is StepOutcome.NOT_AS_EXPECTED or self.is_late

    @property
    def is_done(self) -> bool:
        """Whether a person did it at the machine and signed it, with the expected result."""
        return self.kind.at_machine and not self.is_open and not self.is_failed

    @property
    def is_disputed(self) -> bool:
        """Whether a person observed the expected result, but a program did not."""
        return self.is_done and (_otherwise(self.emulated) or _otherwise(self.live))


def _otherwise(seen: StepResult | None) -> bool:
    return seen is not None and seen.outcome is StepOutcome.NOT_AS_EXPECTED


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceEntry(Located):
    """Data that a person reads at a SubDevice with an FSoE end; initially empty.

    Attributes:
        subdevice: Its name.
        firmware: Version shown by the device or its tool.
        serial: Serial number.
        safety_project_crc: CRC of the safety project; ``None`` without a MainInstance.
    """

    subdevice: str
    firmware: str = ""
    serial: str = ""
    safety_project_crc: str | None = None

    @property
    def filled(self) -> bool:
        """Whether any field is filled in."""
        return bool(self.firmware or self.serial or self.safety_project_crc)

    def blank(self) -> Iterator[str]:
        """Yield the names of unanswered fields, including ``not applicable`` without a reason."""
        for name in ("firmware", "serial", "safety_project_crc"):
            text = getattr(self, name)
            if text is not None and holds_a_place(text, "notapplicable"):
                yield name


@dataclass(frozen=True, slots=True, kw_only=True)
class TestRecord(Located):
    """A test record of one configuration.

    Attributes:
        network: Name of the network.
        project: Machine or project; may be empty.
        plan_sha256: Hash of the tested plan.
        fingerprint: Fingerprint of the configuration; empty if it was not determined.
        made: Day (ISO 8601) on which its first test record was written; empty if unknown.
        devices: Data to read at the SubDevices with an FSoE end.
        steps: Steps in the recommended order.
    """

    network: str
    project: str = ""
    plan_sha256: str
    fingerprint: str = ""
    made: str = ""
    devices: tuple[DeviceEntry, ...] = ()
    steps: tuple[TestStep, ...]

    @property
    def machine_steps(self) -> tuple[TestStep, ...]:
        """Return the steps that a person does at the machine; a sign-off needs all of them."""
        return tuple(step for step in self.steps if step.kind.at_machine)

    @property
    def open_steps(self) -> tuple[TestStep, ...]:
        """Return the steps that a person has not finished at the machine."""
        return tuple(step for step in self.steps if step.is_open)

    @property
    def failed_steps(self) -> tuple[TestStep, ...]:
        """Return the steps with an unexpected result; they may also be open."""
        return tuple(step for step in self.steps if step.is_failed)

    @property
    def disputed_steps(self) -> tuple[TestStep, ...]:
        """Return the completed steps whose result differs between a program and the person."""
        return tuple(step for step in self.steps if step.is_disputed)
