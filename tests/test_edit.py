"""Files of a network that a program changes: only what it changes is changed."""

import io
import re
import shutil
from datetime import date
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live.support import EXAMPLES, ROOT
from ruamel.yaml import YAML

import fsoe_net
from fsoe_net.project.edit import EditedText

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


def test_the_title_block_of_reports_is_kept(network):
    path = Path("network.yaml")
    block = "report:  # of the customer\n  number: 0815\n  logo: logo.png\n"
    path.write_text(path.read_text("utf-8").replace("nets:\n", f"{block}\nnets:\n", 1), "utf-8")
    edit = fsoe_net.load("network.yaml").edit()
    edit.document["nets"][0]["connections"][0]["watchdog_ms"] = 150
    edit.save()
    assert block in path.read_text("utf-8")


def test_parts_come_and_go(network):
    edit = network.edit()
    edit.document["nets"][0]["connections"].clear()
    del edit.document["safety_functions"]
    edit.document["subdevices"].append({"name": "lamp", "position": 2})
    changed = edit.save()
    assert not any(f.code == "FSN101" for f in changed.check())
    assert "lamp" in Path("network.yaml").read_text("utf-8")
    assert edit.diff() == ""


def test_files_of_others_are_not_overwritten(network):
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


def test_an_impossible_edit_is_rejected(network, tmp_path):
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
    assert changed.count("\r\n") == changed.count("\n") == given.count("\n") + 1
    assert [line for line in changed.splitlines() if line not in given.splitlines()] == [
        "      - {main: el1918, sub: ek1914}"
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


def test_comments_stay_where_the_part_next_to_them_goes(network):
    """A writer takes the comment before a part for one behind the part above it."""
    text = (
        "a:\n  - b: 1   # of b\n\n# of c\nc: |\n  x\n  # no comment\nd:\n  - 1\n  # of 2\n  - 2\n"
    )
    edited = EditedText(text, "x.yaml")
    del edited.document["a"]
    assert edited.text == "# of c\nc: |\n  x\n  # no comment\nd:\n  - 1\n  # of 2\n  - 2\n"
    edited = EditedText(edited.text, "x.yaml")
    del edited.document["d"][0]
    assert edited.text == "# of c\nc: |\n  x\n  # no comment\nd:\n  # of 2\n  - 2\n"
    edited.document["c"] = "y"
    assert edited.text.startswith("# of c\nc: ")
    assert YAML(typ="safe", pure=True).load(edited.text) == {"c": "y", "d": [2]}


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
    wanted = text.replace("g: 1, ", "").replace("d:\n", "- {i: 7}\nd:\n")
    assert edited.text == wanted.rstrip("\n") + f"\n      g: 5{last}"


def test_an_impossible_insertion_is_rejected_and_nothing_is_lost(monkeypatch):
    monkeypatch.setattr("fsoe_net.project.edit.changed_text", lambda *_: "a: [1")
    edited = EditedText("a: 1\n", "x.yaml")
    edited.document["a"] = 2
    with pytest.raises(ValueError, match=r"x\.yaml cannot be edited: .*change it in the text"):
        edited.text  # noqa: B018 - it raises


def test_a_text_of_several_lines_goes_whole():
    """What looks like a comment in it is a part of it; one behind it is not."""
    edited = EditedText("b: |\n  x\n  # no comment\n# of c\nc: 1\nd: >-\n  y\n\n", "x.yaml")
    del edited.document["b"]
    assert edited.text == "# of c\nc: 1\nd: >-\n  y\n\n"
    edited.document["e"] = 1
    assert edited.text == "# of c\nc: 1\nd: >-\n  y\ne: 1\n\n"
    del edited.document["d"]
    assert edited.text == "# of c\nc: 1\ne: 1\n\n"


def test_lists_and_maps_may_become_empty_and_be_filled_again():
    edited = EditedText("a:\n  # of the first\n  - 1\n  - 2 # two\nb: {c: 1}\n", "x.yaml")
    edited.document["a"].clear()
    edited.document["b"].clear()
    assert YAML(typ="safe", pure=True).load(edited.text) == {"a": [], "b": {}}
    edited.settle()
    edited.document["a"] += [{"d": 1}, 2]
    edited.document["b"]["e"] = [3]
    assert YAML(typ="safe", pure=True).load(edited.text) == {"a": [{"d": 1}, 2], "b": {"e": [3]}}
    edited.document.clear()
    assert YAML(typ="safe", pure=True).load(edited.text) == {}


def test_a_shared_alias_is_changed_in_both_places():
    text = "a: &x\n  - {b: 1}  # of b\n  - 2\nc: *x\nd: [*x, *x]\n"
    edited = EditedText(text, "x.yaml")
    assert edited.document["a"] is edited.document["c"] is edited.document["d"][1]
    edited.document["c"][0]["b"] = 3
    assert edited.text == text.replace("b: 1", "b: 3")
    edited.document["c"].append(4)
    edited.document["a"].remove(2)
    assert edited.text == "a: &x\n  - {b: 3}  # of b\n  - 4\nc: *x\nd: [*x, *x]\n"
    edited.settle()
    assert edited.document["a"] is edited.document["d"][0]
    del edited.document["d"]
    assert edited.text == "a: &x\n  - {b: 3}  # of b\n  - 4\nc: *x\n"


def test_a_part_removed_from_an_alias_is_removed_once():
    edited = EditedText("a: &x\n  k: 1\n  l: 2\n  # of a\nb: *x\n", "x.yaml")
    del edited.document["b"]["l"]
    assert edited.text == "a: &x\n  k: 1\n  # of a\nb: *x\n"


def test_a_new_item_of_a_map_has_its_indent():
    """Not that of a list which goes behind it."""
    text = "a:\n    b: 1\n    c: 2\nb:\n- 1\n- a: 1\n  b: 2\nc: 3\n"
    edited = EditedText(text, "x.yaml")
    edited.document["a"]["z"] = edited.document["a"].pop("b")
    edited.document["z"] = True
    del edited.document["b"], edited.document["c"]
    assert edited.text == "a:\n    c: 2\n    z: 1\nz: true\n"


def test_repeated_aliases_are_compared_once():
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 6)]
    edited = EditedText("\n".join(lines) + "\n", "x.yaml")
    edited.document["a0"][1] = "y"
    assert edited.text.splitlines() == ["a0: &a0 [x, y]", *lines[1:]]
    edited.settle()
    assert edited.text == edited.before


