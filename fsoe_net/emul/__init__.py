"""FSoE devices living on an emulated bus; they know no core, only sync managers. Time is given."""

from fsoe_net.emul.bus import EmulatedNetwork, build_network, normal_name
from fsoe_net.emul.device import EmulatedDevice, Port, ProcessData
from fsoe_net.emul.logic import SafetyLogic
from fsoe_net.emul.setup import ConnectionSetup, choose_setups

__all__ = [
    "ConnectionSetup",
    "EmulatedDevice",
    "EmulatedNetwork",
    "Port",
    "ProcessData",
    "SafetyLogic",
    "build_network",
    "choose_setups",
    "normal_name",
]
