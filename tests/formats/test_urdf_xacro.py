"""Xacro: expansion equals that of xacro itself, every element knows where it was written."""

from __future__ import annotations

import dataclasses
import hashlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.ros2 import xacro_expand
from fsoe_net.formats.ros2.urdf import UrdfResult, load_urdf
from fsoe_net.formats.shared.files import Collector

HERE = Path(__file__).parent / "urdf"
CELL = HERE / "cell.urdf.xacro"
TERMINAL = HERE / "include" / "terminal.xacro"
DEVICES = {"devices": "/opt/devices"}
XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write files; the body of the first stands on line 2 of a robot. Return the first."""

    def _write(body: str, **others: str) -> Path:
        for name, text in others.items():
            (tmp_path / f"{name}.xacro").write_text(text, "utf-8")
        path = tmp_path / "main.xacro"
        path.write_text(f'<robot name="r" {XMLNS}>\n{body}\n</robot>\n', "utf-8")
        return path

    return _write


def _places(result: UrdfResult) -> list[str]:
    return [
        f"{d.code} {Path(d.span.file).name}:{d.span.line}:{d.span.column}" for d in _all(result)
    ]


def _all(result: UrdfResult) -> tuple[Diagnostic, ...]:
    assert all(d.hint for d in result.diagnostics)
    return result.diagnostics


def _only(path: Path) -> Diagnostic:
    (found,) = load_urdf(path).diagnostics
    return found


def test_macros_and_includes_keep_their_places():
    result = load_urdf(CELL, LoadOptions(packages=DEVICES))
    assert _places(result) == [
        "FSN131 terminal.xacro:13:9",
        "FSN131 terminal.xacro:13:9",
        "FSN120 cell.urdf.xacro:19:11",
        "FSN110 cell.urdf.xacro:19:11",
    ]
    (system,) = result.systems
    assert (system.span.line, system.span.column) == (7, 3)
    first, second, late = system.modules
    assert str(first.span) == f"{TERMINAL}:10:5"  # the tag in the macro in the included file
    assert str(first.at("plugin")) == f"{TERMINAL}:11:15"
    assert str(second.at("slave_config")) == f"{TERMINAL}:14:34"
    assert str(late.span) == f"{CELL}:19:11"  # handed to a macro as a block
    (component,) = late.components
    assert (component.kind, component.name) == ("sensor", "late")  # from xacro:element


def test_values_are_expanded_and_else_kept_as_written():
    (system,) = load_urdf(
        CELL, LoadOptions(packages=DEVICES, xacro_args={"config": "other"})
    ).systems
    assert system.control_frequency == 1000.0
    assert system.transfer_file == "other/transfers.yaml"
    assert [m.slave_config for m in system.modules] == [
        "/opt/devices/input.yaml",
        "/opt/devices/logic.yaml",
        "",
    ]
    assert [m.name for m in system.modules] == ["input", "logic", "late"]


def test_includes_are_sources_with_their_digests():
    rows = load_urdf(CELL, LoadOptions(packages=DEVICES)).sources
    assert [(r.path, r.sha256) for r in rows] == [
        (str(p), hashlib.sha256(p.read_bytes()).hexdigest()) for p in (CELL, TERMINAL)
    ]


def test_expansion_equals_that_of_xacro_itself(tmp_path: Path):
    """Differential: our marked expansion against the plain tool."""
    share = tmp_path / "share" / "devices"
    share.mkdir(parents=True)
    text = CELL.read_text("utf-8").replace('"include/', f'"{HERE}/include/')
    copy = tmp_path / "cell.xacro"
    copy.write_text(text, "utf-8")
    code = (
        "import sys, xacro; from xacro import substitution_args as s\n"
        f"s._eval_find = lambda name: {str(share)!r}\n"
        "sys.stdout.write(xacro.process_file(sys.argv[1]).toxml())"
    )
    theirs = subprocess.run(
        [sys.executable, "-c", code, str(copy)], capture_output=True, text=True, check=True
    ).stdout
    root = xacro_expand.expand_xacro(
        str(copy), Collector(), LoadOptions(packages={"devices": str(share), "macros": str(HERE)})
    )
    assert root is not None
    ours = [(e.name, e.attributes, e.text) for e in root.walk()]
    assert ours[0] == ("robot", {"name": "cell"}, "")
    expected = [
        (e.tag, dict(e.attrib), "".join([e.text or "", *(c.tail or "" for c in e)]))
        for e in ElementTree.fromstring(theirs).iter()
        if isinstance(e.tag, str)
    ]
    assert ours == expected
    assert len(ours) > 15


def test_packages_are_found_through_the_ament_prefix_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    share = tmp_path / "share" / "devices"
    share.mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    (system,) = load_urdf(CELL).systems
    assert system.modules[0].slave_config == f"{share}/input.yaml"


def test_unknown_package_is_reported_at_its_use(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    found = _only(CELL)
    assert (found.code, str(found.span)) == ("FSN119", f"{TERMINAL}:14:34")
    assert found.message == "xacro: package 'devices' is not known"
    assert found.hint == "pass --package devices=DIR"
    assert [f"{r.span}" for r in found.related] == [f"{TERMINAL}:6:17", f"{CELL}:13:5"]


def test_undefined_argument_is_reported_with_the_option(write: Write):
    found = _only(write('<a>\n  <b c="$(arg side)"/></a>'))
    assert (found.code, found.span.line, found.span.column) == ("FSN119", 3, 3)
    assert found.hint == "pass --arg side:=VALUE"
    path = write('<xacro:arg name="side" default="l"/><a b="$(arg side)"/>')
    assert _places(load_urdf(path, LoadOptions(xacro_args={"side": "r"}))) == [
        "FSN125 main.xacro:1:1"
    ]


MACRO = """\
<xacro:macro name="cell" params="{params}">
  <ros2_control name="${{prefix}}c" type="system">
    <hardware><plugin>ethercat_driver/EthercatDriver</plugin></hardware>
    <joint name="${{prefix}}j1"/>
  </ros2_control>
