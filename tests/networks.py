"""Networks for tests: the examples, and generated ones of any size."""

from __future__ import annotations

import atexit
import re
import shutil
import tempfile
from pathlib import Path

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import Resolution, resolve

EXAMPLES = Path(__file__).parents[1] / "examples"


def _without_functions() -> Path:
    """Copy the examples without what only timing and reports read.

    So tests that add safety functions of their own, or compare whole plans, begin with none.
    """
    folder = Path(tempfile.mkdtemp(prefix="fsn-examples-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    for path in folder.glob("*/network.yaml"):
        text = re.sub(r"^project:.*\n", "", path.read_text("utf-8"), flags=re.M)
        path.write_text(text.partition("\n# Figures of an example")[0], "utf-8")
    return folder


PLAIN = _without_functions()


def resolved(*files: Path | str) -> Resolution:
    """Load and resolve files that must be readable."""
    result = load_network([str(f) for f in files])
    assert result.network is not None, result.diagnostics
    return resolve(result.network)


def example(name: str) -> Resolution:
    """Return an example network, without its safety functions."""
    return resolved(PLAIN / name / "network.yaml")


def write_big_network(folder: Path, subdevices: int, transfers: int) -> Path:
    """Write a network of many SubDevices; each group of 53 has one logic and 52 terminals."""
    slots = 52
    logic = ["vendor_id: 2", "product_id: 0x1afe3052"]
    for group, base in (("rpdo", 0x1600), ("tpdo", 0x1A00)):
        first = 0x7000 if group == "rpdo" else 0x6000
        logic.append(f"{group}:")
        for n in range(slots):
            obj = first + 16 * n
            logic += [f"  - index: 0x{base + n:04x}", "    channels:"]
            for index, sub, kind in (
                (obj, 1, "uint8"),
                (obj + 1, 1, "uint8"),
                (obj, 3, "uint16"),
                (obj, 2, "uint16"),
            ):
                logic.append(f"      - {{index: 0x{index:04x}, sub_index: {sub}, type: {kind}}}")
    (folder / "logic.yaml").write_text("\n".join(logic) + "\n", "utf-8")
    terminal = (EXAMPLES / "el6910" / "devices" / "el1904.yaml").read_text("utf-8")
    (folder / "terminal.yaml").write_text(terminal, "utf-8")
    lines = ["version: 1", "cycle_us: 1000", "subdevices:"]
    names = []
    for n in range(subdevices):
        is_logic = n % (slots + 1) == 0
        config = "logic.yaml" if is_logic else "terminal.yaml"
        names.append(f"s{n}")
        lines.append(f"  - {{name: s{n}, position: {n}, config: {config}}}")
    lines.append("nets:")
    left = transfers // 2
    for group in range(0, subdevices, slots + 1):
        members = names[group + 1 : group + slots + 1][:left]
        if not members:
            break
        left -= len(members)
        lines += [f"  - name: net{group}", f"    safety_master: s{group}", "    transfers:"]
        for slot, name in enumerate(members):
            taken, given = 0x7000 + 16 * slot, 0x6000 + 16 * slot
            lines += [
                "      - size: 6",
                f"        in: {{ec_module: {name}, index: 0x6000, subindex: 1}}",
                f"        out: {{ec_module: s{group}, index: 0x{taken:04x}, subindex: 1}}",
                "      - size: 6",
                f"        in: {{ec_module: s{group}, index: 0x{given:04x}, subindex: 1}}",
                f"        out: {{ec_module: {name}, index: 0x7000, subindex: 1}}",
            ]
    path = folder / "network.yaml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path
