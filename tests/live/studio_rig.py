"""A case of `live_rig.py` with the live page of `fsoe-net studio` in a browser beside the run."""

from __future__ import annotations

import contextlib
import signal
from pathlib import Path

from live.live_rig import CASES, Emulator, Running, main
from studio.browser import launched
from studio.live_page import opened
from studio.server_rig import running as serving


def cable(network, _other):
    """The cable behind the first SubDevice is cut and spliced: what the page shows of it."""
    emulator = Emulator(network)
    running = Running(network)
    with contextlib.ExitStack() as stack:
        studio = stack.enter_context(serving(Path("network.yaml"), running.socket))
        page = stack.enter_context(opened(stack.enter_context(launched()), f"{studio.url}#live"))
        strips, events = page.locator(".strips"), page.locator(".events")
        strips.get_by_text("✔ 1 of 1 in Data").wait_for()
        page.locator(".device .al.good").nth(1).wait_for()  # both in OP
        resets = events.get_by_text("SubInstance resets: watchdog expired")
        before = resets.count()  # a busy machine has Resets of its own
        emulator.do("cut ek1914")
        device = page.get_by_role("button", name="el1918, safety logic")
        device.get_by_text("✖ no answer").wait_for()
        device.press("Enter")
        panel = page.locator(".panel")
        panel.get_by_text("✖ none").wait_for()
        panel.get_by_text("ek1914").wait_for()  # behind which nothing answers
        resets.nth(before).wait_for()
        strips.get_by_text("✖ 0 of 1 in Data").wait_for()
        seen = {"gone": panel.inner_text(), "verdict": page.locator(".live .verdict").inner_text()}
        page.get_by_role("button", name="FSoE connection").press("Enter")
        seen["cause"] = panel.locator(".cause").first.inner_text()
        emulator.do("splice ek1914")
        strips.get_by_text("✔ 1 of 1 in Data").wait_for()
        device.get_by_text("OP", exact=False).wait_for()
        device.press("Enter")
        panel.get_by_text("ports 0 up").wait_for()
        seen["back"] = panel.inner_text()
    running.end(signal.SIGINT)
    emulator.end()
    return seen


CASES |= {"cable": cable}

if __name__ == "__main__":
    main()
