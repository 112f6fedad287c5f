"""Checks that a scenario is valid for a network: names exist and values can be stored."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

from fsoe_net.diag.diagnostic import Diagnostic, Span, sort_diagnostics
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.model.bus import Located
from fsoe_net.model.scenario import RESET_OF_ALL, Action, Scenario, ScenarioStep
from fsoe_net.plan.model import Plan, PlanSymbol
from fsoe_net.simulate.bus import EmulatedDevices, normal_name

_SIGNED = 2
_HOUR_MS = 3_600_000
_PER_SUBDEVICE = {
    Action.MAILBOX_DELAY: _HOUR_MS,
    Action.AL_DELAY: _HOUR_MS,
    Action.RX_ERRORS: 255,
}
_Range = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioNames:
    """Valid names of a scenario for one network; values of signals with their range."""

    safe_inputs: Mapping[str, _Range]
    safe_outputs: Mapping[str, _Range]
    inputs: Mapping[str, _Range]
    outputs: Mapping[str, _Range]
    subdevices: frozenset[str]
    devices: frozenset[str]
    connections: frozenset[str]
    subs: frozenset[str]
    groups: frozenset[str]
    axes: frozenset[str]
    logics: frozenset[str]
    segment: bool
    """Whether the bus is an emulated segment, with cables and mailboxes."""

    @classmethod
    def of(cls, network: EmulatedDevices, plan: Plan, *, segment: bool = False) -> ScenarioNames:
        """Collect the names of a network and of the plan its core has loaded."""
        return cls(
            safe_inputs={n: _bits(p.sends[n].bits) for n, p in network.safe_inputs.items()},
            safe_outputs={n: _bits(p.receives[n].bits) for n, p in network.safe_outputs.items()},
            inputs={s.name: _range(s) for s in plan.symbols if not s.output},
            outputs={s.name: _range(s) for s in plan.symbols if s.output and not _owned(s, plan)},
            subdevices=frozenset(s.name for s in plan.subdevices),
            devices=frozenset(network.devices),
            connections=frozenset(network.mains),
            subs=frozenset(p.setup.connection.sub.name for p in network.subs.values()),
            groups=frozenset(g.name for g in plan.groups),
            axes=frozenset(network.axes),
            logics=frozenset(device.name for device in network.masters),
            segment=segment,
        )


def _bits(bits: int) -> _Range:
    return 0, (1 << bits) - 1


def _range(symbol: PlanSymbol) -> _Range:
    if symbol.kind == _SIGNED:
        return -(1 << (symbol.bits - 1)), (1 << (symbol.bits - 1)) - 1
    return _bits(symbol.bits)


def _owned(symbol: PlanSymbol, plan: Plan) -> bool:
    """Whether a copy writes bits of this output; then no other writer may."""
    return any(
        copy.destination_sm == symbol.sm
        and copy.destination_bit < symbol.bit_offset + symbol.bits
        and symbol.bit_offset < copy.destination_bit + copy.bits
        for copy in plan.copies
    )


def check_scenario(scenario: Scenario, names: ScenarioNames) -> list[Diagnostic]:
    """Return errors: unknown names (FSN116) and values out of range (FSN113)."""
    check = _Check(names)
    check.values(scenario.initial, names.safe_inputs, "safe input", scenario)
    # Names can only be checked with the network; the file itself was checked when it was read.
    for name in scenario.logic.inputs or ():
        check.known(name, names.safe_inputs, "safe input", scenario.at("logic"))
    for name in scenario.logic.outputs or ():
        check.known(name, names.safe_outputs, "safe output", scenario.at("logic"))
    for name in scenario.logic.delays_ns:
        check.known(name, names.safe_outputs, "safe output", scenario.at("logic"))
    for name, setup in scenario.drives.items():
        check.known(name, names.axes, "drive", scenario.at(name))
        for key, output in (("sto", setup.sto), ("ss1", setup.ss1)):
            if output is not None:
                check.known(output, names.safe_outputs, "safe output", setup.at(key))
        for output in setup.sls or ():
            check.known(output, names.safe_outputs, "safe output", setup.at("sls"))
    for step in scenario.steps:
        check.step(step)
    for expectation in scenario.expectations:
        if expectation.connection:
            span = expectation.at("connection")
            check.known(expectation.connection, names.connections, "connection", span)
        check.values(expectation.safe_outputs, names.safe_outputs, "safe output", expectation)
        for name in expectation.drives:
            check.known(name, names.axes, "drive", expectation.at(name))
    return sort_diagnostics(check.found)


def check_step(step: ScenarioStep, names: ScenarioNames) -> list[Diagnostic]:
    """Return the errors of one step."""
    check = _Check(names)
    check.step(step)
    return check.found


@dataclass(slots=True)
class _Check:
    names: ScenarioNames
    found: list[Diagnostic] = field(default_factory=list)

    def step(self, step: ScenarioStep) -> None:
        if step.action.needs_segment:
            self._segment_step(step)
            return
        names, span = self.names, step.at(step.action.value)
        if step.action is Action.SET:
            both = {**names.inputs, **names.safe_inputs}
            self.values(step.values, both, "input", step)
        elif step.action is Action.OUTPUT:
            self.values(step.values, names.outputs, "standard output", step)
        elif step.action in (Action.BREAK, Action.HEAL):
            self.known(step.target, names.subdevices, "SubDevice", span)
        elif step.action in (Action.PLUG, Action.PULL):
            self.known(step.target, names.groups, "group", span)
        elif step.action is Action.POWER_CYCLE:
            self.known(step.target, names.devices, "SubDevice with process data", span)
        elif step.action in (Action.PRESS, Action.RELEASE):
            self.known(step.target, {*names.logics, RESET_OF_ALL}, "safety logic", span)
        elif step.action is Action.LOCAL_RESET:
            self.known(step.target, names.connections, "connection", span)
        elif step.action is Action.DRIVE_FAULT:
            self.values(step.values, dict.fromkeys(names.axes, (1, 0xFFFF)), "drive", step)
        elif step.action is Action.FSOE_ADDRESS:
            self.values(step.values, dict.fromkeys(names.subs, (1, 0xFFFF)), "SubInstance", step)

    def _segment_step(self, step: ScenarioStep) -> None:
        names, span = self.names, step.at(step.action.value)
        # A run has no cables: the step would have no effect, and the following expectation would
        # mislead.
        if not names.segment:
            message = f"{step.action.value} needs cables, mailboxes and frames; a run has none"
            self._add("FSN116", span, message, "use this scenario with fsoe-net emulate")
        elif step.action in _PER_SUBDEVICE:
            known = dict.fromkeys(names.subdevices, (0, _PER_SUBDEVICE[step.action]))
            self.values(step.values, known, "SubDevice", step)
        elif step.action in (Action.CUT, Action.SPLICE):
            self.known(step.target, names.subdevices | {"main"}, "SubDevice", span)
        elif step.action is Action.SWAP:
            self.known(step.target, names.subdevices, "SubDevice", span)
            self.known(step.other, names.subdevices, "SubDevice", span)
        elif step.action in (Action.WRONG, Action.RIGHT, Action.NARROW_CLOCK, Action.SDO_ABORT):
            self.known(step.target, names.subdevices, "SubDevice", span)

    def values(
        self,
        values: Mapping[str, int],
        known: Mapping[str, _Range],
        what: str,
        owner: Located,
    ) -> None:
        for name, value in values.items():
            span = owner.at(name)
            if not self.known(name, known, what, span):
                continue
            low, high = known[name if name in known else normal_name(name)]
            if not low <= value <= high:
                message = f"{name} cannot be {value}; it holds {low} … {high}"
                self._add("FSN113", span, message, f"write {low} … {high}")

    def known(self, name: str, known: Collection[str], what: str, span: Span) -> bool:
        if name in known or normal_name(name) in known:
            return True
        self._add("FSN116", span, f"this network has no {what} {name!r}", _nearest(name, known))
        return False

    def _add(self, code: str, span: Span, message: str, hint: str) -> None:
        self.found.append(Diagnostic(code=code, span=span, message=message, hint=hint))


def _nearest(name: str, known: Iterable[str]) -> str:
    ordered = sorted(known)
    if close := guesses(name, ordered, cutoff=0.5):
        return f"write {one_of(close)}"
    more = ", …" if len(ordered) > 8 else ""
    return f"known: {', '.join(ordered[:8]) or 'none'}{more}"
