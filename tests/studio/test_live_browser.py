"""The live page in a real browser: an emulated run that is acted on, and a real fsn-master."""

from __future__ import annotations

import contextlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from master.rig import running as master_running
from networks import example
from studio.browser import accessible, text_of, write_text
from studio.live_page import opened
from studio.server_rig import running

from fsoe_net.project.simulate import simulate
from fsoe_net.studio import live_control

EXAMPLES = Path(__file__).parents[2] / "examples"


def after(page: Any, seconds: float) -> None:
    """Wait until so much time of the run is over."""
    page.wait_for_function(
        "until => parseFloat(document.querySelector('.times > .row output').textContent) >= until",
        arg=float(page.locator(".times > .row output").inner_text().split()[0]) + seconds,
    )


def hide(page: Any, hidden: bool) -> None:
    page.evaluate(
        """hidden => {
            Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
            document.dispatchEvent(new Event('visibilitychange'));
        }""",
        hidden,
    )


def keep_late(page: Any) -> None:
    """Have the next keep-control reach the server, and its answer the page, after give-control."""
    page.evaluate(
        """async () => {
            const { fetch } = window;
            const late = Promise.withResolvers();
            const keep = await new Promise((then) => {
                window.fetch = (...request) => {
                    if (!request[0].endsWith('/keep-control')) return fetch(...request);
                    then(request);
                    return late.promise;
                };
            });
            window.fetch = async (...request) => {
                const answer = await fetch(...request);
                if (request[0].endsWith('/give-control')) {
                    const kept = await fetch(...keep);
                    const body = await kept.text();
                    const shown = new MutationObserver(() => {
                        if (!document.body.innerText.includes('Control is given back')) return;
                        shown.disconnect();
                        late.resolve(new Response(body, kept));
                    });
                    const all = { childList: true, characterData: true, subtree: true };
                    shown.observe(document.body, all);
                    window.fetch = fetch;
                }
                return answer;
            };
        }"""
    )


def drawn(page: Any, name: str) -> int:
    """How many pixels of the first strip have a colour."""
    return int(
        page.evaluate(
            """async name => {
                const { colour } = await import('/assets/colours.js');
                const canvas = document.querySelector('.strips canvas');
                canvas.scrollIntoView();
                await new Promise((then) => setTimeout(then, 100)); // it is drawn when in sight
                const { width, height } = canvas;
                const copy = new OffscreenCanvas(width, height + 1);
                const pen = copy.getContext('2d', { willReadFrequently: true });
                pen.fillStyle = colour(name);
                pen.fillRect(0, 0, 1, 1);
                pen.drawImage(canvas, 0, 1);
                const { data } = pen.getImageData(0, 0, width, height + 1);
                const [wanted, ...seen] = new Uint32Array(data.buffer);
                return seen.filter((pixel) => pixel === wanted).length;
            }""",
            name,
        )
    )


