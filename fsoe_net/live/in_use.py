"""Compares the plan of a running ``fsn-master`` with the files."""

from __future__ import annotations

from fsoe_net.errors import InputError
from fsoe_net.host.ethtool import driver as network_driver
from fsoe_net.host.seam import Host, Unreadable
from fsoe_net.live.control_values import Status
from fsoe_net.plan.fingerprint import Fingerprint, cycle_sha256, fingerprint_of_sections

# Drivers of the Linux kernel that have no hardware.
_NO_CARDS = frozenset({"veth", "tun", "dummy", "netdevsim"})


def fingerprint_in_use(status: Status) -> Fingerprint | None:
    """Return the fingerprint of the running plan, with the bus cycle actually in use.

    ``None`` if the program does not report it. A cycle that differs from the plan counts as a
    differing section.
    """
    reported = status.fingerprint
    if reported is None:
        return None
    used = cycle_sha256(status.cycle_ns)
    # 0: the files state no cycle, so any cycle fits.
    if reported.sections["cycle"] in (used, cycle_sha256(0)):
        return reported
    return fingerprint_of_sections({**reported.sections, "cycle": used})


def check_in_use(status: Status, wanted: Fingerprint | None, plan_sha256: str) -> None:
    """Check that the running plan matches the files.

    Args:
        status: Status of the running ``fsn-master``.
        wanted: Fingerprint of the files; if either side has none, the plans are compared.
        plan_sha256: Hash of the plan of the files.

    Raises:
        InputError: The running plan differs; the message names the sections that differ.
    """
    reported = fingerprint_in_use(status)
    if wanted is None or reported is None:
        if status.plan_sha256 != plan_sha256:
            raise InputError(
                f"fsn-master runs another plan ({status.plan_sha256[:16]}) than these files give "
                f"({plan_sha256[:16]}); start it with the plan of these files"
            )
        return
    if reported.whole != wanted.whole:
        raise InputError(
            f"fsn-master runs another configuration ({reported.short}) than these files give "
            f"({wanted.short}); it differs in {', '.join(wanted.changed(reported))}; start it with "
            "the plan of these files, `fsoe-net acceptance verify` shows the difference"
        )


def emulated_bus(status: Status) -> str:
    """Return why the bus is a test rig and not a machine; empty without evidence.

    A network card is not evidence, because the devices connected to it cannot be identified.
    """
    if status.backend == "emulated":
        return "the bus of fsn-master is emulated"
    try:
        driver = network_driver(Host(), status.interface) if status.interface else ""
    except (OSError, Unreadable):
        return ""
    return f"{status.interface} is not a network card ({driver})" if driver in _NO_CARDS else ""
