"""A network on the emulated bus, advanced step by step."""

from __future__ import annotations

import os
from collections.abc import Callable

from fsoe_net.live.result import ConnectionResult, Run
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.simulate import prepare


class EmulatedNetwork:
    """A network whose devices and bus are emulated, in virtual time.

    Time is frozen except in `advance` and `wait`. The same calls give the same result. Reset is
    pressed automatically when all connections are in Data.

    Args:
        files: Files as in `fsoe_net.load`.

    Raises:
        InputError: The network has an error, or no FSoE connection.
        CoreMissing: The compiled part is missing.
    """

    def __init__(self, *files: str | os.PathLike[str]) -> None:
        resolution = whole_network(check_files([os.fspath(f) for f in files]), "nothing started")
        self._session = prepare(resolution, None, None, virtual=True)
        self._cycles = 0
        self._commands = 0

    @property
    def now_s(self) -> float:
        """Virtual time since the start, in seconds."""
        return self._now_ns / 1e9

    @property
    def connections(self) -> dict[str, ConnectionResult]:
        """The current state of every connection, by name."""
        rows = self._session.connections(self._session.core.snapshot())
        return {row.name: row for row in rows}

    @property
    def in_data(self) -> bool:
        """Whether every connection with both ends present is in Data."""
        rows = self.connections
        return all(rows[name].state.in_data for name in rows if self._session.is_due(name))

    def advance(self, seconds: float) -> None:
        """Run bus cycles for this time, at least one."""
        end_ns = self._now_ns + round(seconds * 1e9)
        self._cycle()
        while self._now_ns < end_ns:
            self._cycle()

    def wait(self, condition: Callable[[EmulatedNetwork], bool], *, within_s: float = 5.0) -> None:
        """Run bus cycles until a condition holds.

        Args:
            condition: Function that takes this network.
            within_s: Timeout in virtual seconds.

        Raises:
            TimeoutError: The condition was never met.
        """
        end_s = self.now_s + within_s
        while not condition(self):
            if self.now_s >= end_s:
                raise TimeoutError(f"did not hold within {within_s:g} s of virtual time")
            self._cycle()

    def do(self, command: str) -> None:
        """Run a command of ``fsoe-net emulate --commands`` now.

        Args:
            command: Command such as ``set el1904.channel_1 0``, ``break el1904``, ``press``.

        Raises:
            ValueError: Unknown command, or it is invalid for the network.
        """
        self._commands += 1
        self._session.do_command(command, self._commands, self._now_ns)

    def result(self) -> Run:
        """Return the observations, like `fsoe_net.Network.simulate`."""
        return self._session.result("virtual", self._now_ns)

    @property
    def _now_ns(self) -> int:
        return self._cycles * self._session.cycle_ns

    def _cycle(self) -> None:
        self._cycles += 1
        self._session.core.cycle(self._now_ns)
        self._session.step_devices(self._now_ns)
