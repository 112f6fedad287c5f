"""Hostile files: one clear located finding each, never an exception, never unbounded work."""

from __future__ import annotations

import difflib
import os
import random
import resource
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.shared import yaml_events
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.yaml_tree import parse_yaml
from fsoe_net.project.check import check_files

BASE = Path(__file__).parents[1] / "diagnostics" / "base"


def codes(data: bytes, tmp_path: Path, name: str = "hostile.yaml") -> list[str]:
    path = tmp_path / name
    path.write_bytes(data)
    return [d.code for d in check_files([str(path)]).diagnostics]


HOSTILE = {
    "ten megabytes of brackets": (b"[" * 10_000_000, "FSN103"),
    "ten megabytes of braces": (b"{" * 10_000_000, "FSN103"),
    "deep block lists": (b"- " * 100_000, "FSN103"),
    "deep indentation": (b"".join(b" " * n + b"a:\n" for n in range(300)), "FSN103"),
    "NUL": (b"nets:\x00 []\n", "FSN102"),
    "control character": (b"nets: \x07\n", "FSN102"),
    "UTF-16": ("nets: []\n".encode("utf-16"), "FSN102"),
    "broken UTF-8": (b"nets: \xff\xfe\xfd\n", "FSN102"),
    "unclosed quote": (b'nets: "\n', "FSN102"),
    "tab indentation": (b"nets:\n\t- name: a\n", "FSN102"),
    "unknown alias": (b"nets: *nothing\n", "FSN102"),
    "alias of itself": (b"nets: &a [*a]\n", "FSN103"),
    "list as key": (b"? [a]\n: 1\n", "FSN111"),
    "two documents": (b"nets: []\n---\nnets: []\n", "FSN105"),
    "empty": (b"", "FSN104"),
    "only a comment": (b"# nothing\n", "FSN104"),
    "a list": (b"- nets\n", "FSN104"),
    "a word": (b"nets\n", "FSN104"),
    "a custom tag": (b"!!python/object:os.system nets\n", "FSN104"),
    "a number of a million digits": (
        b"nets: [{name: a, size: " + b"9" * 1_000_000 + b"}]",
        "FSN109",
    ),
}


@pytest.mark.shows("R7")
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_yaml_is_refused_with_one_code(name: str, tmp_path: Path):
    data, code = HOSTILE[name]
    found = codes(data, tmp_path)
    assert code in found or (name.startswith("a number") and found), found


@pytest.mark.uncounted
def test_many_values_are_not_bomb(monkeypatch: pytest.MonkeyPatch):
    data = b"nets: [" + b"1," * 1_100_000 + b"]\n"
    out = Collector()
    assert parse_yaml(data, "long.yaml", out) is not None
    assert not out.diagnostics
    monkeypatch.setattr(yaml_events, "MAX_PARTS", 1_000_000)
    assert parse_yaml(data, "long.yaml", out) is None
    assert [(d.code, d.span.line) for d in out.diagnostics] == [("FSN103", 1)]


def test_alias_bomb_is_cheap():
    levels = "\n".join(f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 12))
    out = Collector()
    assert parse_yaml(f"a0: &a0 [x]\n{levels}\n".encode(), "bomb.yaml", out) is None
    assert [d.code for d in out.diagnostics] == ["FSN103"]


def test_bom_is_only_a_note(tmp_path: Path):
    data = b"\xef\xbb\xbf" + (BASE / "transfers.yaml").read_bytes()
    found = codes(data, tmp_path)
    assert "FSN108" in found
    assert not {"FSN104", "FSN102", "FSN117"} & set(found)


