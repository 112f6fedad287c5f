"""Scenario files: what is read, and every mistake at its line and column."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.json_schema import read_schema
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.model.scenario import Action, LogicChoice

WEEK_MS = 7 * 24 * 3600 * 1000


def write(folder: Path, text: str) -> Path:
    path = folder / "s.yaml"
    path.write_text(text, "utf-8")
    return path


def test_everything_at_once(tmp_path: Path):
    path = write(
        tmp_path,
        """\
version: 1
duration_s: 2.5
initial: {io.0x6001:01: 0}
logic: {inputs: [io.0x6001:01], outputs: []}
steps:
  - {at_ms: 900, break: io}
  - {at_ms: 0.5, press: reset}
  - at_ms: 20
    set: {io.0x6001:01: true, io.0x6001:02: 0x10}
    output: {io.lamp: -3}
expect:
  - {at_ms: 100, connection: a-b, state: data, max_resets: 0}
  - {during_ms: [10, 20.5], outputs: "off", safe_outputs: {io.0x7001:01: false}, min_resets: 2}
""",
    )
    scenario, found = load_scenario(path)
    assert found == []
    assert scenario is not None
    assert scenario.duration_ns == 2_500_000_000
    assert scenario.initial == {"io.0x6001:01": 0}
    assert scenario.logic == LogicChoice(inputs=("io.0x6001:01",), outputs=())
    assert [(s.at_ns, s.action) for s in scenario.steps] == [
        (500_000, Action.PRESS),
        (20_000_000, Action.SET),
        (20_000_000, Action.OUTPUT),
        (900_000_000, Action.BREAK),
    ]
    assert scenario.steps[1].values == {"io.0x6001:01": 1, "io.0x6001:02": 16}
    assert scenario.steps[2].values == {"io.lamp": -3}
    assert str(scenario.steps[1].at("io.0x6001:02")).endswith("s.yaml:9:31")
    first, second = scenario.expectations
    assert (first.from_ns, first.to_ns, first.connection) == (100_000_000, 100_000_000, "a-b")
    assert (first.state, first.max_resets, first.min_resets) == ("data", 0, None)
    assert (second.from_ns, second.to_ns) == (10_000_000, 20_500_000)
    assert second.outputs_on is False
    assert second.safe_outputs == {"io.0x7001:01": 0}
    assert second.min_resets == 2


def test_steps_on_a_segment(tmp_path: Path):
    path = write(
        tmp_path,
        """\
version: 1
steps:
  - {at_ms: 1, swap: [a, b]}
  - {at_ms: 2, wrong: {subdevice: a, vendor: 2, product: 0x1234}}
  - {at_ms: 3, sdo_abort: {subdevice: a, index: 0x1C12, sub: 1, code: 0x06090011}}
  - {at_ms: 4, mailbox_delay_ms: {a: 20, b: 30}}
  - {at_ms: 5, lose: 10, delay_us: 500}
  - {at_ms: 6, cut: main}
  - {at_ms: 7, fsoe_address: {a: 5}}
  - {at_ms: 8, narrow_clock: a}
