"""What lies beside the seeded mistake of each code: other values, other ends, several at once.

Each changes the clean files of tests/diagnostics; the codes of its findings are listed.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from compare.robot import (
    ROBOT,
    bus,
    changed,
    codes,
    found,
    ours,
    out_pdo,
    pdos,
    project,
    types,
    with_text,
)
from compare.scan_changes import scan_findings
from diagnostics import test_cases as cases
from networks import resolved
from scans import scan_of

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.model.description import DescribedSubDevice
from fsoe_net.rules.check import check
from fsoe_net.rules.context import few
from fsoe_net.rules.runtime import Runtime

IO, DEVICE, LOGIC = "network.yaml", "devices/ek1914.yaml", "devices/el6910.yaml"
FRAME = "io, index: 0x6000, subindex: 1"
ONLY = """\
vendor_id: 2
product_id: 3
rpdo: [{index: 0x1600, channels: [{index: 0x7000, sub_index: 1, type: uint8}]}]
"""
STANDARD = "kind: standard\n        in: {ec_module: io, index: 0x6010, subindex: 1}\n"
PAD = "{{index: 0x2001, sub_index: 1, type: bit{}}}"
LCEC = [
    [DEVICE, "0x077a2c52", "0x16ad6012"],
    ["devices/el6910.yaml", "0x1afe3052", "0x1af43052"],
]
# The transfers of the second connection go, and it says its slot instead.
ALONE = cases.CASES["FSN236"]["edit"][:2]
MANY = "".join(
    f"  - {{name: s{n:02}, position: {n}, config: devices/ek1914.yaml}}\n" for n in range(3, 21)
)
TWICE = """\
state_interface: logic_state}
  - index: 0x1bfe
    channels:
      - {index: 0x6010, sub_index: 1, type: uint8}
      - {index: 0x6011, sub_index: 1, type: uint8}
"""
THIRD = """\
      - size: 6
        in: {ec_module: io, index: 0x6000, subindex: 1}
        out: {ec_module: logic, index: 0x7000, subindex: 1}