def test_files_that_cannot_be_read(tmp_path: Path):
    for path in (tmp_path, tmp_path / "missing.yaml", Path("/dev/null"), Path("a\0b")):
        result = load_network([str(path)])
        assert [d.code for d in result.diagnostics] == ["FSN101"], path
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    assert [d.code for d in load_network([str(fifo)]).diagnostics] == ["FSN101"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_unreadable_file_is_reported(tmp_path: Path):
    path = tmp_path / "secret.yaml"
    path.write_text("nets: []", "utf-8")
    path.chmod(0)
    assert [d.code for d in load_network([str(path)]).diagnostics] == ["FSN101"]


def test_a_huge_file_is_not_read(tmp_path: Path):
    path = tmp_path / "huge.yaml"
    with path.open("wb") as file:
        file.truncate(10**10)  # sparse
    assert [d.code for d in load_network([str(path)]).diagnostics] == ["FSN101"]


def _many(row: str) -> Callable[[int], str]:
    return lambda count: "".join(row.replace("N", str(n)) for n in range(count))


ESTOP = (BASE.parents[2] / "examples" / "estop" / "network.yaml").read_text("utf-8")
MANY = {
    "unknown keys": _many("kN: N\n"),
    "unknown keys of a network": lambda n: ESTOP + _many("kN: N\n")(n),
    "keys twice": lambda n: ESTOP + _many("kN: N\nkN: N\n")(n),
    "transfers": lambda n: "nets:\n- name: a\n  transfers:\n" + _many("  - kN: N\n")(n),
    "SubDevices": lambda n: "subdevices:\n" + _many("- kN: N\n")(n),
    "numbers for SubDevices": lambda n: "subdevices:\n" + _many("- N\n")(n),
    "PDOs": lambda n: "vendor_id: 1\nrpdo:\n" + _many("- kN: N\n")(n),
    "channels": lambda n: (
        "vendor_id: 1\nproduct_id: 2\nrpdo:\n- index: 0x1600\n  channels:\n"
        + _many("  - {index: 0x7000, sub_index: 1, type: uN}\n")(n)
    ),
}


@pytest.mark.parametrize("name", MANY)
def test_twice_the_file_is_at_most_twice_the_work(name: str, tmp_path: Path):
    def calls(rows: int) -> int:
        path = tmp_path / "many.yaml"
        path.write_text(MANY[name](rows))
        count = 0

        def counted(frame: object, event: str, argument: object) -> None:
            nonlocal count
            count += event in ("call", "c_call")

        before = sys.getprofile()
        sys.setprofile(counted)
        try:
            check_files([str(path)])
        finally:
            sys.setprofile(before)
        return count

    calls(10)  # what is read once: schemas, patterns
    assert calls(1600) < 2.1 * calls(800)


def test_very_many_unknown_keys_are_refused_with_few_guesses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    guesses: list[str] = []
    guess = difflib.get_close_matches

    def counted(word: str, *arguments: object, **options: object) -> list[str]:
        guesses.append(word)
        return guess(word, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(difflib, "get_close_matches", counted)
    path = tmp_path / "many.yaml"
    path.write_text(ESTOP + MANY["unknown keys"](5000))
    first = len(ESTOP.splitlines()) + 1
    found = check_files([str(path)]).diagnostics
    assert {d.code for d in found} == {"FSN109"}
    assert [(d.span.line, d.message) for d in found if d.severity is Severity.ERROR] == [
        (first + 100, "more than 100 unknown keys; the file is not read on")
    ]
    assert len(found) == 101
    assert len(guesses) == 100
    guesses.clear()
    path.write_text(MANY["unknown keys"](5000))
    assert [d.code for d in check_files([str(path)]).diagnostics] == ["FSN117"]
    assert len(guesses) == 100


@pytest.mark.shows("R7")
@pytest.mark.uncounted
@pytest.mark.weekly
def test_memory_stays_bounded(tmp_path: Path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    codes(b"[" + b"[]," * 5_000_000 + b"]", tmp_path)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert after - before < 700_000  # KiB; a million nodes and the text


@pytest.mark.shows("R7")
@given(st.binary(max_size=400))
@settings(max_examples=examples(300), deadline=None)
def test_random_bytes_never_raise(data: bytes):
    out = Collector()
    root = parse_yaml(data, "random.yaml", out)
    assert root is not None or out.diagnostics


@pytest.mark.shows("R7")
@pytest.mark.parametrize("seed", range(60))
def test_mutated_files_never_raise(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    rng = random.Random(seed)
    for file in BASE.rglob("*"):
        if file.is_file():
            target = tmp_path / file.relative_to(BASE)
            target.parent.mkdir(exist_ok=True)
            data = bytearray(file.read_bytes())
            for _ in range(rng.choice((0, 1, 3))):
                at = rng.randrange(len(data))
                action = rng.randrange(3)
                if action == 0:
                    data[at] = rng.randrange(256)
                elif action == 1:
                    del data[at : at + rng.randrange(40)]
                else:
                    data[at:at] = bytes(rng.choice(b" :[]{}-,&*#\n\t0x'\"") for _ in range(3))
            target.write_bytes(bytes(data))
    monkeypatch.chdir(tmp_path)
    for files in (["network.yaml"], ["robot.urdf"], ["transfers.yaml"]):
        for found in check_files(files).diagnostics:
            assert found.span.file
            assert found.message
