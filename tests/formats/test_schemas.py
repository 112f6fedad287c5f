"""JSON Schemas and loaders agree: what a schema allows is refused only for other keys or files."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import pytest
import yaml
from data_files import ROOT
from formats.inventions import documents
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from weekly import examples

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.formats.own.answers import load_answers
from fsoe_net.formats.own.json_schema import LEFT_TO_READERS, read_schema, schema_errors
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.formats.own.test_record import load_test_record
from fsoe_net.formats.shared.files import Collector

# Other keys or files say the rest: a path, two names of one thing, the order of two times, a day
# that its month has, a step that is not done at the machine, the bits of another entry, keys of one
# bus beside several, groups beside several buses, an infinite factor, a number beyond any double.
BETWEEN_KEYS = {"FSN133", "FSN164", "FSN165", "FSN228", "FSN161", "FSN422", "FSN487"}
ORDER = [
    ("FSN113", "during_ms: the end is before the start"),
    *(("FSN113", f"{key} must rise") for key in ("limits_rev", "home_switch_rev")),
    *(("FSN113", f"{key} is too large") for key in ("default", "factor", "offset")),
]


NAMES = [
    "network",
    "transfers",
    "slave",
    "scenario",
    "answers",
    "test-record",
    "acceptance",
    "scan",
]
OTHERS = [*NAMES, "device"]


def validator(name: str) -> Draft202012Validator:
    schemas = [read_schema(other) for other in OTHERS]
    rows = ((schema["$id"], Resource.from_contents(schema)) for schema in schemas)
    return Draft202012Validator(read_schema(name), registry=Registry().with_resources(rows))


def found_in(name: str, path: Path) -> list[Diagnostic]:
    out = Collector()
    if name == "scenario":
        return load_scenario(path)[1]
    if name == "answers":
        load_answers(str(path), out)
    elif name == "test-record":
        load_test_record(str(path), out)
    else:
        return list(load_network([path], LoadOptions()).diagnostics)
    return out.diagnostics


@pytest.mark.uncounted
@pytest.mark.parametrize(
    "name", ["network", "transfers", "slave", "scenario", "answers", "test-record"]
)
def test_schema_and_reader_accept_the_same_values(name: str, tmp_path: Path):
    refused: list[tuple[str, str]] = []
    checked = 0

    @settings(
        max_examples=examples(60),
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(documents(name))
    def load(document: object) -> None:
        nonlocal checked
        checked += 1
        path = tmp_path / "x.yaml"
        path.write_text(json.dumps(document, ensure_ascii=False), "utf-8")
        errors = [d for d in found_in(name, path) if d.level is Severity.ERROR]
        refused.extend(
            (d.code, d.message)
            for d in errors
            if d.code not in BETWEEN_KEYS and (d.code, d.message) not in ORDER
        )

    load()
    assert checked >= examples(50)
    assert refused == []


@pytest.mark.parametrize("name", ["estop", "el6910", "robot-cell"])
def test_the_examples_are_valid_in_an_editor(name: str):
    folder = ROOT / "examples" / name
    files = {"network": [folder / "network.yaml"], "scenario": [folder / "scenario.yaml"]}
    files["slave"] = sorted((folder / "devices").glob("*.yaml"))
    for schema, paths in files.items():
        for path in paths:
            document = yaml.safe_load(path.read_text("utf-8"))
            assert [e.message for e in validator(schema).iter_errors(document)] == []


@pytest.mark.parametrize("name", ["network", "transfers", "slave", "scenario", "answers"])
def test_every_schema_is_one(name: str):
    Draft202012Validator.check_schema(read_schema(name))


NETWORK = """version: 1
subdevices:
  - {{name: a, position: {position}, config: a.yaml}}
