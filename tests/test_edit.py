"""Files of a network that a program changes: only what it changes is changed."""

import shutil
from pathlib import Path

import pytest
from run.support import EXAMPLES, ROOT

import fsoe_net
from fsoe_net.project.edit import EditedText, _yaml

FILES = sorted(
    p for p in [*EXAMPLES.rglob("*.yaml"), *(ROOT / "tests/diagnostics/base").rglob("*.yaml")]
)


@pytest.fixture
def network(tmp_path, monkeypatch):
    shutil.copytree(EXAMPLES / "estop", tmp_path / "estop")
    monkeypatch.chdir(tmp_path / "estop")
    return fsoe_net.load("network.yaml")


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_a_file_that_is_not_changed_stays_as_it_is(path):
    edit = fsoe_net.load(EXAMPLES / "estop" / "network.yaml").edit(path)
    assert edit.text == path.read_text("utf-8")


def test_a_value_is_changed_checked_and_saved(network):
    edit = network.edit()
    connection = edit.document["nets"][0]["connections"][0]
    connection["watchdog_ms"] = 1
    assert edit.diff() == (
        "--- network.yaml\n"
        "+++ network.yaml, edited\n"
        "@@ -19,7 +19,7 @@\n"
        "         in: {ec_module: el1918, index: 0x6080, subindex: 1}\n"
        "         out: {ec_module: ek1914, index: 0x7000, subindex: 1}\n"
        "     connections:\n"
        "-      - {main: el1918, sub: ek1914, address: 14, connection_id: 1, watchdog_ms: 100}\n"
        "+      - {main: el1918, sub: ek1914, address: 14, connection_id: 1, watchdog_ms: 1}\n"
        " \n"
        " # Figures of an example: yours come from the manuals of your devices, see `source`.\n"
        " safety_functions:\n"
    )
    assert [f.code for f in edit.check().errors] == ["FSN602"]
    assert network.check().ok
    assert "watchdog_ms: 100" in Path("network.yaml").read_text("utf-8")
    connection["watchdog_ms"] = 150
    changed = edit.save()
    assert edit.diff() == ""
    assert [str(c) for c in network.diff(changed).changes] == [
        "~ connection el1918 - ek1914 changed: watchdog_ms 100 -> 150"
    ]


def test_parts_come_and_go(network):
    edit = network.edit()
    edit.document["nets"][0]["connections"].clear()
    del edit.document["safety_functions"]
    edit.document["subdevices"].append({"name": "lamp", "position": 2})
    changed = edit.save()
    assert not any(f.code == "FSN101" for f in changed.check())
    assert "lamp" in Path("network.yaml").read_text("utf-8")
    assert edit.diff() == ""


def test_what_others_have_written_is_not_overwritten(network):
    edit = network.edit()
    edit.document["cycle_us"] = 2000
    path = Path("network.yaml")
    path.write_text(path.read_text("utf-8") + "# mine\n", "utf-8")
    with pytest.raises(fsoe_net.InputError, match=r"nothing written: network\.yaml has changed"):
        edit.save()
    assert path.read_text("utf-8").endswith("# mine\n")
    path.unlink()
    with pytest.raises(fsoe_net.InputError, match="cannot be read again"):
        edit.save()


def test_what_cannot_be_edited_is_refused(network, tmp_path):
    with pytest.raises(fsoe_net.InputError, match=r"no\.yaml cannot be read"):
        network.edit("no.yaml")
    damaged = tmp_path / "damaged.yaml"
    damaged.write_text("a: [1\n", "utf-8")
    with pytest.raises(fsoe_net.InputError, match="cannot be edited"):
        network.edit(damaged)
    edit = network.edit()
    edit.document["name"] = object()
    with pytest.raises(ValueError, match=r"network\.yaml cannot be written"):
        edit.text  # noqa: B018 - it raises
    with pytest.raises(ValueError, match=r"network\.yaml cannot be written"):
        edit.save()
    assert "name: estop" in Path("network.yaml").read_text("utf-8")


