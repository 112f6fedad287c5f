"""Safety functions of a network file: read whole, and every mistake at its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.safety import ElementKind, SafetyFunction

HEAD = "version: 1\nproject: Cell 7\nsubdevices: []\nnets: []\nsafety_functions:\n"
WHOLE = """\
  - name: estop
    trigger: button ES1 is pressed
    reaction: safe torque off
    required_reaction_ms: 150
    required: {pl: D}
    elements:
      - {kind: sensor, name: ES1, time_ms: 5, pfh_per_hour: 1.0e-8, source: sheet 3, manual: "2.1"}
      - {kind: input, sub: el1904}
      - {kind: actuator}
"""
BITS = (
    "{kind: input, sub: el1904, bits: [{bit: 9, name: B}, {bit: 0x8, name: A}, "
    "{slot: 1, bit: 0, name: C}, {bit: 1007, name: D}]}"
)


def load(tmp_path: Path, text: str) -> tuple[tuple[SafetyFunction, ...], list[Diagnostic]]:
    path = tmp_path / "network.yaml"
    path.write_text(HEAD + text)
    loaded = load_network([path])
    assert loaded.network is not None
    assert loaded.network.project == "Cell 7"
    return loaded.network.safety_functions, [
        d for d in loaded.diagnostics if d.span.file == str(path)
    ]


def test_everything_is_read(tmp_path: Path) -> None:
    (function,), found = load(tmp_path, WHOLE)
    assert [d.code for d in found] == ["FSN125"]  # this network has no net
    assert (function.name, function.trigger) == ("estop", "button ES1 is pressed")
    assert (function.required_reaction_ms, function.pl, function.sil) == (150.0, "d", None)
    sensor, entry, actuator = function.elements
    assert (sensor.kind, sensor.name, sensor.time_ms) == (ElementKind.SENSOR, "ES1", 5.0)
    assert (sensor.pfh_per_hour, sensor.source, sensor.manual) == (1e-8, "sheet 3", "2.1")
    assert (entry.sub, entry.name, entry.time_ms, entry.pfh_per_hour) == (
        "el1904",
        "el1904",
        None,
        None,
    )
    assert actuator.name == "actuator"
    assert sensor.span.line == 12
    assert sensor.at("time_ms").column == 44


def test_safe_bits_are_read_in_the_order_of_the_frame(tmp_path: Path) -> None:
    (function,), found = load(tmp_path, WHOLE.replace("{kind: input, sub: el1904}", BITS))
    assert [d.code for d in found] == ["FSN125"]
    rows = [(b.slot, b.bit, b.name) for b in function.elements[1].bits]
    assert rows == [(None, 8, "A"), (None, 9, "B"), (None, 1007, "D"), (1, 0, "C")]
    assert function.elements[1].bits[0].at("bit").column == BITS.index("0x8") + 9
    assert function.elements[0].bits == ()


@pytest.mark.parametrize(
    ("old", "new", "code", "place"),
    [
        ("sub: el1904", "sub: el1904, bits: [{bit: 1008, name: A}]", "FSN113", (13, 49)),
        ("sub: el1904", "sub: el1904, bits: [{bit: -1, name: A}]", "FSN113", (13, 49)),
        ("sub: el1904", "sub: el1904, bits: [{bit: one, name: A}]", "FSN111", (13, 49)),
        ("sub: el1904", 'sub: el1904, bits: [{bit: 1, name: ""}]', "FSN113", (13, 58)),
        ("sub: el1904", "sub: el1904, bits: [{bit: 1}]", "FSN110", (13, 43)),
        ("sub: el1904", "sub: el1904, bits: [{name: A}]", "FSN110", (13, 43)),
        ("sub: el1904", "sub: el1904, bits: [{bit: 1, name: A, slot: x}]", "FSN111", (13, 67)),
        ("sub: el1904", "sub: el1904, bits: {0: A}", "FSN111", (13, 42)),
        ("time_ms: 5", "time_ms: -5", "FSN113", (12, 44)),
        ("time_ms: 5", "time_ms: .nan", "FSN113", (12, 44)),
        ("time_ms: 5", "time_ms: five", "FSN111", (12, 44)),
        ("1.0e-8", "2", "FSN113", (12, 61)),
        ("pl: D", "pl: f", "FSN113", (10, 20)),
        ("pl: D", "sil: 4", "FSN113", (10, 21)),
        ("kind: input", "kind: imput", "FSN116", (13, 16)),
        ("name: estop", "nam: estop", "FSN109", (6, 5)),
        ("sub: el1904", "subdevice: el1904", "FSN109", (13, 23)),
        ("{kind: actuator}", "{name: K1}", "FSN110", (14, 9)),
        ("{kind: actuator}", "actuator", "FSN111", (14, 9)),
    ],
)
def test_a_mistake_is_found_at_its_place(
    tmp_path: Path, old: str, new: str, code: str, place: tuple[int, int]
) -> None:
    assert WHOLE.count(old) == 1
    _, found = load(tmp_path, WHOLE.replace(old, new))
    assert (code, *place) in [(d.code, d.span.line, d.span.column) for d in found], found
