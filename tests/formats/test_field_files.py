"""Small files made after public reports: what is said of each by `check`, `convert` and `init`.

They are in ``field`` of the test data, whose README says what a good tool reports.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.tool import fsn
from data_files import need

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.esi.read import load_esi
from fsoe_net.formats.shared.files import Collector
from fsoe_net.project.check import check_files
from fsoe_net.project.convert import convert_files
from fsoe_net.rules.runtime import Runtime

PATHS = ("FSN125", "FSN126")  # of a robot without FSoE, and a relative path: notes of all of them


def found(*parts: str, runtime: Runtime = Runtime.FSN) -> list[tuple[str, Severity, str]]:
    checked = check_files([str(need("field", *parts))], runtime=runtime)
    return [(d.code, d.level, d.message) for d in checked.diagnostics if d.code not in PATHS]


def converted(*parts: str, to: str = "network") -> tuple[dict[str, str], list[str]]:
    made = convert_files([str(need("field", *parts))], to, name="network.yaml")
    return {name: data.decode() for name, data in made.files.items()}, list(made.notes)


def test_an_empty_interface_is_not_an_error():
    rows = found("null_interface.yaml")
    # Its factors 8348535 and 1.2e-07 differ by 0.18 %.
    levels = [(code, level) for code, level, _ in rows]
    assert levels == [("FSN109", Severity.INFO), ("FSN487", Severity.INFO)]
    assert "'mode_of_operation'" in rows[0][2]
    files, _ = converted("null_interface.yaml")
    text = "".join(files.values())
    assert text.count("command_interface: ~, default:") == 2  # 0x6040 and 0x5ff1, which stay bound
    assert text.count("interface: ") == 2 + 3  # and three with a name


def test_a_default_without_an_interface_is_named_with_the_versions():
    ((code, _, message),) = found("def.yaml")
    assert code == "FSN450"
    assert "ethercat_driver_ros2 of 2025" in message
    assert "versions of 2024 and the newest" in message


def test_a_project_whose_boxes_are_files_has_one_master():
    files, notes = converted("xti_mini", "p.tsproj")
    assert '{name: "Term 1 (EK1100)", alias: 0, position: 0' in files["network.yaml"]
    assert not [n for n in notes if "master" in n]


def test_a_module_outside_of_a_component_is_an_error():
    ((code, level, message),) = found("out.urdf")
    assert (code, level) == ("FSN168", Severity.ERROR)
    assert "'EL2809'" in message


def test_each_of_two_masters_can_be_read(tmp_path: Path):
    path = str(need("field", "lc2.xml"))
    done = fsn("init", path, "--no-input", "-o", str(tmp_path / "first"))
    assert "this file has 2 masters (0, 1); only the first is read" in done.stderr
    assert "hint: --master 1 reads another one" in done.stderr
    done = fsn("init", path, "--no-input", "--master", "1", "-o", str(tmp_path / "second"))
    assert "FSN147" not in done.stderr
    rows = [(tmp_path / n / "network.yaml").read_text("utf-8") for n in ("first", "second")]
    assert ["name: a," in rows[0], "name: c," in rows[0]] == [True, False]
    assert ["name: a," in rows[1], "name: c," in rows[1]] == [False, True]
    done = fsn("init", path, "--no-input", "--master", "7", "-o", str(tmp_path / "third"))
    assert done.returncode == 1
    assert "this file has no master '7'\n" in done.stderr
    assert "\n  hint: choose one with --master: 0, 1\n" in done.stderr


def test_unread_parts_of_a_modular_device_are_named(tmp_path: Path):
    done = fsn("init", str(need("field", "lm.xml")), "-o", str(tmp_path / "made"))
    assert done.returncode == 0
    assert "2 subModules not read: din0, dout0" in done.stderr


def test_an_esi_with_two_sync_managers_and_oversampling():
    description = load_esi(need("field", "os.xml"), Collector())
    assert description is not None
    (sub,) = description.subdevices
    assert [
        (sm.index, [p.index for p in sub.device.pdos_of(sm)]) for sm in sub.device.sync_managers
    ] == [(0, [0x1A00]), (1, [0x1A80])]
    _, notes = converted("os.xml")
    assert len([n for n in notes if "is oversampled: the device sends 20 samples" in n]) == 2
    assert any("the PDOs of Sm1 are left out" in n for n in notes)


def test_one_subdevice_in_two_joints():
    ((code, level, message),) = found("t2", "g.urdf")
    assert (code, level) == ("FSN134", Severity.INFO)
    assert "drv serves axis_a, axis_b: one SubDevice for the newest driver; older ones" in message
    assert found("t2", "g.urdf", runtime=Runtime.ROS2_NEWEST) == [(code, level, message)]
    older = [(c, s) for c, s, _ in found("t2", "g.urdf", runtime=Runtime.ROS2_2025)]
    assert older == [
        ("FSN134", Severity.ERROR),
        ("FSN134", Severity.INFO),
        ("FSN463", Severity.WARNING),
    ]
    files, _ = converted("t2", "g.urdf")
    assert files["network.yaml"].count("{name: drv") == 1
    assert files["devices/drv.yaml"].count("for: axis_a") == 8
    assert files["devices/drv.yaml"].count("for: axis_b") == 8


def test_a_drive_plugin_without_the_mode_it_waits_for():
    rows = found("t2", "a.urdf")
    ((code, message),) = ((code, text) for code, level, text in rows if level is Severity.ERROR)
    assert code == "FSN475"
    assert {code for code, *_ in rows} == {"FSN475", "FSN485"}  # it maps no 0x6060 either
    assert "the target stays 0, and the axis runs to 0" in message


@pytest.mark.parametrize(
    ("name", "interfaces"),
    [
        ("e", [("command_interface 'control_word'", 11, "e.yaml", 10, "controlword")]),
        (
            "f",
            [
                ("command_interface 'velocity'", 11, "b.yaml", 8, "position"),
                ("state_interface 'effort'", 12, "b.yaml", 14, "position"),
            ],
        ),
    ],
)
def test_an_interface_that_no_channel_provides_is_named_at_both_ends(
    name: str, interfaces: list[tuple[str, int, str, int, str]]
):
    checked = check_files([str(need("field", "t2", f"{name}.urdf"))])
    # Of e.yaml: factors that differ by 0.13 %, and a 0x60C2 of 10 ms in a bus cycle of 1 ms.
    known = {"FSN476"} | ({"FSN487", "FSN488"} if name == "e" else set())
    assert {d.code for d in checked.diagnostics if d.code not in PATHS} == known
    rows = [d for d in checked.diagnostics if d.code == "FSN476"]
    for found_one, (words, line, file, other, provided) in zip(rows, interfaces, strict=True):
        assert words in found_one.message
        assert found_one.span.line == line
        (related,) = found_one.related
        assert (Path(related.span.file).name, related.span.line) == (file, other)
        assert related.message == f"provides {provided}"


def test_a_master_with_a_name_and_a_plugin_for_it():
    assert found("t2", "o.urdf") == []


@pytest.mark.parametrize(
    "parts",
    [
        ("null_interface.yaml",),
        ("def.yaml",),
        ("xti_mini", "p.tsproj"),
        ("out.urdf",),
        ("lc2.xml",),
        ("lm.xml",),
        ("os.xml",),
        *(("t2", f"{name}.urdf") for name in "aefgo"),
    ],
    ids="/".join,
)
@pytest.mark.parametrize(
    "command", [("check",), ("convert", "-o", "n.yaml"), ("init", "--no-input", "-o", "made")]
)
def test_no_command_fails_on_a_file(
    command: tuple[str, ...], parts: tuple[str, ...], tmp_path: Path
):
    done = fsn(*command, str(need("field", *parts)), cwd=tmp_path)
    assert done.returncode in (0, 1)
