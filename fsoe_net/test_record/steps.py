"""Steps of a test record, derived from safety functions, connections, devices and fault classes."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from dataclasses import replace

from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.errors import InputError
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.network import NetworkConfig
from fsoe_net.model.resolve import Connection, Resolution
from fsoe_net.model.safe_bits import bit_words
from fsoe_net.model.safety import ElementKind, SafetyFunction
from fsoe_net.model.test_record import DeviceEntry, StepKind, TestRecord, TestStep
from fsoe_net.plan.fingerprint import short_code

_BACK = "`fsoe-net test-record … -o` this file puts it back, and keeps what is filled in"


def make_test_record(
    resolution: Resolution, plan_bytes: bytes, *, fingerprint: str = ""
) -> TestRecord:
    """Return the test record of a network, not yet executed.

    Args:
        resolution: A network without errors.
        plan_bytes: Its plan.
        fingerprint: Fingerprint of the configuration; empty if it was not calculated.
    """
    network = resolution.network
    steps = [_start_up(connection) for connection in resolution.connections]
    steps += [_combination(resolution, present) for present in network.combinations()]
    steps += [_trigger(function) for function in network.safety_functions]
    # In bus order, each name once, because a person walks along the machine.
    names = dict.fromkeys(sub.name for sub in network.subdevices)
    steps += [_loss(name, connections_of(resolution, name)) for name in names]
    steps += [_fault(name) for name in CATALOGUE]
    return TestRecord(
        network=network.name,
        project=network.project or "",
        plan_sha256=hashlib.sha256(plan_bytes).hexdigest(),
        fingerprint=fingerprint,
        devices=_devices(resolution),
        steps=tuple(steps),
    )


def _devices(resolution: Resolution) -> tuple[DeviceEntry, ...]:
    """Return a row for each SubDevice with an FSoE end, in the order of the bus."""
    mains = {c.main.name for c in resolution.connections}
    ends = mains | {c.sub.name for c in resolution.connections}
    return tuple(
        DeviceEntry(subdevice=name, safety_project_crc="" if name in mains else None)
        for name in dict.fromkeys(sub.name for sub in resolution.network.subdevices)
        if name in ends
    )


def connections_of(resolution: Resolution, subdevice: str) -> list[Connection]:
    """Return the connections with an end in a SubDevice."""
    return [c for c in resolution.connections if subdevice in (c.main.name, c.sub.name)]


def _start_up(connection: Connection) -> TestStep:
    return TestStep(
        id=f"start-up {connection.name}",
        kind=StepKind.START_UP,
        subject=connection.name,
        what="Switch on everything and wait; press nothing.",
        expected=f"{connection.name} reaches state Data; no output is on before a reset.",
    )


def _combination(resolution: Resolution, present: Sequence[str]) -> TestStep:
    network = resolution.network
    absent = [g.name for g in network.groups if g.name not in present]
    due = [c.name for c in resolution.connections if connection_is_due(c, network, present)]
    there = ", ".join(present) or "no group"
    without = f", without {', '.join(absent)}" if absent else ""
    return TestStep(
        id=f"combination {'+'.join(present) or 'none'}",
        kind=StepKind.COMBINATION,
        subject="+".join(present),
        what=f"With the area guarded, plug in {there}{without} while everything else runs; press "
        "nothing.",
        expected=f"{', '.join(due) or 'No connection'} reaches or keeps Data; no other connection "
        "does, and no output comes on before a reset.",
    )


def connection_is_due(c: Connection, network: NetworkConfig, present: Collection[str]) -> bool:
    """Return whether both ends of a connection are present with these groups."""
    groups = (network.group_of(c.main.name), network.group_of(c.sub.name))
    return all(group is None or group.name in present for group in groups)


def _trigger(function: SafetyFunction) -> TestStep:
    required = function.required_reaction_ms
    inputs = _parts(function, ElementKind.INPUT)
    trigger = function.trigger or f"{function.name} at {inputs}"
    bits = [words for e in function.elements for words in bit_words(e)]
    watched = f" Safe bits to watch: {'; '.join(bits)}." if bits else ""
    return TestStep(
        id=f"trigger {function.name}",
        kind=StepKind.TRIGGER,
        subject=function.name,
        what=f"Switch the outputs on. Then cause the trigger: {trigger}.{watched}",
        expected=f"{function.reaction or 'The outputs go off'}. This remains after the trigger has "
        "ended, until a reset is pressed.",
        limit_ms=required,
        limit_source="" if required is None else "required reaction time of the network file",
    )


def _parts(function: SafetyFunction, kind: ElementKind) -> str:
    return ", ".join(e.sub or e.name for e in function.elements if e.kind is kind) or "its input"


def _loss(name: str, connections: Sequence[Connection]) -> TestStep:
    watchdogs = [c.facts.watchdog_ms for c in connections if c.facts and c.facts.watchdog_ms]
    if not connections:
        expected = f"{name} has no FSoE end: no output comes on; note what the connections do."
    else:
        leave = "leaves" if len(connections) == 1 else "leave"
        expected = (
            f"{', '.join(c.name for c in connections)} {leave} Data; the outputs of the logic "
            f"go off and stay off when {name} is back, until a reset is pressed."
        )
    # The largest watchdog is a limit only if all of them are stated.
    whole = bool(connections) and len(watchdogs) == len(connections)
    return TestStep(
        id=f"loss {name}",
        kind=StepKind.LOSS,
        subject=name,
        what=f"Switch the outputs on. Take {name} off the bus; then put it back.",
        expected=expected,
        limit_ms=2.0 * max(watchdogs) if whole else None,
        limit_source="twice the longest watchdog of its connections" if whole else "",
    )


def _fault(name: str) -> TestStep:
    return TestStep(
        id=f"fault {name}",
        kind=StepKind.FAULT,
        subject=name,
        what=f"Put faults of class {name} into every connection (see the fault catalogue).",
        expected="No wrong frame is accepted, except where all its CRCs match by chance; these are "
        "not more than the CRC allows.",
    )


def keep_machine(new: TestRecord, old: TestRecord) -> TestRecord:
    """Return the new test record with people's entries and other columns of the old one.

    Raises:
        InputError: The old one contains entries of people, and is for another configuration or has
            other steps.
    """
    written = {step.id: step for step in old.steps if step.machine.filled}
    # Results of people are never dropped: the old file is kept for its configuration.
    if not _same(new, old):
        if written or any(d.filled for d in old.devices):
            raise InputError(
                "that file holds results at the machine of another plan "
                f"({old.plan_sha256[:16]}, now {new.plan_sha256[:16]}); write to another file"
            )
        return new
    # A removed step may contain the work of a person.
    lost = sorted(written.keys() - {step.id for step in new.steps})
    if lost:
        raise InputError(
            f"that file contains results at the machine for steps that no longer exist: {lost[0]}; "
            "write to another file"
        )
    before = {step.id: step for step in old.steps}
    read = {d.subdevice: d for d in old.devices}
    return replace(
        new,
        made=old.made or new.made,
        devices=tuple(_read(d, read.get(d.subdevice, d)) for d in new.devices),
        steps=tuple(_merged(step, before.get(step.id)) for step in new.steps),
    )


def _read(new: DeviceEntry, old: DeviceEntry) -> DeviceEntry:
    """Return the data read by people, in a row with all fields."""
    return replace(old, safety_project_crc=old.safety_project_crc or new.safety_project_crc)


def _same(new: TestRecord, old: TestRecord) -> bool:
    if new.fingerprint and old.fingerprint:
        return new.fingerprint == old.fingerprint
    return new.plan_sha256 == old.plan_sha256


def compare_test_record(given: TestRecord, fresh: TestRecord, out: Collector) -> None:
    """Report where a test record does not match the current network.

    Args:
        given: Test record as filled in by people.
        fresh: Result of `make_test_record` for the network.
        out: Takes FSN161; empty if results can be used unchanged.
    """
    anew = "write a new one with `fsoe-net test-record … -o NEW.yaml` and do its steps"
    if given.fingerprint != fresh.fingerprint:
        key = "fingerprint" if given.fingerprint else "plan_sha256"
        now = short_code(fresh.fingerprint)
        before = short_code(given.fingerprint) if given.fingerprint else "not known"
        words = f"made for another configuration ({before}) than these files give ({now})"
        out.add("FSN161", given.at(key), words, hint=anew)
        # Each step would also differ; one finding is sufficient.
        return
    steps = {step.id: step for step in given.steps}
    for step in fresh.steps:
        if step.id not in steps:
            words = f"step {step.id} of these files is missing"
            out.add("FSN161", given.at("steps"), words, hint=_BACK)
    _compare_devices(given, fresh, out)
    required = {step.id: step for step in fresh.steps}
    for step in given.steps:
        fresh_step = required.get(step.id)
        if fresh_step is None:
            words = f"step {step.id} is not one of these files"
            out.add("FSN161", step.span, words, hint="remove it, or name the files it belongs to")
        elif key := _changed(step, fresh_step):
            words = f"step {step.id}: {key} is not what these files give"
            out.add(
                "FSN161", step.at(key), words, hint=f"write back: {_requirements(fresh_step)[key]}"
            )


def _compare_devices(given: TestRecord, fresh: TestRecord, out: Collector) -> None:
    projects = {d.subdevice: d.safety_project_crc for d in given.devices}
    for device in fresh.devices:
        name = device.subdevice
        if name not in projects:
            words = f"{name} is missing among the devices to read"
            out.add("FSN161", given.at("devices"), words, hint=_BACK)
        elif projects[name] is None and device.safety_project_crc is not None:
            words = f"{name} has a MainInstance, and no safety_project_crc to read"
            out.add("FSN161", given.at("devices"), words, hint=_BACK)


def _requirements(step: TestStep) -> dict[str, object]:
    return {
        "kind": step.kind.value,
        "subject": step.subject,
        "do": step.what,
        "expect": step.expected,
        "limit_ms": step.limit_ms,
    }


def _changed(given: TestStep, fresh: TestStep) -> str:
    """Return the first key in which the instructions of a step differ; empty for none."""
    required = _requirements(fresh)
    return next((key for key, value in _requirements(given).items() if value != required[key]), "")


def _merged(step: TestStep, old: TestStep | None) -> TestStep:
    if old is None:
        return step
    # Entries of people apply only to the step as it was when they did it.
    if old.machine.filled and (old.what, old.expected, old.limit_ms) != (
        step.what,
        step.expected,
        step.limit_ms,
    ):
        raise InputError(
            f"step {step.id} now asks for something else than what was done at the machine; "
            "write to another file"
        )
    return replace(
        step,
        machine=old.machine,
        emulated=step.emulated or old.emulated,
        live=step.live or old.live,
    )
