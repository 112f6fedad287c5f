"""Commands on standard input while an emulation runs."""

from __future__ import annotations

import os
import select

from fsoe_net.cli.terminal import echo
from fsoe_net.simulate.emulate import SegmentSession

_MAX_LINE = 1000


class CommandLines:
    """Reads lines without waiting for them, and prints an answer to each.

    Args:
        descriptor: Of the file to read; its end does not stop the emulation.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._open = True
        self._rest = b""
        self._number = 0

    def __call__(self, session: SegmentSession, now_ns: int) -> None:
        """Execute the commands that arrived since the last call."""
        # Without waiting: the devices must step in time, whether commands arrive or not.
        while self._open and select.select([self._descriptor], [], [], 0)[0]:
            self._take()
            *lines, self._rest = self._rest.split(b"\n")
            # A last line without a line end, and one that is too long for a command.
            if len(self._rest) > _MAX_LINE or (self._rest and not self._open):
                lines.append(self._rest)
                self._rest = b""
            for line in lines:
                self._answer(line, session, now_ns)

    def _take(self) -> None:
        data = os.read(self._descriptor, 4096)
        self._open = bool(data)
        self._rest += data

    def _answer(self, line: bytes, session: SegmentSession, now_ns: int) -> None:
        self._number += 1
        text = line[:_MAX_LINE].decode("utf-8", "replace")
        answer = session.command(text, self._number, now_ns)
        if answer:
            echo(answer, err=True)