def test_aliases_that_multiply_what_they_refer_to_are_refused():
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 40)]
    with pytest.raises(fsoe_net.InputError, match="values that only aliases repeat"):
        EditedText("\n".join(lines) + "\n", "x.yaml")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a: 1\na: 2\n", "line 2: the key 'a' is given twice"),
        ("{a: 1}: 2\n", "line 1: a key must be a word"),
        ("a: *b\n", r"line 1: alias \*b has no anchor before it"),
        ("a: 1\n---\nb: 2\n", "line 2: a second document starts here"),
        ("a: " + "[" * 70 + "]" * 70 + "\n", "nested deeper than 64 levels"),
        ("a: [1\n", "x.yaml cannot be edited"),
    ],
)
def test_a_text_that_is_not_a_map_of_one_meaning_is_refused(text, why):
    with pytest.raises(fsoe_net.InputError, match=why):
        EditedText(text, "x.yaml")


def test_parts_may_move_and_change_their_kind():
    edited = EditedText("a: # of a\n  - b: 1 # of b\n    c: [2]\n  - 3\nd: 4\n", "x.yaml")
    document = edited.document
    document["d"] = {"e": document["a"].pop(0)}
    document["a"][0] = [5.5, None, True, "yes", date(2026, 11, 25), (6, 7), float("-inf"), "1"]
    document["a"], document["d"] = document["d"], document["a"]
    document["f"] = document.pop("a")
    found = YAML(typ="safe", pure=True).load(edited.text)
    assert list(found) == ["d", "f"]
    assert found["f"] == {"e": {"b": 1, "c": [2]}}
    assert found["d"] == [[5.5, None, True, "yes", date(2026, 11, 25), [6, 7], float("-inf"), "1"]]


SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    | st.sampled_from([0.5, -12.25, 1000.0])
    | st.sampled_from(["", "x", "a b", "yes", "0x1", "010", "1e3", "# no", "- 1", "a: b", "é", "~"])
)
TREES = st.dictionaries(
    st.sampled_from("abcdefgh"),
    st.recursive(
        SCALARS,
        lambda inner: (
            st.lists(inner, max_size=5) | st.dictionaries(st.sampled_from("abcdef"), inner)
        ),
        max_leaves=12,
    ),
    min_size=1,
)


@st.composite
def written_texts(draw):
    """Texts with comments, blank lines, and lists laid out in one way or another."""
    yaml = YAML()
    offset = draw(st.sampled_from([0, 2]))
    yaml.indent(mapping=draw(st.sampled_from([2, 4])), sequence=offset + 2, offset=offset)
    yaml.default_flow_style = draw(st.sampled_from([False, None]))
    stream = io.StringIO()
    yaml.width = 1000
    yaml.dump(draw(TREES), stream)
    lines = []
    for number, line in enumerate(stream.getvalue().splitlines()):
        kind = draw(st.sampled_from(["", "", "before", "blank", "behind"]))
        indent = line[: len(line) - len(line.lstrip())]
        lines += [f"{indent}# note {number}"] if kind == "before" else [""] * (kind == "blank")
        lines.append(f"{line}  # note {number}" if kind == "behind" else line)
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return end.join(lines) + draw(st.sampled_from(["", end]))


def change_something(draw, place):
    """Change, add or remove one thing somewhere."""
    inner = [v for v in (place.values() if isinstance(place, dict) else place) if v]
    inner = [v for v in inner if isinstance(v, dict | list)]
    if inner and draw(st.booleans()):
        change_something(draw, draw(st.sampled_from(inner)))
        return
    value = draw(SCALARS | st.lists(SCALARS, max_size=2) | TREES)
    if isinstance(place, dict):
        key = draw(st.sampled_from(list(place) or ["a"]))
        if draw(st.booleans()):
            place.pop(key, None)
        place[draw(st.sampled_from([key, "z"]))] = value
        if draw(st.booleans()):
            del place[draw(st.sampled_from(list(place)))]
    elif place and draw(st.booleans()):
        del place[draw(st.integers(0, len(place) - 1))]
    elif place and draw(st.booleans()):
        place[draw(st.integers(0, len(place) - 1))] = value
    else:
        place.insert(draw(st.integers(0, len(place))), value)


@given(st.data())
def test_any_change_of_any_text_names_what_the_maps_and_lists_state(data):
    text = data.draw(written_texts())
    edited = EditedText(text, "x.yaml")
    assert edited.text == text
    assert edited.document == YAML(typ="safe", pure=True).load(text)
    for _ in range(data.draw(st.integers(1, 3))):
        change_something(data.draw, edited.document)
    made = edited.text
    assert YAML(typ="safe", pure=True).load(made) == edited.document
    assert made.count("\r") == (made.count("\n") if "\r" in text else 0)
    edited.settle()
    assert edited.text == made


def parts_in(part):
    yield part
    for row in part.rows:
        yield from parts_in(row.part)


@given(st.data())
def test_comments_of_what_stays_stay_in_their_order(data):
    """One part goes, comes or changes: what is lost stood inside what went."""
    text = data.draw(written_texts())
    edited = EditedText(text, "x.yaml")
    read = edited._read
    holders = [p for p in parts_in(read.root) if p.rows]
    holder = data.draw(st.sampled_from(holders))
    number = data.draw(st.integers(0, len(holder.rows) - 1))
    row, place = holder.rows[number], holder.value
    part, is_map = row.part, isinstance(place, dict)
    first, last = read.line_of(row.begin), read.line_of(max(row.stop - 1, row.begin))
    key = row.key if is_map else number
    # One that is empty then has no place for a comment before its first part.
    # Of equal items of a list any might be meant.
    one = is_map or place.count(part.value) == 1
    goes = ["goes"] if len(holder.rows) > 1 and one else []
    what = data.draw(st.sampled_from(["comes", "changes", *goes]))
    gone = range(0)
    if what == "goes":
        del place[key]
        gone = range(first, last + 1)
    elif what == "changes":
        place[key] = "changed"
        # The line of a key stays, and one with a single line keeps its comment.
        gone = range(first + (is_map and part.is_block), last + 1) if last > first else range(0)
    elif is_map:
        place["new"] = {"x": 1}
    else:
        place.insert(number, {"x": 1})
    if not holder.is_block:
        gone = range(0)
    lines = [line for n, line in enumerate(text.splitlines()) if n not in gone]
    kept = re.findall(r"# note \d+$", "\n".join(lines), re.MULTILINE)
    found = re.findall(r"# note \d+$", edited.text.replace("\r", ""), re.M)
    assert [note for note in found if note in kept] == kept, edited.text


