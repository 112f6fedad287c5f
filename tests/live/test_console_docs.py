"""The page of the console knows every command, and its examples are what the console takes."""

import re

from live.support import ROOT

from fsoe_net.live.console.console import COMMANDS, Console
from fsoe_net.live.console.leased_client import LeasedClient
from fsoe_net.live.console.script import parse
from fsoe_net.testing.fake_master import FakeMaster

PAGE = (ROOT / "docs" / "howto" / "console.md").read_text("utf-8")


def test_every_command_is_on_the_page():
    table = PAGE.partition("## Commands\n")[2].partition("A **name**")[0]
    named = {text.split()[0] for text in re.findall(r"`([a-z][^`]*)`", table)}
    assert sorted(set(COMMANDS) - named) == []


def test_the_examples_of_the_page_are_taken():
    blocks = re.findall(r"^```\n(.*?)^```", PAGE, re.M | re.S)
    (script,) = (b for b in blocks if b.startswith("# look"))
    with FakeMaster() as master:
        console = Console(LeasedClient(master.path), lambda _: None, lambda _: None)
        console.run_script(script.replace("100ms", "1ms"), "page")
        console.link.close()
    assert master.asked[-1].startswith("get drive_1.0x6040")
    typed = re.findall(r"^fsn> (.*)$", PAGE, re.M)
    assert {c.name for line in typed for c in parse(line)} <= set(COMMANDS)
