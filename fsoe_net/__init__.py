"""fsoe-net: check, compile, run and report FSoE (Safety over EtherCAT) networks.

    import fsoe_net

    network = fsoe_net.load("network.yaml")
    for finding in network.check():
        ...
    network.compile().save("machine.fsnplan")

These names are stable; see ``docs/reference/stability.md`` for how they change. The packages below
are internal and change without notice.

Part of the black channel, not certified, never a safety function.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from fsoe_net.version import __version__ as __version__

if TYPE_CHECKING:
    from fsoe_net.acceptance.report import Report
    from fsoe_net.capture.decode import DecodedFrame
    from fsoe_net.diag.diagnostic import Diagnostic, Severity
    from fsoe_net.errors import ControlRefused, EnvironmentFault, FsnError, InputError
    from fsoe_net.fsoe.observed import ConnectionState
    from fsoe_net.live.client import Client
    from fsoe_net.live.result import Run
    from fsoe_net.network import Network, connect, convert, decode, load, propose
    from fsoe_net.plan.model import Plan
    from fsoe_net.project.convert import Conversion
    from fsoe_net.project.findings import Findings
    from fsoe_net.proposal.draft import Draft

__all__ = [
    "Client",
    "ConnectionState",
    "ControlRefused",
    "Conversion",
    "DecodedFrame",
    "Diagnostic",
    "Draft",
    "EnvironmentFault",
    "Findings",
    "FsnError",
    "InputError",
    "Network",
    "Plan",
    "Report",
    "Run",
    "Severity",
    "connect",
    "convert",
    "decode",
    "load",
    "propose",
]

# Imported on first use: a command loads only what it needs.
_PLACES = {
    "Client": "live.client",
    "ConnectionState": "fsoe.observed",
    "ControlRefused": "errors",
    "Conversion": "project.convert",
    "DecodedFrame": "capture.decode",
    "Diagnostic": "diag.diagnostic",
    "Draft": "proposal.draft",
    "EnvironmentFault": "errors",
    "Findings": "project.findings",
    "FsnError": "errors",
    "InputError": "errors",
    "Network": "network",
    "Plan": "plan.model",
    "Report": "acceptance.report",
    "Run": "live.result",
    "Severity": "diag.diagnostic",
    "connect": "network",
    "convert": "network",
    "decode": "network",
    "load": "network",
    "propose": "network",
}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_PLACES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