""",
    )
    scenario, found = load_scenario(path)
    assert found == []
    steps = {s.action: s for s in scenario.steps}
    assert (steps[Action.SWAP].target, steps[Action.SWAP].other) == ("a", "b")
    assert steps[Action.WRONG].target == "a"
    assert steps[Action.WRONG].values == {"vendor": 2, "product": 0x1234}
    assert steps[Action.SDO_ABORT].values == {"index": 0x1C12, "sub": 1, "code": 0x06090011}
    assert steps[Action.MAILBOX_DELAY].values == {"a": 20, "b": 30}
    assert (steps[Action.LOSE].number, steps[Action.DELAY].number) == (10, 500)
    assert steps[Action.CUT].target == "main"
    assert steps[Action.NARROW_CLOCK].target == "a"
    assert steps[Action.FSOE_ADDRESS].values == {"a": 5}
    needs = {a for a in steps if a.needs_segment}
    assert needs == set(steps) - {Action.FSOE_ADDRESS}


@pytest.mark.parametrize(
    ("spelling", "on"), [('"on"', True), ("on", True), ("off", False), ("true", True)]
)
def test_outputs_on_and_off_however_yaml_reads_them(tmp_path: Path, spelling: str, on: bool):
    text = f"version: 1\nexpect: [{{at_ms: 1, outputs: {spelling}}}]\n"
    scenario, found = load_scenario(write(tmp_path, text))
    assert (found, scenario.expectations[0].outputs_on) == ([], on)


MISTAKES = {
    "unknown top key, near": ("version: 1\nstep: []\n", ["2:1 FSN109"]),
    "unknown top key, far": ("version: 1\nassertions: []\n", ["2:1 FSN109"]),
    "unknown key in a step": (
        "version: 1\nsteps: [{at_ms: 1, unplug: io}]\n",
        ["2:9 FSN110", "2:20 FSN109"],
    ),
    "unknown key in an expectation": (
        "version: 1\nexpect: [{at_ms: 1, state: data, colour: red}]\n",
        ["2:34 FSN109"],
    ),
    "no version": ("steps: []\n", ["1:1 FSN110"]),
    "wrong version": ("version: 2\n", ["1:10 FSN116"]),
    "steps is no list": ("version: 1\nsteps: {at_ms: 1}\n", ["2:8 FSN111"]),
    "step is a word": ("version: 1\nsteps: [press]\n", ["2:9 FSN111"]),
    "step without time": ("version: 1\nsteps: [{press: reset}]\n", ["2:9 FSN110"]),
    "step without action": ("version: 1\nsteps: [{at_ms: 1}]\n", ["2:9 FSN110"]),
    "press what": ("version: 1\nsteps: [{at_ms: 1, press: 1}]\n", ["2:27 FSN111"]),
    "negative time": ("version: 1\nsteps: [{at_ms: -1, press: reset}]\n", ["2:17 FSN113"]),
    "time nan": ("version: 1\nsteps: [{at_ms: .nan, press: reset}]\n", ["2:17 FSN113"]),
    "time endless": ("version: 1\nsteps: [{at_ms: 1e300, press: reset}]\n", ["2:17 FSN113"]),
    "time is a word": ("version: 1\nsteps: [{at_ms: soon, press: reset}]\n", ["2:17 FSN111"]),
    "duration zero": ("version: 1\nduration_s: 0\n", ["2:13 FSN113"]),
    "duration endless": ("version: 1\nduration_s: .inf\n", ["2:13 FSN113"]),
    "state misspelt": ("version: 1\nexpect: [{at_ms: 1, state: date}]\n", ["2:28 FSN116"]),
    "expectation without time": ("version: 1\nexpect: [{state: data}]\n", ["2:10 FSN110"]),
    "expectation with two times": (
        "version: 1\nexpect: [{at_ms: 1, during_ms: [1, 2], state: data}]\n",
        ["2:21 FSN106"],
    ),
    "expectation of nothing": (
        "version: 1\nexpect: [{at_ms: 1, connection: x}]\n",
        ["2:10 FSN110"],
    ),
    "window falls": ("version: 1\nexpect: [{during_ms: [2, 1], state: data}]\n", ["2:22 FSN113"]),
    "window endless": (
        "version: 1\nexpect: [{during_ms: [0, .inf], state: data}]\n",
        ["2:26 FSN113"],
    ),
    "window nan": ("version: 1\nexpect: [{during_ms: [.nan, 1], state: data}]\n", ["2:23 FSN113"]),
    "window too short": ("version: 1\nexpect: [{during_ms: [1], state: data}]\n", ["2:22 FSN111"]),
    "window of three": (
        "version: 1\nexpect: [{during_ms: [1, 2.5, 3], state: data}]\n",
        ["2:22 FSN111"],
    ),
    "swap one": ("version: 1\nsteps: [{at_ms: 1, swap: [a]}]\n", ["2:26 FSN111"]),
    "swap with itself": ("version: 1\nsteps: [{at_ms: 1, swap: [a, a]}]\n", ["2:26 FSN113"]),
    "wrong without product": (
        "version: 1\nsteps: [{at_ms: 1, wrong: {subdevice: a, vendor: 2}}]\n",
        ["2:27 FSN110"],
    ),
    "abort of no index": (
        "version: 1\nsteps: [{at_ms: 1, sdo_abort: {subdevice: a, index: 0x10000, code: 1}}]\n",
        ["2:53 FSN113"],
    ),
    "lose fewer than none": ("version: 1\nsteps: [{at_ms: 1, lose: -1}]\n", ["2:26 FSN113"]),
    "value is a word": ("version: 1\ninitial: {io.0x1:01: maybe}\n", ["2:22 FSN111"]),
    "value is a fraction": (
        "version: 1\nsteps: [{at_ms: 1, set: {a: 0.5}}]\n",
        ["2:29 FSN111"],
    ),
    "set without values": ("version: 1\nsteps: [{at_ms: 1, set: on}]\n", ["2:25 FSN111"]),
    "resets negative": (
        "version: 1\nexpect: [{at_ms: 1, max_resets: -1}]\n",
        ["2:33 FSN113"],
    ),
    "key twice": ("version: 1\nversion: 1\n", ["2:1 FSN106"]),
    "name twice": ("version: 1\ninitial: {a: 1, a: 0}\n", ["2:17 FSN106"]),
    "empty": ("", ["1:1 FSN104"]),
    "a list": ("- 1\n", ["1:1 FSN104"]),
    "no YAML": ("version: [1\nsteps: 2]\n", ["2:6 FSN102"]),
    "two documents": ("version: 1\n---\nversion: 1\n", ["2:1 FSN105"]),
    "no UTF-8": ("version: 1 # \udcff\n", ["1:14 FSN102"]),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistake_in_a_scenario_is_reported_at_its_place(tmp_path: Path, name: str):
    text, wanted = MISTAKES[name]
    path = tmp_path / "s.yaml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    _, found = load_scenario(path)
    assert any(d.level is Severity.ERROR for d in found)
    assert all(d.hint for d in found)
    assert [f"{d.span.line}:{d.span.column} {d.code}" for d in found] == wanted


BOMB = "a: &a [x, x]\n" + "".join(
    f"{here}: &{here} [{', '.join(['*' + before] * 8)}]\n"
    for before, here in zip("abcdefgh", "bcdefghi", strict=True)
)


def test_missing_file_and_folder(tmp_path: Path):
    for path in (tmp_path / "none.yaml", tmp_path):
        scenario, found = load_scenario(path)
        assert scenario is None
        assert [d.code for d in found] == ["FSN101"]


@pytest.mark.parametrize(
    "text",
    [
        "version: 1\nsteps: &a [*a]\n",
        BOMB,
        "version: 1\nsteps: " + "[" * 5000 + "]" * 5000 + "\n",
        "version: " + "9" * 5000 + "\n",
        "version: 1\nduration_s: " + "9" * 5000 + "\n",
        "version: 1\ninitial: {x: " + "9" * 5000 + "}\n",
        "version: [1\n",
        "version: 1\nsteps: [{at_ms: " + "9" * 400 + ", press: reset}]\n",
        "version: 1\nsteps: [{at_ms: !!python/object/apply:os.system [x], press: reset}]\n",
        "version: 1\n? [a, b]\n: c\n",
        "\0\0\0",
    ],
    ids=[
        "recursive alias",
        "alias bomb",
        "deep",
        "long version",
        "long duration",
        "long value",
        "open bracket at the end",
        "long time",
        "python tag",
        "list as key",
        "zero bytes",
    ],
)
def test_hostile_file_is_a_finding(tmp_path: Path, text: str):
    _, found = load_scenario(write(tmp_path, text))
    assert any(d.level is Severity.ERROR for d in found)


_KEYS = [*read_schema("scenario")["properties"], "at_ms", "during_ms", "state", "set", "press"]
_SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**30), 10**30),
    st.floats(),
    st.sampled_from(["reset", "data", "on", ".inf", "0x10", "1e999", "", "~", "0o7", "08"]),
    st.text(max_size=6),
)
_TREES = st.recursive(
    _SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(_KEYS), inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=examples(300), deadline=None)
@given(tree=st.dictionaries(st.sampled_from(_KEYS), _TREES, max_size=6))
def test_no_tree_of_known_keys_makes_it_raise(
    tmp_path_factory: pytest.TempPathFactory, tree: dict[str, object]
):
    import yaml

    path = write(tmp_path_factory.getbasetemp(), yaml.safe_dump(tree, allow_unicode=True))
    scenario, found = load_scenario(path)
    if scenario is not None and not found:
        assert all(0 <= s.at_ns <= WEEK_MS * 1_000_000 for s in scenario.steps)
        assert all(e.from_ns <= e.to_ns for e in scenario.expectations)


@settings(max_examples=examples(200), deadline=None)
@given(data=st.binary(max_size=200))
def test_no_bytes_make_it_raise(tmp_path_factory: pytest.TempPathFactory, data: bytes):
    path = tmp_path_factory.getbasetemp() / "bytes.yaml"
    path.write_bytes(data)
    load_scenario(path)