</xacro:macro>"""


@pytest.mark.parametrize(
    ("params", "name"),
    [
        ("prefix:=a_", "a_c"),
        ("prefix:='' rate:=100", "c"),
        ('prefix:="x " rate', ""),
        ("prefix", ""),
    ],
)
def test_a_macro_that_nothing_calls_is_expanded_with_its_defaults(
    params: str, name: str, write: Write
):
    path = write(MACRO.format(params=params.replace('"', "&quot;")))
    result = load_urdf(path)
    assert [s.name for s in result.systems] == [name] * bool(name)
    found = result.diagnostics[0]
    assert (found.code, found.span.line) == ("FSN125", 2)
    assert found.level is (Severity.INFO if name else Severity.ERROR)
    assert found.hint == "name the xacro that includes this file and calls it"
    assert [s.span.line for s in result.systems] == [3] * bool(name)


def test_a_macro_that_needs_a_value_is_named_with_the_file_that_calls_it(
    write: Write, tmp_path: Path
):
    path = write(
        MACRO.format(params="prefix *origin rate:=1"),
        caller=f'<robot {XMLNS}><xacro:cell prefix="a"/></robot>',
        other="<robot><!-- <xacro:cells/> --></robot>",
    )
    found = _only(path)
    assert found.level is Severity.ERROR
    assert "these parameters have no default: prefix, *origin" in found.message
    assert found.hint == f"name the file that calls it: {tmp_path / 'caller.xacro'}"


def test_a_macro_that_is_called_is_not_called_again(write: Write):
    path = write(MACRO.format(params="prefix:=a_") + '<xacro:cell prefix="b_"/>')
    result = load_urdf(path)
    assert [s.name for s in result.systems] == ["b_c"]
    assert result.diagnostics == ()


def test_a_mistake_in_a_macro_that_is_called_for_a_check_is_reported(write: Write):
    body = MACRO.format(params="prefix:=a_").replace(
        '<joint name="${prefix}j1"/>', "<joint name='$(find no_such)'/>"
    )
    found = _only(write(body))
    assert (found.code, found.span.line) == ("FSN119", 5)
    assert found.hint == "pass --package no_such=DIR"


FAILURES = [
    # body, place, part of the message, part of the hint
    ("  <xacro:arm/>", "2:3", "unknown macro name: xacro:arm", "define the macro xacro:arm"),
    ("<a>\n <b>\n  ${1 + x}</b></a>", "4:3", "name 'x' is not defined", "define x"),
    ("<a>${1 +}</a>", "2:4", "invalid syntax", "`xacro "),
    ('<xacro:include filename="no.xacro"/>', "2:1", "no such file", "correct the path"),
    ('<xacro:include filename="package://p/x"/>', "2:1", "no such file", "write $(find PACKAGE)"),
    ('<xacro:include filename="."/>', "2:1", "it is a directory", "correct the path"),
    (
        '<xacro:macro name="m" params="a"/><xacro:m/>',
        "2:35",
        "Undefined param",
        "give the macro: a",
    ),
    ('<xacro:macro name="m"/><xacro:m b="1"/>', "2:24", 'Invalid parameter "b"', "delete b"),
    ('<xacro:if value="maybe"/>', "2:1", "not a boolean expression", "`xacro "),
    ('<a b="$(env FSN_NOT_SET)"/>', "2:1", "not set", "set FSN_NOT_SET"),
    ("<xacro:insert_block/>", "2:1", "missing attribute 'name'", "`xacro "),
    ('<xacro:include filename="bad.xacro"/>', "FSN118 bad.xacro:1:10", "mismatched tag", "line 1"),
    ('<xacro:include filename="dtd.xacro"/>', "FSN118 dtd.xacro:1:1", "document type", "delete"),
]


@pytest.mark.parametrize("row", FAILURES, ids=lambda r: r[0][:30])
def test_failures_name_place_and_mend(row: tuple[str, str, str, str], write: Write):
    body, place, message, hint = row
    path = write(body, bad="<robot></robo>", dtd="<!DOCTYPE a><robot/>")
    result = load_urdf(path)
    assert _places(result) == [place if " " in place else f"FSN119 main.xacro:{place}"]
    assert result.systems == ()
    assert message in result.diagnostics[0].message
    assert hint in result.diagnostics[0].hint


def test_after_an_absent_optional_include_paths_still_start_at_the_file(
    write: Write, tmp_path: Path
):
    (tmp_path / "part.xacro").write_text("<robot><a/></robot>")
    path = write(
        '<xacro:include filename="away/absent.xacro" optional="true"/>'
        '<xacro:include filename="part.xacro"/>'
    )
    result = load_urdf(path)
    assert _places(result) == ["FSN125 main.xacro:1:1"]
    assert [Path(r.path).name for r in result.sources] == ["main.xacro", "part.xacro"]


def test_xacro_prefix_without_its_declaration(tmp_path: Path):
    path = tmp_path / "a.xacro"
    path.write_text("<robot>\n  <xacro:a/>\n</robot>")
    found = _only(path)
    assert (found.code, found.span.line, found.span.column) == ("FSN119", 2, 3)
    assert 'xmlns:xacro="http://www.ros.org/wiki/xacro"' in found.hint


@pytest.mark.parametrize(
    "body", ["<xacro:if value='1'/>", "<a xacro:b='1'/>", "<a b='${1}'/>", "<a>$(cwd)</a>"]
)
def test_each_use_of_xacro_is_expanded(body: str, write: Write, monkeypatch: pytest.MonkeyPatch):
    started = []
    run = subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: (started.append(a), run(*a, **k))[1])
    assert _places(load_urdf(write(body))) == ["FSN125 main.xacro:1:1"]
    assert len(started) == 1


def test_yaml_that_expressions_load_is_a_source(write: Write, tmp_path: Path):
    (tmp_path / "values.yaml").write_text("a: 1\n")
    path = write("<a>${xacro.load_yaml('values.yaml')['a']}</a>")
    names = [Path(r.path).name for r in load_urdf(path).sources]
    assert names == ["main.xacro", "values.yaml"]


def test_output_of_expressions_has_no_effect(write: Write):
    path = write("<a>${xacro.message('[1]')} ${xacro.warning('x')}</a>")
    assert _places(load_urdf(path)) == ["FSN125 main.xacro:1:1"]


def test_modules_of_the_current_folder_are_not_taken_for_xacro(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in ("xacro", "yaml", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    assert _places(load_urdf(write("<a>${1}</a>"))) == ["FSN125 main.xacro:1:1"]


# -- hostile ---------------------------------------------------------------------------------------


@pytest.fixture
def tight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little time, so that hostile files fail soon; all other limits are the usual ones."""
    limits = dataclasses.replace(xacro_expand.LIMITS, cpu_seconds=1)
    monkeypatch.setattr(xacro_expand, "LIMITS", limits)