def test_a_comment_stays_next_to_what_it_is_about():
    text = "a:\n  - x   # left\n  - y   # right\n  - z   # head\n\nb: 1\n"
    edited = EditedText(text, "x.yaml")
    edited.document["a"].remove("x")
    edited.document["a"].append("w")
    assert edited.text == "a:\n  - y   # right\n  - z   # head\n  - w\n\nb: 1\n"
    edited = EditedText(text, "x.yaml")
    edited.document["a"].pop()
    assert edited.text == text.replace("  - z   # head\n", "")
    text = "x:\n  # one\n  - {a: 1}\n  # two\n  - {a: 2}\n  # three\n  - {a: 3}\n"
    edited = EditedText(text, "x.yaml")
    edited.document["x"][1] = {"a": 4}
    assert edited.text == text.replace("{a: 2}", "{a: 4}")
    text = "nets:\n- unconfirmed: x\n  # of main\n  main: a\n  rows:\n  - 1\n  # of sub\n  sub: b\n"
    edited = EditedText(text, "x.yaml")
    edited.document["nets"][0]["rows"].append(2)
    assert edited.text == text.replace("- 1\n", "- 1\n  - 2\n")
    edited.settle()
    del edited.document["nets"][0]["unconfirmed"]
    rest = text.partition("  rows:")[2].replace("- 1\n", "- 1\n  - 2\n")
    assert edited.text == f"nets:\n  # of main\n- main: a\n  rows:{rest}"
    text = "a:  # of a\n  # first\n  - 1\nb:  # of b\n  c: 1\n"
    edited = EditedText(text, "x.yaml")
    edited.document["a"].clear()
    edited.document["b"] = 5
    assert edited.text == "a: []  # of a\n  # first\nb: 5  # of b\n"


def test_a_moved_part_moves_alone():
    text = "s:\n  # one\n  - {n: a}   # of a\n  # two\n  - {n: b}   # of b\n  - {n:  c}\n"
    edited = EditedText(text, "x.yaml")
    rows = edited.document["s"]
    rows.insert(0, rows.pop(2))
    assert edited.text == text.replace("  - {n:  c}\n", "").replace("s:\n", "s:\n  - {n: c}\n")


def test_a_recursive_value_is_rejected():
    edited = EditedText("b: 1\n", "x.yaml")
    edited.document["c"] = edited.document
    with pytest.raises(ValueError, match=r"x\.yaml cannot be written: it is nested too deep"):
        edited.text  # noqa: B018 - it raises


def put(key, value):
    return lambda document: document.__setitem__(key, value)


