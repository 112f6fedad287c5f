"""All checks of a host, in the order of the output."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fsoe_net.host.cpu import CPU, online_cpus
from fsoe_net.host.finding import MachineFinding, MachineLevel, examined
from fsoe_net.host.interface import interface_checks, interface_names
from fsoe_net.host.kernel import KERNEL, release
from fsoe_net.host.machine import MACHINE
from fsoe_net.host.permissions import permission_checks
from fsoe_net.host.seam import Host

# IFNAMSIZ of Linux is 16, with the zero at the end.
_NAME = re.compile(r"[^\s/:]{1,15}", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Examination:
    """Findings about a host. ``interface`` is ``None`` if none was given."""

    release: str
    cpus: int
    interface: str | None
    findings: tuple[MachineFinding, ...]

    @property
    def healthy(self) -> bool:
        """Whether there is neither a warning nor an error; unknown facts do not count."""
        return not any(f.level in (MachineLevel.WARNING, MachineLevel.BAD) for f in self.findings)

    def to_json(self, version: str) -> dict[str, object]:
        """Return the stable JSON document (``docs/reference/json-output.md``)."""
        counts = {level.value: self.count(level) for level in MachineLevel}
        return {
            "tool": "fsoe-net",
            "version": version,
            "kernel": self.release,
            "cpus": self.cpus,
            "interface": self.interface,
            "result": "pass" if self.healthy else "fail",
            "counts": counts,
            "findings": [f.to_json() for f in self.findings],
        }

    def count(self, level: MachineLevel) -> int:
        """Return the number of findings of this level."""
        return sum(f.level is level for f in self.findings)


def examine(host: Host, *, interface: str | None = None, program: str | None = None) -> Examination:
    """Check a host without changing it.

    Args:
        host: The machine.
        interface: Interface of the bus, or ``None``.
        program: Path of ``fsn-master``; ``None`` if missing.

    Raises:
        Unreadable: The system is not Linux, or /proc is missing.
    """
    checks = [*KERNEL, *CPU, *permission_checks(program), *MACHINE]
    findings = [f for check in checks for f in examined(host, check)]
    if interface is not None:
        findings += _of_interface(host, interface)
    return Examination(
        release=release(host),
        cpus=len(online_cpus(host)),
        interface=interface,
        findings=tuple(findings),
    )


def _of_interface(host: Host, interface: str) -> list[MachineFinding]:
    # The name becomes part of a path, so only names that Linux allows are read.
    if not _NAME.fullmatch(interface) or interface in (".", ".."):
        why = "Linux gives interfaces names of 1 to 15 characters without / : and blanks."
        return [
            MachineFinding(
                name="interface.exists",
                level=MachineLevel.BAD,
                text=f"{interface!r} is not a valid name of an interface",
                why=why,
                now=("ip -br link shows their names",),
                keep=(),
            )
        ]
    checks = interface_checks(interface)
    if interface not in interface_names(host):
        checks = checks[:1]  # all others would only repeat the same finding
    return [f for check in checks for f in examined(host, check)]
