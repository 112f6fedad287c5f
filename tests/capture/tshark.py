"""Runs tshark with a dissector, and gives back what it found frame by frame."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest


def tshark() -> str:
    """Return the program; absent it skips, but fails where FSN_REQUIRE names ``tshark``."""
    found = shutil.which("tshark")
    if found is None:
        if "tshark" in os.environ.get("FSN_REQUIRE", "").split(","):
            pytest.fail("FSN_REQUIRE names tshark, but it is not installed")
        pytest.skip("tshark is not installed: apt install tshark")
    return found


def run(script: Path, capture: Path, *arguments: str) -> str:
    """Return the standard output; a Lua error is a failure."""
    done = subprocess.run(
        [tshark(), "-X", f"lua_script:{script}", "-r", str(capture), *arguments],
        capture_output=True,
        check=False,
    )
    said = done.stderr.decode("utf-8", "replace").splitlines()
    said = [line for line in said if not line.startswith("Running as user")]
    assert (done.returncode, said) == (0, [])
    out = done.stdout.decode("utf-8")
    assert "Lua Error" not in out
    return out


class Item(NamedTuple):
    """One FSoE frame as tshark shows it; ``fields`` in order, with what it shows."""

    packet: int
    at: int
    size: int
    fields: tuple[tuple[str, str], ...]

    def all(self, name: str) -> list[str]:
        """Return what the fields of this name, or below it where it ends with a dot, show."""
        if name.endswith("."):
            return [show for field, show in self.fields if field.startswith(name)]
        return [show for field, show in self.fields if field == name]

    def one(self, name: str) -> str | None:
        """Return what the field of this name shows, if there is one."""
        found = self.all(name)
        assert len(found) < 2
        return found[0] if found else None


def items(script: Path, capture: Path) -> list[Item]:
    """Return every FSoE frame that tshark finds in a capture."""
    text = run(script, capture, "-Y", "fsoe", "-T", "pdml", "-j", "fsoe geninfo")
    found = []
    for packet in ElementTree.fromstring(text).iter("packet"):
        number = next(
            int(f.get("show", "")) for f in packet.iter("field") if f.get("name") == "num"
        )
        for proto in packet.iter("proto"):
            if proto.get("name") != "fsoe":
                continue
            fields = tuple((f.get("name", ""), f.get("show", "")) for f in proto.iter("field"))
            size = int(proto.get("size", ""))
            found.append(Item(number, int(proto.get("pos", "")), size, fields))
    return found
