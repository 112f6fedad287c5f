"""Measures studio in Chromium: the first page, a change in it, and the live page.

The first page: of an example and of 100 and 300 SubDevices, from the address to the drawing; a
change in the drawing of those, to its finding; a try of 300. Live: 60
connections and 20 signals: an emulated run in which devices are pulled and put back all the time,
and a real fsn-master at 1 kHz: pictures a second, processor, events and cycles that miss. Prints
what came and the limits; asserts nothing.
"""

from __future__ import annotations

import contextlib
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from master.rig import running as master_running
from networks import write_big_network
from playwright.sync_api import sync_playwright
from studio.browser import ARGUMENTS, CHROMIUM
from studio.server_rig import running

CONNECTIONS, SIGNALS, FIRST_PAGES = 60, 20, 9
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
CHANGES = 10
EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE = {"width": 1920, "height": 1080}
# What the stream brings to the page, by a listener of its own: nothing of the page is changed.
COUNT = """(() => {
    const seen = window.seen =
        { pictures: 0, gaps: 0, events: 0, next: -1, rows: 0, nextRow: -1, rowGaps: 0 };
    const Plain = window.EventSource;
    window.EventSource = class extends Plain {
        constructor(url) {
            super(url);
            if (!url.includes('/live/')) return;
            this.addEventListener('message', (event) => {
                const { first, events, scope, pace } = JSON.parse(event.data);
                if (seen.next >= 0 && first !== seen.next) seen.gaps += 1;
                const same = seen.nextRow >= 0 && seen.choice === scope.choice;
                if (same && scope.first !== seen.nextRow) seen.rowGaps += 1;
                seen.pictures += 1;
                seen.next = first + events.length;
                seen.events += events.length;
                seen.nextRow = scope.first + scope.rows.length;
                seen.rows += scope.rows.length;
                Object.assign(seen, { choice: scope.choice, skipped: scope.skipped, pace });
            });
        }
    };
})()"""
POST = """([act, body]) => fetch(`/api/live/${act}`, {
    method: 'POST', body: JSON.stringify(body),
    headers: { 'content-type': 'application/json', 'x-fsoe-net': '1' },
}).then(() => 0)"""


def durations(session: Any) -> dict[str, float]:
    rows = session.send("Performance.getMetrics")["metrics"]
    return {row["name"]: row["value"] for row in rows}


def processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def measure(page: Any, act: Any = None) -> None:
    """Watch for some seconds and print what came."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    page.wait_for_timeout(2000)
    before, seen = durations(session), page.evaluate("({...seen})")
    own, begin = processor_s(), time.monotonic()
    while time.monotonic() < begin + SECONDS:
        if act is not None:
            act()
        page.wait_for_timeout(250)
    past, server = time.monotonic() - begin, processor_s() - own
    after, got = durations(session), page.evaluate("({...seen})")
    share = {
        name: (after[f"{name}Duration"] - before[f"{name}Duration"]) / past
        for name in ("Task", "Script", "Layout")
    }
    print(f"  pictures a second: {(got['pictures'] - seen['pictures']) / past:.1f}, limit: 20")
    print("  page, share of a processor:", ", ".join(f"{k} {v:.2f}" for k, v in share.items()))
    print(f"  page, memory: {after['JSHeapUsedSize'] / 1e6:.0f} MB")
    print(f"  server and its source, share of a processor: {server / past:.2f}")
    print(f"  events: {got['events']}, gaps in their numbers: {got['gaps']}, limit: 0")
    print(f"  cycles in the scope: {got['rows']}, missing: {got['skipped'] + got['rowGaps']}")
    if got["pace"] is not None:
        print(f"  pace beside the clock: {got['pace']:.2f}")


# Seen by the page itself: a locator reads the text of each element, which takes longer than this.
SEEN = """([where, text, there]) => new Promise((done) => {
    const look = () => {
        const found = [...document.querySelectorAll(where)].some((e) => e.textContent === text);
        if (found === there) requestAnimationFrame(() => done(0));
        else setTimeout(look, 10);
    };
    look();
})"""


def choose(page: Any, source: str) -> int:
    """Show as many signals as there are, up to the limit; return how many."""
    path = f"/api/live/signals?source={source}"
    rows = page.evaluate("async (path) => (await (await fetch(path)).json()).signals", path)
    names = [row["name"] for row in rows[:SIGNALS]]
    page.evaluate(POST, ["scope", {"source": source, "signals": names}])
    return len(names)


def opened(stack: contextlib.ExitStack, browser: Any, path: Path, socket: Path | None) -> Any:
    studio = stack.enter_context(running(path, socket))
    page = browser.new_page(viewport=SIZE)
    stack.callback(page.close)
    page.add_init_script(COUNT)
    page.goto(f"{studio.url}#live")
    return page


def emulated(browser: Any, folder: Path, cycle_us: int) -> None:
    path = write_big_network(folder, CONNECTIONS + 2, 2 * CONNECTIONS)
    text = path.read_text("utf-8").replace("cycle_us: 1000", f"cycle_us: {cycle_us}")
    path.write_text(text, "utf-8")
    with contextlib.ExitStack() as stack:
        page = opened(stack, browser, path, None)
        page.get_by_role("button", name="Start an emulated run").click()
        page.locator(".strips li").nth(CONNECTIONS - 1).wait_for()
        signals, words = choose(page, "emulated"), ["heal", "break"]

        def act() -> None:
            words.reverse()
            lines = [f"{words[0]} s{n}" for n in range(1, 11)]
            page.evaluate(POST, ["command", {"lines": lines}])

        print(
            f"emulated run, {CONNECTIONS} connections, {signals} signals, bus cycle {cycle_us} us"
        )
        measure(page, act)


def master(browser: Any, folder: Path) -> None:
    with contextlib.ExitStack() as stack:
        driven = stack.enter_context(master_running("--cycle", "1ms"))
        page = opened(stack, browser, folder / "none" / "network.yaml", driven.path)
        page.locator(".strips li").first.wait_for()
        signals = choose(page, "master")
        print(f"fsn-master at 1 kHz, example el6910, {signals} signals")
        measure(page)


def first_page(browser: Any, path: Path, limit_ms: int) -> None:
    """Print how long it takes from the address to the drawing, in a browser that runs."""
    took = []
    for _ in range(FIRST_PAGES):
        with running(path) as studio:
            page = browser.new_page(viewport=SIZE)
            begin = time.monotonic()
            page.goto(studio.url)
            page.locator(".card").first.wait_for()
            took.append(time.monotonic() - begin)
            page.close()
    print(f"first page of {path.parent.name}, {FIRST_PAGES} times:")
    show(took, limit_ms)


def show(took: list[float], limit_ms: int) -> None:
    took.sort()
    middle, longest = took[len(took) // 2] * 1000, took[-1] * 1000
    print(f"  median {middle:.0f} ms, longest {longest:.0f} ms, limit: {limit_ms} ms")


def changes(browser: Any, path: Path, limit_ms: int) -> None:
    """Print how long it takes from a change in the drawing to its finding, and back; a try."""
    took = []
    with running(path) as studio:
        page = browser.new_page(viewport=SIZE)
        page.goto(studio.url)
        page.get_by_role("button", name="s5", exact=False).first.click()
        for number in range(CHANGES):
            wrong = number % 2 == 0
            page.get_by_label("Position").fill("7" if wrong else "5")
            begin = time.monotonic()
            page.keyboard.press("Enter")
            page.evaluate(SEEN, [".findings code", "FSN414", wrong])
            took.append(time.monotonic() - begin)
        begin = time.monotonic()
        page.get_by_role("button", name="Try it").click()
        page.locator(".trial [role=status]").wait_for()
        tried = time.monotonic() - begin
        page.close()
    print(f"a change in the drawing of {path.parent.name} SubDevices, {CHANGES} times; a try:")
    show(took, limit_ms)
    print(f"  try {tried:.1f} s")


def main() -> None:
    with tempfile.TemporaryDirectory() as text, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        (Path(text) / "none").mkdir()
        first_page(browser, EXAMPLES / "el6910" / "network.yaml", 500)
        for number, limits_ms in ((100, (500, 300)), (300, (1500, 1000))):
            (Path(text) / str(number)).mkdir()
            path = write_big_network(Path(text) / str(number), number, 2 * (number - 2))
            first_page(browser, path, limits_ms[0])
            changes(browser, path, limits_ms[1])
        for cycle_us in (1000, 20_000):
            emulated(browser, Path(text), cycle_us)
        master(browser, Path(text))
        browser.close()


if __name__ == "__main__":
    main()
