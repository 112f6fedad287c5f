"""Runs all rules of a network in their order."""

from __future__ import annotations

from fsoe_net.diag.diagnostic import Diagnostic, sort_diagnostics
from fsoe_net.diag.pause import without_collector
from fsoe_net.model.resolve import Resolution
from fsoe_net.rules.bus import check_bus
from fsoe_net.rules.connections import check_connections, check_drivers
from fsoe_net.rules.context import Context
from fsoe_net.rules.controllers import check_controllers
from fsoe_net.rules.cycle_times import check_cycle_times
from fsoe_net.rules.defaults import check_defaults
from fsoe_net.rules.devices import check_devices
from fsoe_net.rules.drives import check_drives
from fsoe_net.rules.frames import check_frames
from fsoe_net.rules.fsoe import check_fsoe
from fsoe_net.rules.groups import check_groups
from fsoe_net.rules.interfaces import check_interfaces
from fsoe_net.rules.nets import check_nets
from fsoe_net.rules.runtime import Runtime, check_runtime
from fsoe_net.rules.scaling import check_scaling
from fsoe_net.rules.start_up import check_start_up
from fsoe_net.rules.transfer_ends import check_ends


@without_collector
def check(resolution: Resolution, *, runtime: Runtime = Runtime.FSN) -> list[Diagnostic]:
    """Return all findings of a network, sorted by place.

    Args:
        resolution: The network, resolved.
        runtime: Adds the rules of this runtime.
    """
    ctx = Context(resolution=resolution)
    # The order matters: a mistake is reported at its origin, and not again by later rules.
    check_devices(ctx)
    check_defaults(ctx, runtime)
    check_start_up(ctx)
    check_drives(ctx)
    check_scaling(ctx)
    check_cycle_times(ctx)
    check_interfaces(ctx)
    check_controllers(ctx)
    check_bus(ctx)
    check_groups(ctx)
    check_connections(ctx)
    check_ends(ctx)
    check_frames(ctx)
    check_nets(ctx)
    check_fsoe(ctx)
    check_drivers(ctx, runtime)
    check_runtime(ctx, runtime)
    return sort_diagnostics(ctx.diagnostics)