DOUBLING = "".join(
    f'<xacro:macro name="m{n}"><xacro:m{n + 1}/><xacro:m{n + 1}/></xacro:macro>' for n in range(40)
)
ENDLESS = {
    "macro of itself": ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "without end"),
    "two macros": (
        '<xacro:macro name="a"><xacro:b/></xacro:macro>'
        '<xacro:macro name="b"><xacro:a/></xacro:macro><xacro:a/>',
        "without end",
    ),
    "exponential macro": (
        DOUBLING + '<xacro:macro name="m40"><a/></xacro:macro><xacro:m0/>',
        "more time or memory",
    ),
    "exponential text": (
        "".join(
            f'<xacro:property name="p{n}" value="${{p{n + 1}}}${{p{n + 1}}}"/>' for n in range(60)
        )
        + '<xacro:property name="p60" value="ha"/><a>${p0}</a>',
        "more time or memory",
    ),
    "large number": ("<a>${10 ** 10 ** 10}</a>", "more time or memory"),
    "much memory": ("<a>${len([0] * 10 ** 9)}</a>", "more time or memory"),
    "long list": ("<a>${[0] * 10 ** 12}</a>", "more time or memory"),
    "slow expression": ("<a>${python.sum(x for x in range(10 ** 12))}</a>", "more time or memory"),
    "long expansion": (
        '<xacro:property name="p" value="${\'ha\' * 3 * 10 ** 6}"/><a>${p}</a>',
        "its expansion is longer than 4 MiB",
    ),
    "device": ('<xacro:include filename="/dev/zero"/>', "outside the folders"),
}