def test_people_learn_what_an_e_stop_and_a_pulled_subdevice_do(
    chromium: Any, tmp_path: Path
) -> None:
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    with (
        running(tmp_path / "estop" / "network.yaml") as studio,
        opened(chromium, studio.url) as page,
    ):
        write_text(page, text_of(page) + "# more\n")
        page.wait_for_selector("text=not saved")
        page.get_by_role("link", name="Live").click()
        page.get_by_role("button", name="Start an emulated run").click()
        logic = page.get_by_role("button", name="el1918, safety logic")
        logic.get_by_text("outputs on").wait_for()
        page.get_by_role("button", name="Save", exact=True).click()  # the same text: the same run
        page.get_by_text("· saved").wait_for()
        after(page, 0.1)
        assert page.get_by_text("earlier text").count() == 0
        strips, events = page.locator(".strips"), page.locator(".events")
        effects = page.locator(".effects")
        strips.get_by_text("Data · ProcessData").wait_for()
        page.get_by_text("Press the red e-stop").wait_for()
        page.get_by_role("button", name="Press button ES1 at ek1914").click()
        logic.get_by_text("outputs off").wait_for()
        assert "The connection stays in Data" in page.locator(".expect").inner_text()
        effects.get_by_text("Pressed: button ES1 at ek1914.").wait_for()
        strips.get_by_text("Data · FailSafeData").wait_for()
        accessible(page, "light", "dark")
        page.get_by_role("button", name="Release button ES1 at ek1914").click()
        effects.get_by_text("Off: the outputs of el1918.").wait_for()
        after(page, 0.1)  # reset counts where the logic has every input already
        reset = page.get_by_role("button", name="Reset of")
        reset.focus()
        reset.hover()
        page.keyboard.down("Enter")  # a button that is held, by keyboard
        page.keyboard.down("Enter")  # the key repeats while it is held
        page.mouse.move(0, 0)  # or the page moves below a pointer that stands still
        logic.get_by_text("outputs on").wait_for()
        page.get_by_text("All connections exchange data").wait_for()
        after(page, 0.1)
        assert events.get_by_text("command: release el1918").count() == 0
        page.keyboard.up("Enter")
        events.get_by_text("command: release el1918").wait_for()
        page.get_by_role("button", name="ek1914, terminal").press("Enter")
        panel = page.get_by_role("region", name="Details of ek1914")
        panel.get_by_role("button", name="Disconnect it").click()
        events.get_by_text("resets: watchdog expired").first.wait_for()
        effects.get_by_text("Disconnected: ek1914.").wait_for()
        effects.get_by_text("Last Reset: watchdog expired.").wait_for()
        panel.get_by_role("button", name="Reconnect it").click()
        strips.get_by_text("Data · FailSafeData").wait_for()
        panel.get_by_text("lost and back once").wait_for()
        assert drawn(page, "strip-process")
        assert drawn(page, "strip-low")
        reset.evaluate("e => e.click()")  # as a screen reader does
        logic.get_by_text("outputs on").wait_for()
        panel.get_by_text("Safe inputs one by one").click()
        panel.get_by_role("button", name="Set e-stop channel B to 0").click()
        page.get_by_role("button", name="Release button ES1 at ek1914").click()
        effects.get_by_text("Off: the outputs of el1918.").wait_for()
        accessible(page, "dark")
        page.get_by_role("button", name="Close the details").click()
        page.get_by_text("More to try").click()
        page.get_by_role("button", name="Hold the frames for 150 ms").click()
        effects.get_by_text("Reset, and back in Data: el1918-ek1914.").wait_for()
        assert "longer than each FSoE watchdog" in page.locator(".expect").inner_text()
        page.get_by_label("or for (ms)").fill("20")
        page.keyboard.press("Enter")
        events.get_by_text("bus: no frames for 20 ms").wait_for()
        assert "shorter than each FSoE watchdog" in page.locator(".expect").inner_text()
        page.get_by_role("button", name="Pause").click()
        shown = page.locator(".times > .row output").inner_text()
        page.get_by_role("button", name="el1918-ek1914", exact=True).click()
        page.locator("p.cause", has_text="last Reset: watchdog expired").wait_for()
        page.get_by_label("Resets only").check()
        assert "▼" in events.locator("li").first.inner_text()
        page.get_by_role("textbox", name="A command as").fill("explode")
        page.keyboard.press("Enter")
        page.get_by_text("unknown command 'explode'").wait_for()
        assert page.locator(".times > .row output").inner_text() == shown  # paused
        accessible(page, "dark")
        with page.expect_download() as saved:
            page.get_by_role("link", name="Save the record").click()
        path = tmp_path / "run.json"
        saved.value.save_as(path)
        document = json.loads(path.read_text("utf-8"))
        document["connections"][0]["last_reset_text"] = "<img src=x>\x1b[2J"
        path.write_text(json.dumps(document), "utf-8")
        hide(page, True)  # a hidden tab costs nothing
        feed = studio._live._emulated
        while feed.listeners:
            page.wait_for_timeout(10)
        hide(page, False)
        while not feed.listeners:
            page.wait_for_timeout(10)
        page.get_by_role("button", name="End the run").click()
        page.wait_for_selector("text=estop: ended")
        assert page.locator(".mushroom").count() == 0  # nothing acts any more
        page.get_by_label("Open a recorded run").set_input_files(path)
        page.get_by_text("estop: recorded").wait_for()
        page.get_by_role("button", name="FSoE connection el1918-ek1914").press("Enter")
        page.locator("p.cause", has_text=r"last Reset: <img src=x>\u001b[2J").wait_for()
        assert page.locator("img").count() == 0
        assert page.locator(".cable[role]").count() == 0
        assert drawn(page, "strip-process")
        assert drawn(page, "strip-low")
        run = simulate(example("estop"), duration_ns=1_000_000_000)  # its ends alone say states
        path.write_text(json.dumps(run.to_json("0")), "utf-8")
        page.get_by_label("Open a recorded run").set_input_files(path)
        page.locator(".times").get_by_text("1.000 s").wait_for()
        assert drawn(page, "main")
        path.write_text("{}", "utf-8")
        page.get_by_label("Open a recorded run").set_input_files(path)
        page.get_by_text("this is not a recorded run").wait_for()


