"""Files that are broken, hostile or no URDF at all: always findings, never an exception."""

from __future__ import annotations

import codecs
import os
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.ros2 import urdf
from fsoe_net.formats.ros2.urdf import load_urdf

BASE = (Path(__file__).parent / "urdf" / "robot.urdf").read_bytes()
LAUGHS = (
    b'<!DOCTYPE lolz [<!ENTITY a "ha">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + n, b"&%c;" % (97 + n) * 10) for n in range(10))
    + b"]><robot>&k;</robot>"
)


def _only(path: Path) -> Diagnostic:
    result = load_urdf(path)
    assert result.systems == ()
    (found,) = result.diagnostics
    assert found.hint
    return found


def _place(found: Diagnostic) -> str:
    return f"{found.code} {found.span.line}:{found.span.column}"


MALFORMED = {
    # name: (bytes, line:column, part of the message, part of the hint)
    "empty": (b"", "1:1", "no element found", "empty"),
    "blank": (b"\n\n", "3:1", "no element found", "empty"),
    "cut off": (b"<robot>\n <a>", "2:5", "no element found", "cut off"),
    "cut off in a tag": (b"<robot>\n <a", "2:2", "unclosed token", "cut off"),
    "mismatch": (b"<robot>\n <a>\n</robot>", "3:3", "mismatched tag", "<a> of line 2"),
    "two roots": (b"<robot/>\n<robot/>", "2:1", "junk after", "one root"),
    "plain &": (b"<robot>a & b</robot>", "1:11", "invalid token", "&amp;"),
    "plain <": (b"<robot>a < b</robot>", "1:11", "invalid token", "&lt;"),
    "< in an attribute": (b'<robot a="<"/>', "1:11", "invalid token", "&lt;"),
    "unquoted": (b"<robot a=1/>", "1:10", "invalid token", "quotes"),
    "attribute twice": (b'<robot a="1" a="2"/>', "1:14", "duplicate", "delete one"),
    "undefined entity": (b"<robot>\n&nbsp;</robot>", "2:1", "undefined entity", "&amp;"),
    "character 0": (b"<robot>&#0;</robot>", "1:8", "invalid character number", "delete it"),
    "late declaration": (b' <?xml version="1.0"?><robot/>', "1:2", "declaration", "very first"),
    "NUL": (b"<robot>\n \0</robot>", "2:2", "invalid token", "NUL"),
    "invalid UTF-8": (b"<robot>\n <a>\xff</a></robot>", "2:5", "invalid token", "UTF-8"),
    "cut UTF-8": (b"<robot>\n <a>\xe2\x82", "2:5", "partial character", "UTF-8"),
    "latin-1": (b"<robot>\xe9 </robot>", "1:8", "invalid token", "UTF-8"),
    "unknown encoding": (b'<?xml version="1.0" encoding="x"?><r/>', "1:1", "unknown", "UTF-8"),
    "wide encoding": (b'<?xml version="1.0" encoding="gbk"?><r/>', "1:1", "encoding", "UTF-8"),
    "wrong encoding": (b'<?xml version="1.0" encoding="utf-16"?><r/>', "1:31", "", "UTF-8"),
    "DOCTYPE": (b"<?xml version='1.0'?>\n <!DOCTYPE robot><robot/>", "2:2", "document", "delete"),
    "external entity": (
        b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot>&x;</robot>',
        "1:1",
        "document type",
        "delete",
    ),
    "billion laughs": (LAUGHS, "1:1", "document type", "delete"),
    "10 MB of <": (b"<" * 10_000_000, "1:2", "invalid token", ""),
    "deep": (b"<robot>" + b"<a>" * 100_000, "1:605", "more than 200 levels", "robot"),
    "many tags": (b"<robot>" + b"<a/>" * 600_000, "1:2000004", "more than 500000 tags", "robot"),
    "many lines": (b"<robot>" + b"\n" * 3_000_001, "3000001:1", "3000000 lines", "robot"),
    "PNG": (b"\x89PNG\r\n\x1a\n\0\0", "1:1", "invalid token", "UTF-8"),
}


