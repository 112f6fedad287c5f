"""Console of a running ``fsn-master``: its language, its commands, its connection."""

from fsoe_net.run.console.completion import complete
from fsoe_net.run.console.console import COMMANDS, Console
from fsoe_net.run.console.keeper import Keeper

__all__ = ["COMMANDS", "Console", "Keeper", "complete"]
