"""Facts of a connection that no file states are chosen, the same way every time."""

from dataclasses import replace

from simulate.bench import ESTOP, ROBOT, load

from fsoe_net.model.network import ConnectionFacts
from fsoe_net.model.resolve import Resolution
from fsoe_net.simulate.setup import choose_setups


def with_facts(resolution: Resolution, *facts: ConnectionFacts | None) -> Resolution:
    rows = zip(resolution.connections, facts, strict=True)
    return replace(resolution, connections=tuple(replace(c, facts=f) for c, f in rows))


def test_stated_facts_are_taken_as_they_are():
    (setup,) = choose_setups(load(ESTOP))
    assert (setup.main.connection_id, setup.main.address, setup.main.watchdog_ms) == (1, 14, 100)
    assert setup.chosen == ()


def test_missing_facts_are_chosen():
    setups = choose_setups(with_facts(load(ROBOT), None, None, None, None))
    assert [s.main.connection_id for s in setups] == [1, 2, 3, 4]
    assert [s.main.address for s in setups] == [1, 2, 3, 4]
    assert {s.main.watchdog_ms for s in setups} == {100}
    assert {s.chosen for s in setups} == {("connection_id", "address", "watchdog_ms")}


def test_chosen_numbers_avoid_stated_ones_wherever_they_are():
    stated = ConnectionFacts(main="", sub="", connection_id=1, address=2)
    setups = choose_setups(with_facts(load(ROBOT), None, None, None, stated))
    assert [s.main.connection_id for s in setups] == [2, 3, 4, 1]
    assert [s.main.address for s in setups] == [1, 3, 4, 2]
    assert setups[3].chosen == ("watchdog_ms",)


def test_address_zero_is_a_stated_address():
    stated = ConnectionFacts(main="", sub="", address=0)
    (setup,) = choose_setups(with_facts(load(ESTOP), stated))
    assert setup.main.address == 0
    assert "address" not in setup.chosen