@pytest.mark.shows("R7")
@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_files_are_refused_at_the_place(name: str, tmp_path: Path):
    data, place, message, hint = MALFORMED[name]
    path = tmp_path / "r.urdf"
    path.write_bytes(data)
    start = time.monotonic()
    found = _only(path)
    assert _place(found) == f"FSN118 {place}"
    assert message in found.message
    assert hint in found.hint
    assert time.monotonic() - start < 60  # a bound against quadratic behaviour, not a speed


@pytest.mark.parametrize(
    "data",
    [
        codecs.BOM_UTF8 + BASE,
        BASE.decode().encode("utf-16"),
        codecs.BOM_UTF16_BE + BASE.decode().encode("utf-16-be"),
        BASE.replace(b"\n", b"\r\n"),
        BASE.replace(b'"1.0"?', b'"1.0" encoding="ISO-8859-1"?').replace(b"cell", b"z\xe9ll"),
    ],
    ids=["utf-8 mark", "utf-16", "utf-16-be", "crlf", "latin-1"],
)
def test_encodings_and_line_ends_do_not_matter(data: bytes, tmp_path: Path):
    path = tmp_path / "r.urdf"
    path.write_bytes(data)
    result = load_urdf(path)
    assert result.diagnostics == ()
    (system,) = result.systems
    assert (system.at("plugin").line, system.at("plugin").column) == (5, 15)
    assert (system.modules[1].at("slave_config").line, system.modules[0].span.line) == (23, 35)


@pytest.mark.parametrize("mark", [codecs.BOM_UTF8, b""], ids=["mark", "no mark"])
def test_columns_of_the_first_line_do_not_count_the_byte_order_mark(mark: bytes, tmp_path: Path):
    path = tmp_path / "r.urdf"
    path.write_bytes(mark + "<robot><ros2_control name='é😀'><ec_module/>".encode())
    assert _place(_only(path)) == "FSN118 1:44"
    path.write_bytes(mark + b"<urdf/>")
    assert _place(_only(path)) == "FSN117 1:1"


def test_missing_file_names_its_neighbour(tmp_path: Path):
    (tmp_path / "robot.urdf").write_bytes(BASE)
    found = _only(tmp_path / "robt.urdf")
    assert (found.code, found.span.line) == ("FSN101", 0)
    assert "robot.urdf" in found.hint


def test_directory_and_pipe(tmp_path: Path):
    assert "a directory" in _only(tmp_path).message
    os.mkfifo(tmp_path / "pipe")
    assert "not a regular file" in _only(tmp_path / "pipe").message


def test_urdf_above_the_size_limit_is_rejected(tmp_path: Path):
    path = tmp_path / "r.urdf"
    with path.open("wb") as file:
        file.truncate(32 * 1024 * 1024 + 1)
    assert (_only(path).code, "more than" in _only(path).message) == ("FSN101", True)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_urdf_is_reported_with_chmod(tmp_path: Path):
    path = tmp_path / "r.urdf"
    path.write_bytes(BASE)
    path.chmod(0)
    assert (_only(path).code, "chmod" in _only(path).hint) == ("FSN101", True)


@pytest.mark.parametrize("path", ["a\0b", "x" * 5000, ""])
def test_impossible_path_is_reported(path: str):
    (found,) = load_urdf(path).diagnostics
    assert found.code == "FSN101"


def test_wide_attributes_and_long_words(tmp_path: Path):
    path = tmp_path / "r.urdf"
    word = b"x" * 1_000_000
    path.write_bytes(
        b"<robot " + b" ".join(b'a%d="1"' % n for n in range(20_000)) + b">"
        b"<ros2_control><hardware><plugin>ethercat_driver/%s</plugin><param name='%s'>1</param>"
        b"</hardware><gpio name='a'><ec_module name='b'><plugin>%s</plugin></ec_module></gpio>"
        b"</ros2_control></robot>" % (word, word, word)
    )
    codes = sorted(d.code for d in load_urdf(path).diagnostics)
    assert codes == ["FSN110", "FSN110", "FSN121", "FSN121"]


