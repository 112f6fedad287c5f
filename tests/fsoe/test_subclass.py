"""Subclasses of our ends: an override that the engine would never call is refused."""

from functools import partial

import pytest
from fsoe.pair import Bench, last_reset, make_main, make_sub

from fsoe_net.errors import InputError
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.sub_instance import _HANDLERS, SubInstance


class _OwnData:
    def _in_data(self, pdu):
        """Never called: `step` looks the state up in a table."""


@pytest.mark.parametrize("name", [handler.__name__ for handler in _HANDLERS.values()])
def test_a_subclass_that_overrides_a_method_of_the_table_is_refused(name):
    def own(self, pdu):
        return None

    place = f"{own.__code__.co_filename}:{own.__code__.co_firstlineno}"
    with pytest.raises(InputError) as refused:
        type("Own", (SubInstance,), {name: own})
    assert str(refused.value) == (
        f"{place}: Own overrides SubInstance.{name}, but `step` calls the methods of "
        "the states through a table, so the override has no effect; override `step`"
    )


def test_an_inherited_override_and_one_without_code_are_refused():
    with pytest.raises(InputError, match=r"py:\d+: Mixed overrides SubInstance._in_data,"):
        type("Mixed", (_OwnData, SubInstance), {})
    with pytest.raises(InputError, match=r"^Partial overrides SubInstance._in_reset,"):
        type("Partial", (SubInstance,), {"_in_reset": partial(print)})


def test_an_override_of_a_method_that_is_called_takes_effect():
    class Own(SubInstance):
        def _verdict(self, watchdog_ms):
            return 9

    sub = Own(make_sub(2, 2).config, session_ids=iter(range(1, 99)).__next__)
    bench = Bench(main=make_main(2, 2), sub=sub)
    bench.until(lambda: bench.sub.state is State.PARAMETER)
    bench.sub.take_events()
    bench.until(lambda: bench.sub.state is State.RESET)
    assert last_reset(bench.sub) == (EventKind.RESET_LOCAL, 9)
