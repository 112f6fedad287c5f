"""A console on a made-up fsn-master."""

from __future__ import annotations

from fsoe_net.live.console.console import Console
from fsoe_net.live.console.leased_client import LeasedClient


class Rig:
    def __init__(self, path, **more):
        self.lines, self.notes = [], []
        self.link = LeasedClient(path, **more)
        self.console = Console(self.link, self.lines.append, self.notes.append)

    def do(self, text):
        """Run a line and return what it printed."""
        self.lines.clear()
        self.console.run_line(text)
        return list(self.lines)

    def script(self, text):
        self.console.run_script(text, "s.fsn")
