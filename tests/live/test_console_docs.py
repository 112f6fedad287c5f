"""The page of the console knows every command, and its examples are what the console takes."""

import re

from live.support import ROOT

from fsoe_net.live.console.console import COMMANDS, Console
from fsoe_net.live.console.keeper import Keeper
from fsoe_net.live.console.script import parse
from fsoe_net.testing.fake_master import FakeMaster

PAGE = (ROOT / "docs" / "howto" / "console.md").read_text("utf-8")


def test_every_command_is_on_the_page():
    table = PAGE.partition("## Commands\n")[2].partition("A **name**")[0]
    named = {text.split()[0] for text in re.findall(r"`([a-z][^`]*)`", table)}
    assert sorted(set(COMMANDS) - named) == []


def test_the_examples_of_the_page_are_taken():
    blocks = re.findall(r"^```\n(.*?)^```", PAGE, re.M | re.S)
    macros, script = (b for b in blocks if b.startswith(("let", "# selftest")))
    with FakeMaster() as master:
        master.inputs["drive_1.0x6041:00"] = 8
        console = Console(Keeper(master.path), lambda _: None, lambda _: None)
        console.run_script(macros.replace("100ms", "1ms"), "page")
        script = script.replace("0x6061", "0x6041").replace("100ms", "1ms")
        console.run_script(script, "page", ["drive_1"])
        console.keeper.close()
    assert master.asked[-1].startswith("get drive_1.0x6040")
    typed = re.findall(r"^fsn> (.*)$", PAGE, re.M)
    assert {c.words[0].text for line in typed for c in parse(line)} <= {*COMMANDS, "halt"}


def test_the_scripts_of_the_examples_are_taken():
    text = (ROOT / "examples" / "console" / "jog.fsn").read_text("utf-8")
    assert [c.name for c in parse(text)][:3] == ["run", "start", "wait"]
    with FakeMaster() as master:
        console = Console(Keeper(master.path), lambda _: None, lambda _: None)
        console.run_file(str(ROOT / "examples" / "console" / "drives.fsn"), [])
        console.run_script("quick-stop all; reset-drive drive_1", "s")
        known = {*COMMANDS, *console.macros}
        assert {c.name for c in parse(text)} <= known
        console.keeper.close()
    assert master.asked[-1] == "set drive_1.0x6040:00=0"