"""
EDGES: dict[str, tuple[dict, list[str]]] = {
    "a transfer past the safety master": (
        {"edit": [[IO, "logic, index: 0x6010, subindex: 1", "io, index: 0x6000, subindex: 1"]]},
        ["FSN215", "FSN219"],
    ),
    "three transfers to one place": (
        {"edit": [[IO, "    connections:", 2 * THIRD + "    connections:"]]},
        ["FSN204"],
    ),
    "a connection of a device that is not there, beside a wrong size": (
        {
            "edit": [
                [IO, "size: 6\n", "size: 7\n"],
                [IO, "main: logic, sub: io2", "main: safety_plc_b, sub: io2"],
            ]
        },
        ["FSN201", "FSN209"],
    ),
    "a connection of a device that is not there, beside a name given twice": (
        {
            "edit": [
                [IO, "{name: io2,", "{name: io,"],
                [IO, "main: logic, sub: io2", "main: safety_plc_b, sub: io2"],
            ]
        },
        ["FSN134"],
    ),
    "a PDO of two entries that others have": (
        {"edit": [[LOGIC, "state_interface: logic_state}\n", TWICE]]},
        ["FSN408"],
    ),
    "a copy to the place right before its own": (
        {"edit": [[IO, FRAME, "logic, index: 0x7010, subindex: 1"]]},
        ["FSN215", "FSN217"],
    ),
    "values of two devices for which nobody answers": (
        {
            "check": ["timed.yaml"],
            "edit": [
                [
                    "timed.yaml",
                    "1.11e-9, claim: {pl: d}, source: manual 3.0",
                    "1.11e-9, claim: {pl: d}",
                ],
                [
                    "timed.yaml",
                    "1.25e-9, claim: {pl: d}, source: manual 3.0",
                    "1.25e-9, claim: {pl: d}",
                ],
            ],
        },
        ["FSN607"],
    ),
    "an unknown name beside many": (
        {
            "edit": [
                [IO, "nets:", MANY + "nets:"],
                [IO, FRAME, "zzzz_qqqq, index: 0x6000, subindex: 1"],
            ]
        },
        ["FSN201"],
    ),
    "an RxPDO of the last number": (
        {"edit": [[DEVICE, "index: 0x1a00", "index: 0x17ff"]]},
        ["FSN401"],
    ),
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
    "connections alone, where the driver knows none": (
        {"runtime": Runtime.ROS2_NEWEST, "edit": ALONE},
        ["FSN223"],
    ),
    "a slot without a frame from the MainDevice": (
        {
            "edit": [
                *ALONE,
                [LOGIC, "0x7010, sub_index: 3, type: uint16", "0x7010, sub_index: 3, type: uint32"],
            ]
        },
        ["FSN236"],
    ),
    "a slot without a frame to the MainDevice": (
        {
            "edit": [
                *ALONE,
                [LOGIC, "0x6010, sub_index: 3, type: uint16", "0x6010, sub_index: 3, type: uint32"],
            ]
        },
        ["FSN236"],
    ),
    "a connection over two masters": (
        {
            "check": ["robot.urdf"],
            "edit": [
                cases.CASES["FSN129"]["edit"][0],
                [
                    "transfers.yaml",
                    "    transfers:",
                    "    connections:\n      - {main: logic, sub: axis}\n    transfers:",
                ],
            ],
        },
        ["FSN129"],
    ),
    "an object that pads": (
        {
            "edit": [
                [
                    DEVICE,
                    "{index: 0x0000, sub_index: 0, type: bit14}",
                    PAD.format(7) + "\n      - " + PAD.format(4) + "\n      - " + PAD.format(3),
                ]
            ]
        },
        [],
    ),
    "as many parameters as were seen to work": (
        {"edit": [[IO, '"01 00"', '"' + "01 " * 255 + '00"']]},
        [],
    ),
    "one parameter more": (
        {"edit": [[IO, '"01 00"', '"' + "01 " * 256 + '00"']]},
        ["FSN306"],
    ),
    "a connection of two others": (
        {"edit": [[IO, "main: logic, sub: io2", "main: io, sub: io2"]]},
        ["FSN239"],
    ),
    "a connection of the MainDevice": (
        {"edit": [[IO, "main: logic, sub: io2", "main: MainDevice, sub: io2"]]},
        ["FSN226"],
    ),
    "main and sub exchanged": (
        {"edit": [[IO, "main: logic, sub: io2", "main: io2, sub: logic"]]},
        ["FSN227"],
    ),
    "a copy of the MainDevice": (
        {"edit": [[IO, FRAME, "MainDevice, index: 0x6000, subindex: 1"]]},
        ["FSN226"],
    ),
    "a PDO without channels in front": (
        {"edit": [[DEVICE, "tpdo:\n", "tpdo:\n  - {index: 0x1a05, channels: []}\n"]]},
        ["FSN406"],
    ),
    "no command byte": ({"edit": [[IO, FRAME, "io, index: 0x6010, subindex: 1"]]}, ["FSN211"]),
    "a standard copy past its sync manager": (
        {"edit": [[IO, "size: 1\n", "size: 2\n"]]},
        ["FSN209"],
    ),
    "a frame one byte too long": ({"edit": [[IO, "size: 6\n", "size: 7\n"]]}, ["FSN209"]),
    "a frame one byte too short": ({"edit": [[IO, "size: 6\n", "size: 5\n"]]}, ["FSN208"]),
    "a watchdog of exactly so many cycles": (
        {"edit": [[IO, "cycle_us: 1000", "cycle_us: 20000"]]},
        [],
    ),
    "a watchdog just shorter than that": (
        {"edit": [[IO, "cycle_us: 1000", "cycle_us: 20001"]]},
        ["FSN601"],
    ),
    "no watchdogs, a slow bus": (
        {
            "edit": [
                [IO, "cycle_us: 1000", "cycle_us: 26000"],
                [IO, ", watchdog_ms: 100", ""],
                [IO, ", watchdog_ms: 100", ""],
            ]
        },
        ["FSN601"],
    ),
    "an unknown safety master": (
        {"edit": [[IO, "safety_master: logic", "safety_master: plc"]]},
        ["FSN218"],
    ),
    "the MainDevice as safety master": (
        {"edit": [[IO, "safety_master: logic", "safety_master: MainDevice"]]},
        ["FSN226"],
    ),
    "no safety master, none shared": (
        {
            "edit": [
                [IO, "    safety_master: logic\n", ""],
                [
                    IO,
                    "out: {ec_module: logic, index: 0x7010, subindex: 1}",
                    "out: {ec_module: io, index: 0x7000, subindex: 1}",
                ],
            ]
        },
        ["FSN204", "FSN215", "FSN218"],
    ),
    "a file without its transfers beside a project": (
        {"check": ["robot.urdf", "safety.xml"]},
        ["FSN447"],
    ),
}


@pytest.mark.parametrize("name", EDGES)
def test_next_to_the_seeded_mistake(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    case, wanted = EDGES[name]
    folder = tmp_path / "case"
    shutil.copytree(cases.HERE / "base", folder)
    cases._seed(folder, case)
    monkeypatch.chdir(folder)
    case = {"check": ["network.yaml", *case.get("also", ())]} | case
    rows = [d for d in cases.findings(case) if d.level is not Severity.INFO]
    assert sorted({d.code for d in rows}) == wanted, [d.message for d in rows]


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        # The frame of a drive is as long as that of another free slot.
        ([("el6910, index: 0x7020", "el6910, index: 0x7000")], "FSN210"),
        # Two slots are free.
        (
            [
                ("el6910, index: 0x7020", "el6910, index: 0x7000"),
                ("el6910, index: 0x7030", "el6910, index: 0x7010"),
            ],
            "FSN210",
        ),
    ],
)
def test_the_slot_that_fits_is_named(changes: list[tuple[str, str]], code: str, tmp_path: Path):
    robot = with_text(tmp_path, *changes)
    assert code in {d.code for d in check(robot)}


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


def test_a_pdo_without_entries_is_silent_of_ours():
    assert codes(types(pdos(2, replace(out_pdo(), entries=())))) == []


@pytest.mark.parametrize("place", [65_535, 65_536])
@pytest.mark.uncounted
def test_places_that_no_bus_has_are_not_looked_at(place: int):
    rows = bus().subdevices
    far = replace(rows[0], name="far", position=place)
    made = replace(bus(), format="lcec", subdevices=(*rows, far))
    text = [d.message for d in found(made) if "far" in d.message or str(place) in d.message]
    assert bool(text) == (place < 65_536), text


WHOLE = ["eni", "ethercat-slaves", "ethercat-slaves-v", "lcec", "soem-slaveinfo"]


@pytest.mark.parametrize("format", [*WHOLE, "other"])
def test_only_a_file_of_the_whole_bus_misses_a_subdevice(format: str):  # noqa: A002
    made = replace(bus(), format=format, subdevices=bus().subdevices[:-1])
    told = [d.message for d in found(made) if d.code == "FSN442"]
    assert bool(told) == (format != "other"), told


def test_a_safety_project_next_to_a_network_without_connections():
    assert codes(project(*ours()), replace(ROBOT, connections=())) == ["FSN443"]
    assert codes(bus(), replace(ROBOT, connections=())) == []


def test_a_transfer_that_cannot_be_hides_no_copy(tmp_path: Path):
    broken = with_text(tmp_path, ("el1904, index: 0x6000", "el1904, index: 0x6fff"))
    assert not broken.transfers[0].usable
    made = bus()
    less = replace(made, copies=made.copies[:-1])
    # Its own copy is one of no transfer; another that is missing is named as well.
    assert codes(made, broken) == ["FSN444"]
    assert codes(less, broken) == ["FSN444", "FSN444"]


def test_a_part_of_a_network_is_paired_by_type():
    part = replace(ROBOT, network=replace(ROBOT.network, partial=True))
    rows = tuple(replace(s, position=9 - n) for n, s in enumerate(changed(1, pdos(2)).subdevices))
    other = replace(bus(), format="lcec", subdevices=rows, copies=(), connections=())
    assert codes(other, part) == ["FSN433"]


def test_the_safety_project_within_a_file_is_compared():
    made = replace(bus(), format="twincat")
    assert codes(made) == []
    rows = tuple(replace(c, connection_id=77) for c in made.connections)
    assert set(codes(replace(made, connections=rows))) == {"FSN446"}


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
    assert [d.code for d in scan_findings(robot, told)] == ["FSN510", "FSN510"]


def test_a_pdo_that_was_not_read_hides_no_other():
    told = scan_of(ROBOT)
    first, second = told["subdevices"][4]["sms"][0]["pdos"][:2]
    del first["entries"]
    second["entries"][0]["bits"] += 8
    assert "FSN506" in {d.code for d in scan_findings(ROBOT, told)}


def test_another_value_after_two_that_are_exchanged():
    told = told_by_main(scan_of(ROBOT), connection_id={0: 2, 1: 1, 2: 9, 3: 12})
    assert [d.code for d in scan_findings(ROBOT, told)] == ["FSN509"] * 3


def test_another_address_after_two_that_are_exchanged():
    told = scan_of(ROBOT)
    rows = told["subdevices"]
    rows[2]["fsoe"]["address"], rows[3]["fsoe"]["address"] = 102, 101
    rows[4]["fsoe"]["address"] = 7
    assert [d.code for d in scan_findings(ROBOT, told)] == ["FSN508", "FSN508"]


def test_connections_are_paired_by_what_they_state():
    told = scan_of(ROBOT)
    told["subdevices"][1]["fsoe"]["connections"].reverse()
    turned = [(d.code, d.message) for d in scan_findings(ROBOT, told)]
    assert not [text for code, text in turned if code in ("FSN509", "FSN510")], turned


def test_of_two_that_are_exchanged_the_process_data_is_compared():
    told = scan_of(ROBOT)
    rows = told["subdevices"]
    rows[2], rows[3] = rows[3] | {"position": 2}, rows[2] | {"position": 3}
    assert "FSN506" not in {d.code for d in scan_findings(ROBOT, told)}
    for n in (2, 3):
        rows[n]["sms"][0]["pdos"][0]["entries"][0]["bits"] += 8
    assert [d.code for d in scan_findings(ROBOT, told)].count("FSN506") == 2


@pytest.mark.parametrize(
    ("number", "text"), [(0, ""), (2, "n0, n1"), (3, "n0, n1 and 1 more"), (5, "n0, n1 and 3 more")]
)
def test_few_of_many(number: int, text: str):
    assert few([f"n{n}" for n in range(number)], 2) == text


BOTH = """\
vendor_id: 2
product_id: 3
rpdo:
  - index: 0x1600
    channels:
      - {index: 0x6040, sub_index: 0, type: uint16}
