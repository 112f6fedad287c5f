"""The models of a take-over: no two MainDevices send at once, and the bus comes back."""

import os
import shutil
import subprocess

import pytest
from master.rig import ROOT


@pytest.mark.weekly
def test_the_rule_holds_in_every_state():
    if shutil.which("spin") is None or shutil.which("cc") is None:
        required = "spin" in os.environ.get("FSN_REQUIRE", "").split(",")
        (pytest.fail if required else pytest.skip)("SPIN is not installed: apt install spin")
    done = subprocess.run(
        [ROOT / "scripts/rig/standby-model"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    page = (ROOT / "docs/explanation/standby.md").read_text("utf-8")
    for line in done.stdout.splitlines():
        model, _, found = line.partition(":")
        if found.startswith(" no violation"):
            states = int(found.split()[3])
            assert f"{states:,}".replace(",", " ") in " ".join(page.split()), model
        else:
            assert found == " violation found, as it must be"
            assert f"`{model.partition(', ')[2]}`" in page
    assert len(done.stdout.splitlines()) == 9