THREE = "a: [\n  1, # one\n  2, # two\n  3 # three\n]\n"
ODD = [
    # nothing, and comments, behind a key or dash
    ("a:\nb: 1\n", put("a", {"x": 1, "y": [1, 2]}), "a:\n  x: 1\n  y:\n    - 1\n    - 2\nb: 1\n"),
    ("a:   # c\nb: 1\n", put("a", [1]), "a:   # c\n  - 1\nb: 1\n"),
    ("-\n- 2\n", put(0, 5), "- 5\n- 2\n"),
    ("-   # c\n- 2\n", put(0, {"x": {"y": 1}}), "- x:   # c\n    y: 1\n- 2\n"),
    ("- # c\n  a: 1\n  b: 2\n", put(0, 7), "- 7 # c\n"),
    ("- # c\n  a: 1\n  b: 2\n", lambda d: d[0].pop("a"), "- # c\n  b: 2\n"),
    ("a: 1 # c\nb: 2\n", lambda d: d.clear(), "{}\n"),
    ("# c\n{}\n# d\n", put("a", {"b": 1}), "# c\na:\n  b: 1\n# d\n"),
    # lists in lists
    ("- - 1\n  - 2\n- 3\n", lambda d: d[0].pop(0), "- - 2\n- 3\n"),
    ("- - 1\n  - 2\n- 3\n", lambda d: d[0].insert(0, 9), "- - 9\n  - 1\n  - 2\n- 3\n"),
    ("- - a: 1\n    b: 2\n- 3\n", lambda d: d[0][0].pop("a"), "- - b: 2\n- 3\n"),
    ("- - 1  # c\n", put(0, 5), "- 5    # c\n"),
    ("-   - 1\n    - 2\n", put(0, {"a": [1]}), "-   a:\n      - 1\n"),
    ("a:\n  -\n# - x\n    b: 1\n  - 2\n", lambda d: d["a"].pop(0), "a:\n  - 2\n"),
    ("a:\n    b: 1\nc: 2\n", put("c", {"d": [1]}), "a:\n    b: 1\nc:\n    d:\n      - 1\n"),
    ("a: []\n", put("a", [{"b": "x" * 99}]), f"a:\n  - b: {'x' * 99}\n"),
    ("b: |\n  # x\n# c\nc: 1\n", lambda d: d.update(a=d.pop("b"), c=d.pop("c")),
     'a: "# x\\n"\n# c\nc: 1\n'),
    # brackets
    ("a: [\n  1,\n  2,\n]\n", lambda d: d["a"].pop(0), "a: [\n  2,\n]\n"),
    ("a: {b: , c: 1}\n", lambda d: d["a"].update(b=2), "a: {b: 2, c: 1}\n"),
    ("a: [1, 2, 3]\n", lambda d: d["a"].__delitem__(slice(1, 3)), "a: [1]\n"),
    ("a: [1, 2, 3]\n", lambda d: d["a"].insert(0, [0]), "a: [[0], 1, 2, 3]\n"),
    ("a: [1, 2,]\n", lambda d: d["a"].append(4), "a: [1, 2, 4,]\n"),
    (THREE, lambda d: d["a"].pop(2), THREE.replace("3 ", " ")),
    (THREE, lambda d: d["a"].pop(1), THREE.replace("2, ", "")),
    ("a: [\n  1,\n  2,\n]\n", lambda d: d["a"].pop(1), "a: [\n  1,\n]\n"),
    ("[1]\n", lambda d: d.append({"a": ["x, y"]}), "[1, {a: ['x, y']}]\n"),
    # texts of several lines
    ("a: |+ # c\n  x\n\n\nb: 1\n", put("a", "y\nz"), 'a: "y\\nz"\nb: 1\n'),
    ("a: |+\n  x\n\n", put("c", 1), "a: |+\n  x\n\nc: 1\n"),
    ("a: |-\n  x\n\nb: 1\n", put("a", {"x": 1}), "a:\n  x: 1\n\nb: 1\n"),
    ("a: x\n  y\n  z # c\nb: 1\n", put("a", 1), "a: 1 # c\nb: 1\n"),
    ("a: 'x\n  y'   # c\nb: 1\n", put("a", {"b": []}), "a:   # c\n  b: []\nb: 1\n"),
    # words
    ("a: 0x6080\nb: 0x0A\n", lambda d: d.update(a=0x7000, b=11), "a: 0x7000\nb: 0x0B\n"),
    ("a: 'x'\nb: \"x\"\n", lambda d: d.update(a="it's", b="z"), "a: 'it''s'\nb: \"z\"\n"),
    ("[1]\n", put(0, ["1e3", "yes", "0o7", "a: b"]), """[["1e3", 'yes', "0o7", 'a: b']]\n"""),
    ("1_000: {a: 1}\nb: 2\n", lambda d: d["1_000"].update(z=2), "1_000: {a: 1, z: 2}\nb: 2\n"),
    ("2026-01-01: [1]\n", lambda d: d["2026-01-01"].append(2), "2026-01-01: [1, 2]\n"),
    ("a: !!str 5\nb: 1\n", put("a", "6"), 'a: !!str "6"\nb: 1\n'),
    # anchors
    ("a: &x [1]\nb: *x\n", lambda d: d["a"].append(2), "a: &x [1, 2]\nb: *x\n"),
    ("a: &x\n  - 1\nb: *x\n", lambda d: d["a"].clear(), "a: &x []\nb: *x\n"),
    ("a: &x\n- 1\n- 2\nb: *x\n", lambda d: d["a"].pop(0), "a: &x\n- 2\nb: *x\n"),
    ("a: &x [1]\nb: *x\n", put("b", 2), "a: &x [1]\nb: 2\n"),
    ("x: &x {}\ny:\n  <<: *x\n  b: 1\n", lambda d: d["y"].pop("<<"), "x: &x {}\ny:\n  b: 1\n"),
    # comments and lines beside
    ("a:\n  b: 1\n\n  c: 2\n\n", lambda d: d.update(z=d["a"].pop("c")), "a:\n  b: 1\n\nz: 2\n"),
    ("a: legs   # c\n", put("a", "x"), "a: x      # c\n"),
    ("a: arm  # c\n", put("a", "long"), "a: long  # c\n"),
    ("---\na: 1\n...\n", put("b", 2), "---\na: 1\nb: 2\n...\n"),
    ("a: 1\n\nb: 2\n\nc: 3\n", lambda d: d.pop("b"), "a: 1\n\nc: 3\n"),
    ("a: 1\nb: 2\n\nc: 3\n", lambda d: d.pop("b"), "a: 1\n\nc: 3\n"),
    ("a: 1", put("b", 2), "a: 1\nb: 2"),
    ("a: 1\r\nb: 2", put("b", [1]), "a: 1\r\nb:\r\n  - 1"),
    ("a: 1\n  # deep\n# more\n", put("b", 2), "a: 1\n  # deep\nb: 2\n# more\n"),
    ("s: []\n", lambda d: d["s"].append({"name": "a"}), "s:\n  - {name: a}\n"),
    ("- a: 1\n  b: 0\n", lambda d: d.append({"c": 2}), "- a: 1\n  b: 0\n- c: 2\n"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "change", "wanted"), ODD, ids=range(len(ODD)))