def test_a_text_with_a_byte_order_mark_is_kept_as_text(network, tmp_path):
    path = tmp_path / "bom.yaml"
    path.write_bytes(b"\xef\xbb\xbfversion: 1\nname: x\n")
    edit = network.edit(path)
    edit.document["name"] = "y"
    edit.save()
    assert path.read_text("utf-8-sig") == "version: 1\nname: y\n"


def test_lines_without_a_change_keep_their_layout(network):
    """Also where a writer of YAML would lay them out in another way."""
    path = Path("network.yaml")
    given = path.read_text("utf-8").replace("address: 14, ", "address:   14 , ")
    given = given.replace("required:", "required :").replace("\n", "\r\n")
    path.write_bytes(given.encode())
    edit = fsoe_net.load(path).edit()
    assert edit.text == given
    edit.document["nets"][0]["connections"].append({"main": "el1918", "sub": "ek1914"})
    changed = edit.text
    assert changed.count("\r\n") == changed.count("\n") == given.count("\n") + 2
    assert [line for line in changed.splitlines() if line not in given.splitlines()] == [
        "      - main: el1918",
        "        sub: ek1914",
    ]
    assert "address:   14 , " in changed
    assert "required :" in changed


@pytest.mark.parametrize("text", ["a:\n-\n", "a: 1\n- b\n---\n", "a:\n- - 1\n"])
def test_odd_lines_are_read_or_refused(text):
    try:
        edited = EditedText(text, "x.yaml")
    except fsoe_net.InputError as exc:
        assert "x.yaml cannot be edited" in str(exc)  # noqa: PT017 - either is right
    else:
        assert edited.text == text


def test_comments_stay_where_the_part_beside_them_goes(network):
    """A writer takes the comment before a part for one behind the part above it."""
    text = (
        "a:\n  - b: 1   # of b\n\n# of c\nc: |\n  x\n  # no comment\nd:\n  - 1\n  # of 2\n  - 2\n"
    )
    edited = EditedText(text, "x.yaml")
    del edited.document["a"]
    assert edited.text == "\n# of c\nc: |\n  x\n  # no comment\nd:\n  - 1\n  # of 2\n  - 2\n"
    edited = EditedText(edited.text.lstrip(), "x.yaml")
    del edited.document["d"][0]
    assert edited.text == "# of c\nc: |\n  x\n  # no comment\nd:\n  # of 2\n  - 2\n"
    edited.document["c"] = "y"
    assert edited.text.startswith("# of c\nc: ")
    assert _yaml().load(edited.text) == {"c": "y", "d": [2]}


@pytest.mark.parametrize("last", ["", "\n"])
def test_lists_with_indents_of_their_own_keep_them(last):
    """A writer has one indent for all lists, and drops comments and line ends between some."""
    text = (
        "a:\n- {b: 1}\n# of c\n- {c: 2}   # c\nd:\n- e: 1\n  f:\n    - {g: 1, h: 2}\n    - g: 3"
        f"\n      h: 4\n\n    - h: 6{last}"
    )
    edited = EditedText(text, "x.yaml")
    del edited.document["d"][0]["f"][0]["g"]
    assert edited.text == text.replace("g: 1, ", "")
    edited.document["d"][0]["f"][2]["g"] = 5
    edited.document["a"].append({"i": 7})
    wanted = text.replace("g: 1, ", "").replace("d:\n", "- i: 7\nd:\n")
    assert edited.text == wanted.rstrip("\n") + f"\n      g: 5{last}"


def test_what_cannot_be_put_in_is_refused_and_nothing_is_lost(monkeypatch):
    monkeypatch.setattr("fsoe_net.project.edit.with_lines_kept", lambda *_: "a: [1")
    edited = EditedText("a: 1\n", "x.yaml")
    edited.document["a"] = 2
    with pytest.raises(ValueError, match=r"x\.yaml cannot be edited: .*change it in the text"):
        edited.text  # noqa: B018 - it raises