@pytest.mark.usefixtures("tight")
@pytest.mark.parametrize("name", ENDLESS)
def test_endless_files_end(name: str, write: Write):
    body, message = ENDLESS[name]
    result = load_urdf(write(body))
    assert [d.code for d in _all(result)] == ["FSN119"]
    assert message in result.diagnostics[0].message


def test_an_include_of_itself_is_named(write: Write):
    """With the usual limits: tight ones end it first on a slow machine."""
    found = _only(write('<xacro:include filename="main.xacro"/>'))
    assert found.code == "FSN119"
    assert "without end" in found.message


def test_a_blocking_step_ends_at_the_wall_clock(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    import os

    os.mkfifo(tmp_path / "pipe")
    monkeypatch.setattr(
        xacro_expand, "LIMITS", dataclasses.replace(xacro_expand.LIMITS, wall_seconds=1.5)
    )
    found = _only(write("<a>${xacro.load_yaml('pipe')}</a>"))
    assert (found.code, "within 1.5 s" in found.message) == ("FSN119", True)


@pytest.mark.parametrize(
    "answer", [b"", b"[]", b"{}", b'{"sources": 1}', b'{"sources": [], "rows": [[0]]}', b"\xff"]
)
def test_a_broken_answer_is_a_finding(answer: bytes, write: Write, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(subprocess, "run", lambda *_a, stdout, **_k: stdout.write(answer))
    assert _only(write("<a>${1}</a>")).code == "FSN119"


def test_a_process_that_cannot_start_is_a_finding(write: Write, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    found = _only(write("<a>${1}</a>"))
    assert (found.code, "cannot be started" in found.message) == ("FSN119", True)


def test_deep_but_finite_macros_work(write: Write):
    macros = "".join(f'<xacro:macro name="m{n}"><xacro:m{n + 1}/></xacro:macro>' for n in range(60))
    body = macros + '<xacro:macro name="m60"><a/></xacro:macro><xacro:m0/>'
    assert _places(load_urdf(write(body))) == ["FSN125 main.xacro:1:1"]
