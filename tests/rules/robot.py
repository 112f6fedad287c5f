"""The robot cell as other files tell it, and what the comparison finds in them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from networks import EXAMPLES, example, resolved

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import DescribedSubDevice, Description
from fsoe_net.model.resolve import Resolution
from fsoe_net.rules.references import check_references

ROBOT = example("el6910")  # 1 el6910, 2 el1904, 3 el2904, 4 drive_1, 5 drive_2; 0 is a coupler
LIBRARY = builtin_library()
MADE = describe(ROBOT.network)


def bus(resolution: Resolution = ROBOT, **more) -> Description:
    """What an ENI of exactly this network says."""
    made = MADE if resolution is ROBOT else describe(resolution.network)
    rows = tuple(_resolved(s) for s in made.subdevices)
    return replace(made, format="eni", path="other", subdevices=rows, **more)


def _resolved(sub: DescribedSubDevice) -> DescribedSubDevice:
    """Give each sync manager its PDOs, as files of other tools do."""
    device = sub.device
    managers = tuple(replace(sm, pdos=device.pdos_of(sm)) for sm in device.sync_managers)
    return replace(sub, device=replace(device, sync_managers=managers, rpdos=(), tpdos=()))


def found(reference: Description, resolution: Resolution = ROBOT) -> list[Diagnostic]:
    return check_references(resolution, [reference], library=LIBRARY)


def codes(reference: Description, resolution: Resolution = ROBOT) -> list[str]:
    return [d.code for d in found(reference, resolution)]


def with_text(folder: Path, *changes: tuple[str, str]) -> Resolution:
    """The robot cell in a folder, with changes of its text; each must hit something."""
    shutil.copytree(EXAMPLES / "el6910", folder, dirs_exist_ok=True)
    file = folder / "network.yaml"
    text = file.read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file.write_text(text, "utf-8")
    return resolved(file)


def crossed(folder: Path) -> Resolution:
    """EL1904 and EL2904 each hear the one frame pair and answer the other (FSN225)."""
    return with_text(
        folder,
        ("el6910, index: 0x7000", "el6910, index: 0x70ff"),
        ("el6910, index: 0x7010", "el6910, index: 0x7000"),
        ("el6910, index: 0x70ff", "el6910, index: 0x7010"),
    )