def test_a_running_bus_is_shown_and_its_signals_drawn(chromium: Any, tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        master = stack.enter_context(master_running())
        studio = stack.enter_context(running(tmp_path / "network.yaml", master.path))
        page = stack.enter_context(opened(chromium, f"{studio.url}#live"))
        page.get_by_text("0 of 4 in Data").wait_for()  # nobody lives on its emulated bus
        page.get_by_label("Add a signal").select_option("el2904.standard_1")
        page.locator(".scope canvas").wait_for()
        page.get_by_role("button", name="Take el2904.standard_1 away").wait_for()
        page.get_by_text("Bus cycle: working counter").click()
        page.locator(".bars rect").first.wait_for()
        assert page.locator(".machine .device").count() == 5
        page.get_by_role("button", name="drive_1, drive").press("Enter")
        panel = page.get_by_role("region", name="Details of drive_1")
        assert panel.get_by_role("button").count() == 1  # Close: nothing acts on a real bus
        assert page.locator(".cable[role], .mushroom, .reset").count() == 0
        accessible(page, "light")
        with master.client() as client:
            client.good("stop")
        page.get_by_text(": stopped").wait_for()
        assert page.locator(".strips li").count() == 4  # what was seen stays


MODE = "drive_1.0x6060:00"  # stop value 8
START = "el6910.logic_control"  # can restart a machine


def test_a_person_controls_a_bus_for_as_long_as_the_page_is_in_sight(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_control, "LEASE_MS", 600_000)  # a busy machine loses no control
    with contextlib.ExitStack() as stack:
        master = stack.enter_context(master_running())
        studio = stack.enter_context(
            running(tmp_path / "network.yaml", master.path, allow_control=True)
        )
        page = stack.enter_context(opened(chromium, f"{studio.url}#live"))
        watch = stack.enter_context(master.client())
        watch.good("events on")
        page.get_by_text("it may start and stop the bus and set outputs there").wait_for()
        page.get_by_role("button", name="Take control").click()
        page.get_by_text("This page has control").wait_for()
        events = page.locator(".events")
        page.get_by_label(f"New value of {MODE}").fill("9")
        page.keyboard.press("Enter")
        events.get_by_text(f"page: sets {MODE} to 9").wait_for()
        page.get_by_text("● set here").wait_for()
        accessible(page, "light")
        page.get_by_label(f"New value of {START}").fill("300")
        button = page.get_by_label(f"Set {START}", exact=True)
        button.focus()
        page.keyboard.press("Enter")
        dialog = page.get_by_role("dialog")
        arm = dialog.get_by_role("button", name="Arm and set")
        assert dialog.locator("li").first.inner_text().startswith("First secure the machine")
        assert arm.is_disabled()
        accessible(page, "dark")
        for _ in range(5):  # the focus stays inside, or with the browser itself
            page.keyboard.press("Tab")
            assert page.evaluate(
                "() => document.activeElement === document.body"
                " || document.activeElement.closest('dialog') !== null"
            )
        page.keyboard.press("Escape")
        dialog.wait_for(state="detached")
        assert button.evaluate("e => e === document.activeElement")
        for value in ("300", "3"):
            page.get_by_label(f"New value of {START}").fill(value)
            page.keyboard.press("Enter")
            dialog.get_by_role("checkbox").focus()
            page.keyboard.press("Space")
            arm.click()
            dialog.wait_for(state="detached")
            if value == "300":
                page.get_by_text("takes a whole number from 0 to 255").wait_for()
        events.get_by_text(f"page: arms {START} and sets it to 3").wait_for()
        assert watch.event("arm")["output"] == START
        assert watch.event("edge")["raw"] == 3
        page.get_by_label(f"Stop value of {START}").click()
        events.get_by_text(f"page: sets {START} to 0").wait_for()
        second = page.context.new_page()
        second.set_default_timeout(200_000)
        second.goto(f"{page.url.partition('#')[0]}#live")
        second.get_by_text("Another page has control").wait_for()
        assert second.locator(".outputs").count() == 0
        second.close()
        page.get_by_role("button", name="Stop the bus …").click()
        dialog.get_by_text("This is not an emergency stop").wait_for()
        dialog.get_by_role("button", name="Stop the bus").click()
        page.get_by_text(": stopped").wait_for()
        page.get_by_text("None now.").wait_for()
        assert watch.event("fallback")["why"] == "stop"
        page.get_by_role("button", name="Start the bus …", exact=True).click()
        dialog.get_by_role("button", name="Start the bus").click()
        page.get_by_label(f"New value of {MODE}").wait_for()
        keep_late(page)
        page.get_by_role("button", name="Give control back").click()
        page.get_by_text("Control is given back").wait_for()
        # From here on the lease is that of people.
        monkeypatch.setattr(live_control, "LEASE_MS", 5000)
        page.get_by_role("button", name="Take control").click()
        page.get_by_label(f"New value of {MODE}").fill("9")
        page.keyboard.press("Enter")
        events.get_by_text(f"page: sets {MODE} to 9").nth(1).wait_for()
        hide(page, True)
        assert watch.event("fallback")["why"] == "silent"
        watch.wait_for(MODE, 8)
        hide(page, False)
        page.get_by_text("control has ended: the page was hidden or silent").wait_for()
        page.get_by_role("button", name="Take control").click()
        page.get_by_label(f"New value of {MODE}").fill("9")
        page.keyboard.press("Enter")
        events.get_by_text(f"page: sets {MODE} to 9").nth(2).wait_for()
        page.close()
        fallen = watch.event("fallback")
        assert (fallen["why"], fallen["outputs"]) == ("silent", [MODE])
        watch.wait_for(MODE, 8)
