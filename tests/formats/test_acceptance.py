"""Acceptance records, written and read back, and what somebody may have done to them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from acceptance.signed import record_of
from hypothesis import given
from hypothesis import strategies as st

from fsoe_net.diag.printable import first_control
from fsoe_net.formats.own.acceptance import is_acceptance, parse_acceptance
from fsoe_net.formats.own.write_acceptance import write_acceptance
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.acceptance import Acceptance, JustifiedFinding
from fsoe_net.model.network import SourceFile
from fsoe_net.model.safety import ElementKind, SafeBit, SafetyElement, SafetyFunction
from fsoe_net.plan.accepted import accepted_plan
from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.fingerprint import fingerprint_of, safety_text

RECORD = record_of()
TEXT = write_acceptance(RECORD)


def read(text: str) -> tuple[Acceptance | None, Collector]:
    out = Collector()
    return parse_acceptance(text.encode("utf-8"), "acceptance.yaml", out), out


def complaints(text: str) -> list[str]:
    """Return what is wrong with a record, place and code, its plan looked at too."""
    record, out = read(text)
    if record is not None:
        held = accepted_plan(record, out)
        assert (held is None) == bool(out.diagnostics)
    return [f"{d.span} {d.code}" for d in out.diagnostics]


@pytest.mark.parametrize("key", ["author", "fingerprint", "plan"])
def test_a_key_that_is_given_twice_is_refused(key: str) -> None:
    """The first one would count, and a person reads the other."""
    assert f"\n{key}:" in TEXT
    record, out = read(f"{key}: other\n{TEXT}")
    assert record is None
    assert "FSN106" in {d.code for d in out.diagnostics}


def test_a_record_is_read_back_as_it_was() -> None:
    record, out = read(TEXT)
    assert out.diagnostics == []
    assert record == RECORD
    held = accepted_plan(record, out)
    assert held is not None
    assert held[0] == decode_plan(RECORD.plan)
    assert held[1] == fingerprint_of(held[0])
    assert is_acceptance(TEXT.encode())
    assert not is_acceptance(b"version: 1\nname: acceptance_record\n")


def test_lines_are_short_and_pure_ascii_is_not_asked_for() -> None:
    row = JustifiedFinding(code="FSN607", place="a:1:1", message="m", reason="Prüfung", by="Ö. Ü")
    text = write_acceptance(replace(RECORD, findings=(row,)))
    assert "Prüfung" in text
    assert max(map(len, text.splitlines())) <= 110
    again, _ = read(text)
    assert again is not None
    assert again.findings == (row,)


_WORDS = (
    st.text(st.characters(exclude_categories=("Cs", "Cc")), min_size=1, max_size=30)
    .map(str.strip)
    .filter(lambda text: text and not first_control(text))  # what is refused in any file
)
_NUMBERS = st.none() | st.floats(0, 1000, allow_subnormal=False)


@st.composite
def _functions(draw: st.DrawFn) -> SafetyFunction:
    kinds = draw(st.lists(st.sampled_from(ElementKind), min_size=1, max_size=4))
    return SafetyFunction(
        name=draw(_WORDS),
        trigger=draw(st.just("") | _WORDS),
        reaction=draw(st.just("") | _WORDS),
        reset=draw(st.just("") | _WORDS),
        modes=draw(st.just("") | _WORDS),
        required_reaction_ms=draw(st.none() | st.floats(0.5, 1000)),
        pl=draw(st.sampled_from(("", "a", "e"))),
        sil=draw(st.none() | st.integers(1, 3)),
        elements=tuple(
            SafetyElement(
                kind=kind,
                sub=draw(st.just("") | _WORDS),
                name=draw(_WORDS),
                time_ms=draw(_NUMBERS),
                pfh_per_hour=draw(st.none() | st.floats(0, 1, allow_subnormal=False)),
                zero_because=draw(st.just("") | _WORDS),
                pl=draw(st.sampled_from(("", "a", "e"))),
                sil=draw(st.none() | st.integers(1, 3)),
                category=draw(st.sampled_from(("", "B", "1", "4"))),
                mission_years=draw(st.none() | st.floats(0.5, 100)),
                source=draw(st.just("") | _WORDS),
                manual=draw(st.just("") | _WORDS),
                bits=tuple(
                    SafeBit(slot=slot, bit=bit, name=draw(_WORDS))
                    for slot in (None, 0, 65535)
                    for bit in sorted(draw(st.sets(st.integers(0, 1007), max_size=2)))
                ),
            )
            for kind in kinds
        ),
    )


@given(st.lists(_functions(), max_size=3, unique_by=lambda f: f.name))
@pytest.mark.uncounted
def test_safety_functions_keep_every_character(functions: list[SafetyFunction]) -> None:
    record, out = read(write_acceptance(replace(RECORD, safety_functions=tuple(functions))))
    assert out.diagnostics == []
    assert record is not None
    assert safety_text(record.safety_functions) == safety_text(functions)


@given(st.lists(_WORDS, max_size=3), st.just("") | _WORDS, st.lists(_WORDS, max_size=3))
@pytest.mark.uncounted
def test_circumstances_keep_every_character(
    equipment: list[str], environment: str, names: list[str]
) -> None:
    files = tuple(SourceFile(path=name, sha256="ab" * 32) for name in names)
    record = replace(RECORD, equipment=tuple(equipment), environment=environment, attachments=files)
    again, out = read(write_acceptance(record))
    assert out.diagnostics == []
    assert again == record


@pytest.mark.parametrize("path", ['""', '"a\\0b"'])
def test_an_attachment_without_a_path_is_found(path: str) -> None:
    files = (SourceFile(path="photo.jpg", sha256="ab" * 32),)
    text = write_acceptance(replace(RECORD, attachments=files))
    record, out = read(text.replace("file: photo.jpg", f"file: {path}"))
    assert record is None
    assert {d.code for d in out.diagnostics} <= {"FSN162", "FSN102"}


def _line(word: str) -> int:
    return next(n for n, line in enumerate(TEXT.splitlines(), 1) if line.startswith(word))


@pytest.mark.shows("R14")
@pytest.mark.parametrize(
    ("find", "put", "at"),
    [
        (RECORD.whole, "ab" * 32, "fingerprint"),
        (f"fingerprint: {RECORD.whole}", "fingerprint: abc", "fingerprint"),
        (RECORD.sections["copies"], "cd" * 32, "  copies"),
        ("time_ms: 20", "time_ms: 2", "- name: estop"),
        ("plan: |\n  eN", "plan: |\n  e-", "plan"),
        ("plan: |\n", "plan: |\n  AAAA\n", "plan"),
        ("date: '2026-11-21'", "date: yesterday", "  date"),
        ("name: A. Meier", "name: ''", "  name"),
    ],
)
def test_changes_are_found(find: str, put: str, at: str) -> None:
    assert TEXT.count(find) >= 1
    (found,) = complaints(TEXT.replace(find, put, 1))
    place, code = found.rsplit(" ", 1)
    assert code == "FSN162"
    line = _line(at) if at != "  copies" else _line("sections") + 1
    assert int(place.split(":")[1]) in (line, line + 1)


def test_a_plan_that_ends_early_is_none() -> None:
    cut = TEXT.rstrip("\n").rsplit("\n", 3)[0] + "\n"
    assert [row.rsplit(" ", 1)[1] for row in complaints(cut)] == ["FSN162"]


def test_one_person_in_two_roles_is_found() -> None:
    text = TEXT.replace("name: B. Kaya", "name: a.meier", 1)
    assert complaints(text) == [f"acceptance.yaml:{_line('verifier') + 1}:3 FSN163"]


@pytest.mark.parametrize("key", ["plan", "fingerprint", "author", "sections", "test_record"])
def test_a_key_that_is_missing_is_named(key: str) -> None:
    lines = TEXT.splitlines(keepends=True)
    start = _line(f"{key}:") - 1
    end = start + 1
    while end < len(lines) and lines[end][0] in " -":
        end += 1
    (found,) = complaints("".join(lines[:start] + lines[end:]))
    assert found.endswith("FSN110")


def test_a_small_file_does_not_unpack_to_a_large_one() -> None:
    text = write_acceptance(replace(RECORD, plan=bytes(64 * 1024 * 1024 + 1)))
    assert len(text) < 200_000
    record, out = read(text)
    assert record is None
    assert "64 MiB" in out.diagnostics[0].message


@given(st.binary(max_size=200), st.integers(0, len(TEXT)))
def test_damage_is_a_finding_never_an_exception(damage: bytes, at: int) -> None:
    data = TEXT.encode()
    out = Collector()
    record = parse_acceptance(data[:at] + damage + data[at + len(damage) :], "a.yaml", out)
    if record is None:
        assert out.diagnostics
    else:
        accepted_plan(record, out)


def test_a_record_of_form_1_is_refused_by_name() -> None:
    record, out = read(TEXT.replace("acceptance_record: 2", "acceptance_record: 1"))
    assert record is None
    (found,) = out.diagnostics
    assert (found.code, str(found.span)) == ("FSN162", "acceptance.yaml:5:20")
    assert found.message.startswith("a record of fingerprint form 1, which left out")
    assert found.hint == "compare the report with the one that was signed, and accept again"


def test_the_record_of_the_cases_is_a_whole_one() -> None:
    path = Path(__file__).parents[1] / "diagnostics" / "base" / "acceptance.yaml"
    record, out = read(path.read_text("utf-8"))
    assert record is not None
    assert accepted_plan(record, out) is not None, "written by an older plan format: write it anew"
