"""What nobody says is empty, what is said has one word, and a step is judged by what was seen."""

from __future__ import annotations

from dataclasses import MISSING, fields, is_dataclass, replace
from itertools import product

import pytest
from changed import compare
from test_record.filled import timed

from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import InputError
from fsoe_net.model.answers import AnsweredDevice, AnsweredWord, Answers, Ask
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import (
    ClockFacts,
    DescribedConnection,
    DescribedCopy,
    DescribedSubDevice,
    Description,
    StartFacts,
    TypeFacts,
)
from fsoe_net.model.library import LibraryDevice, LibraryMapping
from fsoe_net.model.network import ConnectionFacts
from fsoe_net.model.safety import SafetyElement, SafetyFunction
from fsoe_net.model.scan import (
    Scan,
    ScannedConnection,
    ScannedFsoe,
    ScannedPort,
    ScannedSm,
    ScannedSubDevice,
)
from fsoe_net.model.scenario import Action
from fsoe_net.model.test_record import (
    AtMachine,
    StepKind,
    StepOutcome,
    StepResult,
    TestRecord,
    TestStep,
)

OTHERWISE = {
    ("AnsweredDevice", "count"): 1,
    ("ClockFacts", "factor"): 1,
    ("ScannedSm", "complete"): 1,
}


def test_missing_values_are_empty():
    kinds = [
        *(ConnectionFacts, AnsweredDevice, AnsweredWord, Answers),
        *(ClockFacts, DescribedConnection, DescribedCopy, DescribedSubDevice, Description),
        *(StartFacts, TypeFacts, LibraryDevice, LibraryMapping),
        *(AtMachine, TestRecord, TestStep, StepResult, SafetyElement, SafetyFunction),
        *(Scan, ScannedConnection, ScannedFsoe, ScannedPort, ScannedSm),
        ScannedSubDevice,
    ]
    for kind in kinds:
        for field in fields(kind):
            value = field.default
            if value is MISSING and field.default_factory is not MISSING:
                value = field.default_factory()
            if value is MISSING or is_dataclass(value) or isinstance(value, Span):
                continue
            wanted = OTHERWISE.get((kind.__name__, field.name))
            assert value == wanted if wanted else not value, (kind, field.name, value)


def test_questions_and_actions_have_the_words_of_their_files():
    assert {ask.value for ask in Ask} <= {field.name for field in fields(Answers)}
    units = {"MAILBOX_DELAY": "_ms", "AL_DELAY": "_ms", "DELAY": "_us", "STALL": "_ms"}
    for action in Action:
        assert action.value == action.name.lower() + units.get(action.name, "")


SEEN = (None, StepResult(outcome=StepOutcome.AS_EXPECTED, measured_ms=3.5))
SEEN += (StepResult(outcome=StepOutcome.NOT_AS_EXPECTED),)


@pytest.mark.weekly
@pytest.mark.parametrize("kind", [StepKind.TRIGGER, StepKind.FAULT])
def test_each_change_of_what_was_seen_of_a_step(kind: StepKind):
    rows = []
    for outcome, by, date, measured, emulated, live in product(
        (None, *StepOutcome), ("", "me"), ("", "today"), (None, 10.0, 10.5), SEEN, SEEN
    ):
        machine = AtMachine(outcome=outcome, by=by, date=date, measured_ms=measured)
        step = TestStep(
            id="s",
            kind=kind,
            subject="stop",
            what="press",
            expected="stops",
            limit_ms=10.0,
            emulated=emulated,
            live=live,
            machine=machine,
        )
        flags = (step.is_open, step.is_late, step.is_failed, step.is_done, step.is_disputed)
        seen = [None if s is None else s.outcome.value for s in (emulated, live)]
        rows.append((f"{outcome} {by} {date} {measured} {seen}", f"{flags} {machine.filled}"))
    compare(__file__, f"step {kind.value}", rows)


def test_a_network_that_no_other_format_can_state_is_refused():
    network = timed().network
    first, *rest = network.subdevices
    bare = replace(network, subdevices=(replace(first, device=None), *rest))
    with pytest.raises(InputError) as caught:
        describe(bare)
    assert str(caught.value) == (
        f"{first.name}: its slave config could not be read; check the network"
    )
    (net, *others) = network.nets
    (one, *more) = net.connections
    doubted = replace(one, unconfirmed="by a scan")
    nets = (replace(net, connections=(doubted, *more)), *others)
    with pytest.raises(InputError) as caught:
        describe(replace(network, nets=nets))
    assert str(caught.value) == (
        f"{doubted.at('unconfirmed')}: the connection {one.main}-{one.sub} is marked unconfirmed; "
        "compare it with the safety project first"
    )