def test_changes_are_made_in_place(text, change, wanted):
    edited = EditedText(text, "x.yaml")
    change(edited.document)
    assert edited.text == wanted


@pytest.mark.parametrize(
    ("text", "change"),
    [
        ("? a\n: 1\n? b\n: 2\n", lambda d: d.pop("b")),
        ("a: {b, c: 1}\n", lambda d: d["a"].update(b=1)),
        ("a: [b: 1, 2]\n", lambda d: d["a"][0].update(c=3)),
        ("a: &x 1\nb: *x\n", lambda d: d.pop("a")),
    ],
)
def test_an_insertion_between_irregular_lines_is_rejected(text, change):
    edited = EditedText(text, "x.yaml")
    change(edited.document)
    with pytest.raises(ValueError, match=r"x\.yaml cannot be edited: .*change it in the text"):
        edited.text  # noqa: B018 - it raises
    assert edited.before == text


def test_lines_far_from_a_change_are_the_same_and_comments_of_what_stays_stay():
    rows = [f"  # before {n}\n  - {{x: {n},   y: 2}}  # of {n}\n" for n in range(400)]
    edited = EditedText("a:\n" + "".join(rows) + "b: 1\n", "x.yaml")
    del edited.document["a"][::2]
    edited.document["a"][7]["x"] = -1
    edited.document["a"].insert(100, {"x": 5})
    wanted = [r if n % 2 else r.splitlines(keepends=True)[0] for n, r in enumerate(rows)]
    wanted[15] = "  # before 15\n  - {x: -1,   y: 2}  # of 15\n"
    wanted[200] = "  # before 200\n  - {x: 5}            # of 200\n"
    assert edited.text == "a:\n" + "".join(wanted) + "b: 1\n"
    edited.document["a"].insert(3, {"x": 6})
    edited.document["a"].insert(3, {"x": 7})
    wanted[5] += "  - {x: 7}\n  - {x: 6}\n"
    assert edited.text == "a:\n" + "".join(wanted) + "b: 1\n"