tpdo:
  - index: 0x1a00
    channels:
      - {index: 0x6041, sub_index: 0, type: uint16}
      - {index: 0x6040, sub_index: 0, type: uint16}
"""


def test_an_entry_of_both_directions_is_the_one_that_its_end_asks_for(tmp_path: Path):
    """A driver finds the output first, in the lower sync manager."""
    (tmp_path / "drive.yaml").write_text(BOTH, "utf-8")
    path = tmp_path / "network.yaml"
    rows = [f"  - {{name: d{n}, position: {n}, config: drive.yaml}}" for n in range(2)]
    copy = (
        "nets:\n  - name: n\n    transfers:\n      - size: 2\n        kind: standard\n"
        "        in: {ec_module: d0, index: 0x6040, subindex: 0}\n"
        "        out: {ec_module: d1, index: 0x6040, subindex: 0}\n"
    )
    path.write_text("\n".join(["version: 1", "subdevices:", *rows, copy]), "utf-8")
    resolution = resolved(path)
    (row,) = resolution.transfers
    assert row.usable
    assert row.source.sm is not None
    assert row.destination.sm is not None
    assert (row.source.sm.sm.index, row.source.byte_offset) == (3, 2)
    assert (row.destination.sm.sm.index, row.destination.byte_offset) == (2, 0)
    (found,) = [d for d in check(resolution) if d.code == "FSN203"]
    assert found.level is Severity.INFO
    assert "SM2" in found.message
