"""The YAML tree: the same from both parsers of PyYAML; places are made when asked for."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest
import yaml

from fsoe_net.diag.diagnostic import Span
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.shared import yaml_events
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import MapNode, Node, ScalarNode, parse_yaml

ROOT = Path(__file__).parents[2]
ESTOP = ROOT / "examples" / "estop" / "network.yaml"
FILES = sorted(
    path
    for folder in ("examples", "fsoe_net/devices", "tests/diagnostics")
    for path in (ROOT / folder).rglob("*.yaml")
)


def flat(node: Node | None) -> object:
    """Return all that a tree tells: values, spellings, places of values and keys."""
    if node is None:
        return None
    if isinstance(node, ScalarNode):
        return (node.span, node.text, node.plain)
    if isinstance(node, MapNode):
        return (node.span, node.keys, {key: flat(value) for key, value in node.pairs.items()})
    return (node.span, [flat(item) for item in node.items])


def read(path: Path) -> tuple[object, list[tuple[str, Span, str]]]:
    out = Collector()
    root = parse_yaml(path.read_bytes(), path.name, out)
    return flat(root), [(d.code, d.span, d.message) for d in out.diagnostics]


@pytest.mark.skipif(not hasattr(yaml, "CLoader"), reason="PyYAML was built without libyaml")
def test_both_parsers_give_the_same_tree_of_every_file(monkeypatch: pytest.MonkeyPatch):
    assert len(FILES) > 20
    with_libyaml = [read(path) for path in FILES]
    monkeypatch.setattr(yaml_events, "_LOADER", yaml.Loader)
    for path, (tree, found) in zip(FILES, with_libyaml, strict=True):
        slow_tree, slow_found = read(path)
        assert slow_tree == tree, path
        # libyaml words a mistake in the syntax in its own way, and may see it a word later.
        assert [c for c, _, _ in slow_found] == [c for c, _, _ in found], path
        if tree is not None:
            assert slow_found == found, path


def test_places_are_those_of_keys_and_values():
    out = Collector()
    root = parse_yaml(b"a: 1\nlist:\n  - {b: x, c: [y]}\n", "f", out)
    assert root is not None
    assert root.keys == {"a": Span("f", 1, 1), "list": Span("f", 2, 1)}
    inner = root.maps("list")[0]
    assert dict(inner.places()) == {"b": Span("f", 3, 9), "c": Span("f", 3, 15)}
    assert inner.keys["c"] == Span("f", 3, 12)
    assert inner.places() | {"d": inner.span} == {**inner.places(), "d": Span("f", 3, 5)}
    assert "z" not in inner.places()
    assert len(inner.places()) == 2


def test_aliases_count_as_if_written_out(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(yaml_events, "MAX_ALIASED", 30)
    text = b"a: &a {b: [1, 2, 3, 4]}\nc: [" + b"*a, " * 3 + b"]\n"
    out = Collector()
    assert parse_yaml(text, "f", out) is not None
    assert parse_yaml(text.replace(b"*a, *a", b"*a, *a, *a"), "f", out) is None
    assert [d.code for d in out.diagnostics] == ["FSN103"]


def test_a_key_with_an_anchor_is_a_key():
    out = Collector()
    root = parse_yaml(b"&k a: 1\nb: *k\n", "f", out)
    assert root is not None
    assert (root.text("a"), root.text("b")) == ("1", "a")
    assert root.keys["a"].line == 1


LIST = """\
rows:
  - name: a
    size: 1
{second}
    size: 2
"""


@pytest.mark.parametrize(
    ("text", "code", "hint"),
    [
        (
            LIST.format(second="    name: b"),
            "FSN106",
            "start a new item with `- ` here, or delete one of them",
        ),
        (LIST.format(second="    x: b"), "FSN106", "delete one of them"),
        ("rows:\n  - {a: 1, a: 2}\n", "FSN106", "delete one of them"),
        ("a: 1\na: 2\n", "FSN106", "delete one of them"),
        (
            "rows:\n  - {a: 1}\n    {a: 2}\n",
            "FSN102",
            "start the item with `- `, or indent it like the other keys of the item above",
        ),
        (
            "rows:\n  - {a: 1}\n  {a: 2}\n",
            "FSN102",
            "line 3 has no colon after a key; an item of a list begins with `- `",
        ),
        (
            "rows:\n  -name: a\n    size: 1\n",
            "FSN102",
            "write `- name:` in line 2: a dash needs a blank",
        ),
        (
            "rows:\n    a: 1\n    b: 2\n  - a: 3\n",
            "FSN102",
            "start the item above with `- ` too, and indent both alike",
        ),
        (
            "rows:\n    a: 1\n      b: 2\n  - a: 3\n",
            "FSN102",
            "start the item in the line above with `- `, or indent this line like it",
        ),
        (
            "rows:\n    a: 1 # one\n      b: 2\n",
            "FSN102",
            "start the item in the line above with `- `, or indent this line like it",
        ),
        ("rows:\n  a: b: c\n", "FSN102", "check indentation and brackets above this place"),
        ("a: b: c\n", "FSN102", "check indentation and brackets above this place"),
        (
            "rows:\n\t- a: 1\n",
            "FSN102",
            "replace the tab by spaces; YAML forbids tabs in indentation",
        ),
    ],
)
def test_a_forgotten_dash_is_named(text: str, code: str, hint: str):
    """Once: the other keys of the item come twice for the same reason."""
    out = Collector()
    parse_yaml(text.encode(), "f.yaml", out)
    assert [(d.code, d.hint) for d in out.diagnostics] == [(code, hint)]


def test_a_network_keeps_the_places_of_its_values_without_their_nodes():
    """The tree of the largest bus would take as much memory as all the rest."""
    gc.collect()
    before = sum(isinstance(item, MapNode) for item in gc.get_objects())
    network = load_network([ESTOP]).network
    gc.collect()
    assert network is not None
    assert sum(isinstance(item, MapNode) for item in gc.get_objects()) == before
    lines = ESTOP.read_text("utf-8").splitlines()
    transfer = network.nets[0].transfers[0]
    for key, word in (("size", str(transfer.size_bytes)), ("in", "{"), ("out", "{")):
        place = transfer.at(key)
        assert lines[place.line - 1][place.column - 1 :].startswith(word)
    assert transfer.at("kind") == transfer.span
    assert "kind" not in transfer.fields