nets: []
"""


def messages(tmp_path: Path, position: str) -> list[tuple[str, str, str]]:
    (tmp_path / "a.yaml").write_text("vendor_id: 2\nproduct_id: 3\nperiod: 100\n", "utf-8")
    path = tmp_path / "network.yaml"
    path.write_text(NETWORK.format(position=position), "utf-8")
    found = load_network([path]).diagnostics
    return [(d.code, d.message, d.hint) for d in found if d.code != "FSN125"]


def test_a_quoted_number_is_not_a_number_in_a_network(tmp_path: Path):
    assert messages(tmp_path, '"0x5"') == [
        (
            "FSN111",
            "subdevices 1, position must be a whole number, it is '0x5'",
            "write 0x5, without quotes",
        )
    ]
    assert messages(tmp_path, "0x5") == []


@pytest.mark.parametrize(
    ("position", "code"),
    [
        ("five", "FSN111"),
        ("5h", "FSN112"),
        ("65536", "FSN113"),
        ("010", "FSN114"),
        ("5.0", "FSN112"),
    ],
)
def test_the_reader_of_numbers_names_what_is_wrong_with_one(
    position: str, code: str, tmp_path: Path
):
    assert [row[0] for row in messages(tmp_path, position)] == [code]


def test_period_is_known_in_a_slave_yaml(tmp_path: Path):
    """Files of the driver have it; the driver does not read it."""
    assert messages(tmp_path, "0") == []


@given(st.integers(-(2**65), 2**65), st.sampled_from(["int8", "uint16", "int64", "uint64"]))
@settings(deadline=None, max_examples=50)
def test_values_of_sdos_have_the_range_of_their_type(value: int, word: str):
    sdo = {"index": 0x8000, "sub_index": 1, "type": word, "value": value}
    document = {"vendor_id": 2, "product_id": 3, "sdo": [sdo]}
    bits = int(word.rpartition("t")[2])
    low, high = (0, 2**bits) if word[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    assert validator("slave").is_valid(document) == (low <= value < high)


def changed(document: object, draw: st.DataObject) -> object:
    """Change a place: a key away, another key, another value."""
    places: list[tuple[dict | list, str | int]] = []
    pending = [document]
    while pending:
        part = pending.pop()
        keys: Iterable[str | int] = ()
        if isinstance(part, dict):
            keys = list(part)
        elif isinstance(part, list):
            keys = range(len(part))
        places += [(part, key) for key in keys]
        pending += [part[key] for key in keys]
    if not places:
        return None
    part, key = draw.draw(st.sampled_from(places))
    if isinstance(part, dict) and draw.draw(st.booleans()):
        value = part.pop(key)
        if draw.draw(st.booleans()):
            part["other"] = value
    else:
        values = [None, True, 1, 1.0, 0.5, "x", "", [], {}, [1, 2, 3], {"x": 1}]
        part[key] = draw.draw(st.sampled_from(values))
    return document


@pytest.mark.uncounted
@pytest.mark.parametrize("name", NAMES)
def test_structure_is_checked_as_a_validator_does(name: str):
    official = validator(name)

    @settings(max_examples=examples(60), deadline=None, suppress_health_check=list(HealthCheck))
    @given(documents(name), st.data())
    def compare(document: object, data: st.DataObject) -> None:
        for _ in range(3):
            wanted = [
                (e.validator, *e.absolute_path)
                for e in official.iter_errors(document)
                if e.validator not in LEFT_TO_READERS
            ]
            found = [(e.keyword, *e.path) for e in schema_errors(document, name)]
            assert sorted(found, key=repr) == sorted(wanted, key=repr)
            document = changed(document, data)

    compare()


@pytest.mark.parametrize("name", OTHERS)
def test_the_checker_has_each_keyword_of_the_schemas(name: str):
    checked = {"type", "enum", "const", "minItems", "maxItems", "items", "$ref"}
    checked |= {"properties", "additionalProperties", "required"}
    notes = {"$schema", "$id", "$defs", "title", "description"}
    pending, unknown = [read_schema(name)], set()
    while pending:
        schema = pending.pop()
        unknown |= schema.keys() - checked - notes - LEFT_TO_READERS
        inner = [v for key in ("properties", "$defs") for v in schema.get(key, {}).values()]
        inner += [schema[k] for k in ("items", "additionalProperties") if k in schema]
        pending += [part for part in inner if isinstance(part, dict)]
    assert unknown == set()


@pytest.mark.parametrize("name", OTHERS)
def test_additions_of_a_condition_are_left_to_readers(name: str):
    """The checker does not look into `allOf`: nothing in there may be its business."""
    pending, conditions = [read_schema(name)], []
    while pending:
        part = pending.pop()
        if isinstance(part, dict):
            conditions += [c for c in part.get("allOf", ()) if isinstance(c, dict)]
            conditions += [part] if "if" in part and "then" in part else []
            pending += part.values()
        elif isinstance(part, list):
            pending += part
    for condition in conditions:
        added = condition.get("then", condition)
        properties = added.get("properties", {}).values() if "then" in condition else ()
        assert (added.keys() - {"properties", "if", "then"}) <= LEFT_TO_READERS
        assert all(p.keys() <= LEFT_TO_READERS for p in properties)
