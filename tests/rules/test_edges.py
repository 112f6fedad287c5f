"""What lies beside the seeded mistake of each code: other values, other ends, several at once.

Each changes the clean files of tests/diagnostics; all that is found is listed by code, and its
whole texts are those recorded.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from diagnostics import test_cases as cases
from rules.robot import ROBOT, bus, codes, found, with_text
from rules.test_references import changed, out_pdo, pdos, types
from rules.test_references_twinsafe import ours, project
from rules.test_scan import _found
from scans import scan_of

from fsoe_net.diag import Severity
from fsoe_net.model import DescribedSubDevice

pytestmark = pytest.mark.usefixtures("said")

IO, DEVICE = "network.yaml", "devices/ek1914.yaml"
FRAME = "io, index: 0x6000, subindex: 1"
ONLY = """\
vendor_id: 2
product_id: 3
rpdo: [{index: 0x1600, channels: [{index: 0x7000, sub_index: 1, type: uint8}]}]
"""
STANDARD = "kind: standard\n        in: {ec_module: io, index: 0x6010, subindex: 1}\n"
LCEC = [
    [DEVICE, "0x077a2c52", "0x16ad6012"],
    ["devices/el6910.yaml", "0x1afe3052", "0x1af43052"],
]
EDGES: dict[str, tuple[dict, list[str]]] = {
    "a sync manager given twice": (
        {"edit": [[DEVICE, "{index: 1, type: input", "{index: 0, type: input"]]},
        ["FSN412"],
    ),
    "the last sync manager there can be": (
        {"edit": [[DEVICE, "{index: 1, type: input", "{index: 15, type: input"]]},
        [],
    ),
    "the first there cannot be": (
        {"edit": [[DEVICE, "{index: 1, type: input", "{index: 16, type: input"]]},
        ["FSN412"],
    ),
    "rpdo on an input": (
        {"edit": [[DEVICE, "2, type: output, pdo: rpdo", "2, type: input, pdo: rpdo"]]},
        ["FSN410"],
    ),
    "another index": ({"edit": [[IO, FRAME, "io, index: 0x6009, subindex: 1"]]}, ["FSN202"]),
    "another subindex": ({"edit": [[IO, FRAME, "io, index: 0x6000, subindex: 9"]]}, ["FSN202"]),
    "another object": ({"edit": [[IO, FRAME, "io, index: 0x6009, subindex: 9"]]}, ["FSN202"]),
    "a device without inputs": (
        {
            "write": [["devices/only.yaml", ONLY]],
            "edit": [
                [IO, "nets:", "  - {name: only, position: 3, config: devices/only.yaml}\nnets:"],
                [IO, STANDARD, STANDARD.replace("io, index: 0x6010", "only, index: 0x6000")],
            ],
        },
        ["FSN202"],
    ),
    "an address of the safety project": (
        {"also": ["safety.xml"], "edit": [["safety.xml", "<SAddress>2<", "<SAddress>3<"]]},
        ["FSN446"],
    ),
    "a connection ID of the safety project": (
        {"also": ["safety.xml"], "edit": [["safety.xml", "<ConId>10<", "<ConId>12<"]]},
        ["FSN446"],
    ),
    "parameters of the safety project": (
        {"also": ["safety.xml"], "edit": [["safety.xml", "<Data>0100<", "<Data>0200<"]]},
        ["FSN446"],
    ),
    "a frame of another length than linuxcnc-ethercat has": (
        {"runtime": "lcec", "edit": LCEC},
        ["FSN464"],
    ),
}


@pytest.mark.parametrize("name", EDGES)
def test_beside_the_seeded_mistake(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    case, wanted = EDGES[name]
    folder = tmp_path / "case"
    shutil.copytree(cases.HERE / "base", folder)
    cases._seed(folder, case)
    monkeypatch.chdir(folder)
    case = {"check": ["network.yaml", *case.get("also", ())]} | case
    rows = [d for d in cases.findings(case) if d.level is not Severity.INFO]
    assert sorted({d.code for d in rows}) == wanted, [d.message for d in rows]


# -- other files ----------------------------------------------------------------------------------


def test_two_pdos_on_another_sync_manager_are_one_finding():
    def moved(sub: DescribedSubDevice) -> DescribedSubDevice:
        managers = list(sub.device.sync_managers)
        at = {m.index: n for n, m in enumerate(managers)}
        out, back = managers[at[2]], managers[at[3]]
        assert out.pdos is not None
        assert back.pdos is not None
        managers[at[2]] = replace(out, pdos=out.pdos[:-2])
        managers[at[3]] = replace(back, pdos=(*back.pdos, *out.pdos[-2:]))
        return replace(sub, device=replace(sub.device, sync_managers=tuple(managers)))

    assert "FSN439" in {d.code for d in found(changed(0, moved))}


def test_a_pdo_without_entries_says_nothing_of_ours():
    assert codes(types(pdos(2, replace(out_pdo(), entries=())))) == []


def test_a_safety_project_beside_a_network_without_connections():
    assert codes(project(*ours()), replace(ROBOT, connections=())) == ["FSN443"]
    assert codes(bus(), replace(ROBOT, connections=())) == []


# -- the bus --------------------------------------------------------------------------------------


def told_by_main(told: dict, **values: dict[int, int]) -> dict:
    rows = told["subdevices"][1]["fsoe"]["connections"]
    for key, by_row in values.items():
        for n, value in by_row.items():
            rows[n][key] = value
    return told


def test_watchdogs_that_are_exchanged_are_two_findings(tmp_path: Path):
    robot = with_text(
        tmp_path, ("connection_id: 2, watchdog_ms: 100", "connection_id: 2, watchdog_ms: 50")
    )
    told = told_by_main(scan_of(robot), watchdog_ms={0: 50, 1: 100})
    assert [d.code for d in _found(robot, told)] == ["FSN510", "FSN510"]


def test_another_value_behind_two_that_are_exchanged():
    told = told_by_main(scan_of(ROBOT), connection_id={0: 2, 1: 1, 2: 9, 3: 12})
    assert [d.code for d in _found(ROBOT, told)] == ["FSN509"] * 3