FUZZ = settings(
    max_examples=examples(300),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
TOKENS = [
    *(b"<", b">", b"/>", b"</", b'"', b"&amp;", b"&", b"\0", b"\xff", b"<!DOCTYPE a>", b"<!--"),
    *(b"<![CDATA[", b"-->", b"\n", b"0x1", b"-1", b"nan", b"param", b"ec_module", b"plugin"),
    *(b"</robot>", b'name="alias"', b'name="position"', b"<safety/>", b"<param/>", b"\xe2\x82"),
]


def _load_without_expansion(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(urdf, "expand_xacro", lambda *_a, **_k: None)
    result = load_urdf(path)
    assert all(d.span.line <= 5000 and d.message and d.hint for d in result.diagnostics)
    assert all(0 <= m.position <= 65535 for s in result.systems for m in s.modules)


@FUZZ
@given(data=st.binary(max_size=400))
def test_random_bytes_do_not_raise(data: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "r.urdf"
    path.write_bytes(data)
    _load_without_expansion(path, monkeypatch)


@pytest.mark.shows("R7")
@FUZZ
@given(
    edits=st.lists(
        st.tuples(
            st.integers(0, len(BASE)),
            st.integers(0, 60),
            st.one_of(st.sampled_from(TOKENS), st.binary(max_size=4)),
        ),
        min_size=1,
        max_size=6,
    )
)
def test_random_mutations_do_not_raise(
    edits: list[tuple[int, int, bytes]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    data = BASE
    for at, length, put in edits:
        data = data[:at] + put + data[at + length :]
    path = tmp_path / "r.urdf"
    path.write_bytes(data)
    _load_without_expansion(path, monkeypatch)


@FUZZ
@given(values=st.lists(st.text(max_size=30), min_size=6, max_size=6))
def test_random_values_do_not_raise(
    values: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Well-formed files with any text in every number and word."""
    text = BASE.decode()
    olds = [">1000<", '"alias">7<', '"position">2<', ">false<", "GenericEcSlave", '"required"']
    for old, value in zip(olds, values, strict=True):
        safe = "".join(c for c in value if c.isprintable()).translate(
            {38: "&amp;", 60: "&lt;", 34: "&quot;"}
        )
        put = f'"{safe}"' if old == '"required"' else safe
        head = old[: old.rfind(">", 0, -1) + 1] if old.endswith("<") else ""
        text = text.replace(old, f"{head}{put}<" if old.endswith("<") else put, 1)
    path = tmp_path / "r.urdf"
    path.write_bytes(text.encode("utf-8", "replace"))
    _load_without_expansion(path, monkeypatch)
    assert not any(d.code == "FSN118" for d in load_urdf(path).diagnostics)


CELL = (Path(__file__).parent / "urdf" / "cell.urdf.xacro").read_bytes()
CELL = CELL.replace(b'"include/', b'"' + os.fsencode(Path(__file__).parent / "urdf/include") + b"/")
XACRO_TOKENS = [
    *(b"${", b"}", b"$(", b")", b"$(find x)", b"$(arg y)", b"${1/0}", b"xacro:", b"xacro:if"),
    *(b"<xacro:macro name='m' params='*a'/>", b"<xacro:m/>", b"<xacro:call macro='terminal'/>"),
]


@settings(FUZZ, max_examples=12)
@given(
    edits=st.lists(
        st.tuples(st.integers(50, len(CELL)), st.integers(0, 12), st.sampled_from(XACRO_TOKENS)),
        min_size=1,
        max_size=2,
    )
)
def test_random_mutations_of_xacro(edits: list[tuple[int, int, bytes]], tmp_path: Path):
    data = CELL
    for at, length, put in edits:
        data = data[:at] + put + data[at + length :]
    path = tmp_path / "r.xacro"
    path.write_bytes(data)
    result = load_urdf(path, LoadOptions(packages={"devices": "/opt"}))
    assert all(d.message and d.hint and d.span.line for d in result.diagnostics)
