"""A developer's own end: found by name, and told apart from faults of this program."""

import pickle

import pytest

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.fsoe.config import SubConfig
from fsoe_net.simulate.device_logic import device_factory

CONFIG = SubConfig(address=1, safe_out_bytes=2, safe_in_bytes=2)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("fsoe.devices", "not module:factory"),
        (":x", "not module:factory"),
        ("fsoe.devices:", "not module:factory"),
        ("no_such_module:x", "cannot be imported"),
        ("fsoe.devices:nothing", "has no 'nothing'"),
        ("fsoe.devices:not_callable", "cannot be called"),
    ],
)
def test_names_that_lead_nowhere(name, text):
    with pytest.raises(InputError, match=text):
        device_factory(name)


def test_a_factory_that_returns_no_end():
    with pytest.raises(EnvironmentFault, match="lacks step, power_cycle, received_safe_data"):
        device_factory("fsoe.devices:no_end")(CONFIG)
    with pytest.raises(EnvironmentFault, match="json:loads: the factory raised TypeError"):
        device_factory("json:loads")(CONFIG)


def test_an_end_shows_through():
    end = pickle.loads(pickle.dumps(device_factory("fsoe.devices:strange_sub_that_takes_data")))(
        CONFIG
    )
    end.enable = True
    assert end._end.enable
    assert end.step(0, None) is None
    assert not hasattr(end, "snapshot")
    assert hasattr(device_factory("fsoe.devices:ignores_crc")(CONFIG), "snapshot")


def test_an_exception_names_the_device():
    end = device_factory("fsoe.devices:raising_sub")(CONFIG)
    with pytest.raises(EnvironmentFault, match=r"fsoe\.devices:raising_sub: step\(\) raised Value"):
        end.step(0, None)
