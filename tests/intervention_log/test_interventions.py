"""The chain of an intervention log: whatever is done to it is found, and nothing else is."""

from __future__ import annotations

import hashlib
import io
import json
import random

import pytest
from intervention_log.intervention_logs import Log, a_log, chained, hash_of

from fsoe_net.intervention_log.chain import LogChain, LogCheck, LogFilter, log_lines, utc_of


def walk(log: Log, *, after: str = "", last: str = "") -> LogCheck:
    chain = LogChain(after=after, last=last)
    for n, lines in enumerate(log, 1):
        file = chain.begin(f"{n}")
        for line in log_lines(io.BytesIO(b"".join(lines))):
            file.size_bytes += line.size_bytes
            chain.take(line)
    return chain.end()


def findings(log: Log, **hashes: str) -> list[str]:
    return [f"{f.file}:{f.line}: {f.text}" for f in walk(log, **hashes).findings]


@pytest.mark.shows("R29")
def test_a_chain_over_files_holds() -> None:
    log = a_log(4, 3, 5)
    check = walk(log)
    assert check.holds
    assert check.remarks == ()
    assert (check.entries, check.first, check.since_last) == (12, 1, None)
    assert check.last is not None
    assert (check.last.number, check.last.sha256) == (12, hash_of(log[2][4]))
    assert [(f.first, f.last) for f in check.files] == [(1, 4), (5, 7), (8, 12)]
    assert check.files[0].size_bytes == sum(map(len, log[0]))
    assert (check.last.utc, check.last.text) == ("2026-11-23T16:52:12.111178Z", "what happened 12")


@pytest.mark.shows("R29")
def test_every_changed_byte_is_found() -> None:
    log = a_log(3, 3)
    last = hash_of(log[1][2])
    for f, lines in enumerate(log):
        for n, line in enumerate(lines):
            for at in range(len(line)):
                changed = bytearray(line)
                changed[at] ^= 1
                broken = [list(rows) for rows in log]
                broken[f][n] = bytes(changed)
                is_end = (f, n) == (1, 2)
                assert not walk(broken, last=last).holds, (f, n, at)
                if not is_end:
                    assert not walk(broken).holds, (f, n, at)
                broken[f][n] = line[:at] + line[at + 1 :]
                assert not walk(broken, last=last).holds, (f, n, at)


@pytest.mark.shows("R29")
@pytest.mark.parametrize("seed", range(5))
def test_any_change_of_lines_is_found(seed: int) -> None:
    """Removed, doubled, exchanged, shuffled, cut: with the last hash, nothing passes."""
    chance = random.Random(seed)
    log = a_log(4, 4, 4)
    rows = [(f, line) for f, lines in enumerate(log) for line in lines]
    last = hash_of(log[2][3])
    for _ in range(60):
        changed = list(rows)
        for _ in range(chance.randint(1, 3)):
            a, b = chance.randrange(len(changed)), chance.randrange(len(changed))
            match chance.randrange(4):
                case 0:
                    del changed[a]
                case 1:
                    changed.insert(a, changed[b])
                case 2:
                    changed[a], changed[b] = changed[b], changed[a]
                case _:
                    del changed[a:]
            if not changed:
                break
        if [line for _, line in changed] == [line for _, line in rows]:
            continue
        broken: Log = [[line for f, line in changed if f == n] for n in range(3)]
        if [line for lines in broken for line in lines] == [line for _, line in rows]:
            continue
        assert not walk(broken, last=last).holds, changed


@pytest.mark.shows("R29")
def test_removed_entries_are_named() -> None:
    log = a_log(4, 4)
    del log[0][2:]
    assert findings(log) == ["2:1: entries 3 to 4 are missing before entry 5"]
    log = a_log(4)
    del log[0][1]
    assert findings(log) == ["1:2: entry 2 is missing before entry 3"]
    log = a_log(4, 4)
    assert findings(log[1:]) == [
        "1:1: entries 1 to 4 are missing: name the files before, or their last SHA-256 with --after"
    ]
    assert findings(log[1:], after=hash_of(log[0][3])) == []
    assert findings(log[1:], after="0" * 64) == ["1:1: entry 5 does not follow --after"]
    assert findings([[], []]) == [
        "2:0: no entry: not an intervention log, or all entries were removed"
    ]


def test_changed_moved_or_added_files_are_named() -> None:
    log = a_log(5)
    log[0][2] = log[0][2].replace(b"what", b"WHAT")
    assert findings(log) == [
        "1:4: entry 3 was changed, or entry 4 is not the one that was written after it: its "
        "SHA-256 does not match"
    ]
    log = a_log(2, 2, 2)
    assert findings([log[0], log[2], log[1]]) == [
        "2:1: entries 3 to 4 are missing before entry 5",
        "3:1: entry 3 comes after entry 6: lines were moved, repeated or put in",
    ]
    log = a_log(3)
    log[0].insert(1, b"hello\n")
    assert findings(log) == [
        "1:2: a line is not an entry, and no entry explains it: inserted, or changed"
    ]
    assert findings([*a_log(3), *a_log(2)]) == ["2:1: another log begins here, after entry 3"]
    forged = a_log(3)
    forged[0][0] = chained(forged[0][0], number=1)
    assert findings(forged)[0] == "1:1: entry 1 holds the hash of an entry before it"


@pytest.mark.shows("R29")
def test_a_cut_end_shows_with_the_last_hash_only() -> None:
    log = a_log(6)
    kept = hash_of(log[0][3])
    assert walk(log, last=kept).since_last == 2
    log[0] = log[0][:4]
    assert walk(log, last=kept).since_last == 0
    del log[0][3]
    assert findings(log) == []
    assert findings(log, last=kept) == [
        f"1:3: no entry has the SHA-256 {kept}: the end was cut off, or entries up to there were "
        "rewritten"
    ]


def torn(log: Log, rest: bytes, **changed: object) -> Log:
    """Return a log with a line that was not written whole, and its entry."""
    line = log[-1][-1]
    whole = rest + b" torn\n"
    row = {"event": "torn", "bytes": len(whole), "sha256": hashlib.sha256(whole).hexdigest()}
    entry = chained(line, **row | changed)
    return [*log[:-1], [*log[-1], whole, entry, chained(entry)]]


@pytest.mark.shows("R29")
def test_a_torn_line_that_an_entry_reports_is_not_a_finding() -> None:
    log = torn(a_log(3), b'{"number":4,"ev')
    assert walk(log).holds
    assert walk(log).remarks == ("1 entry was not written whole",)
    changed = [[*log[0][:3], log[0][3].replace(b'"ev', b'"EV'), *log[0][4:]]]
    assert "1:4: bytes of an entry that is not whole were changed" in findings(changed)
    assert findings([log[0][:3] + log[0][4:]]) == [
        "1:4: the bytes that this entry names were removed"
    ]
    # An entry that lost its newline only is torn as well, however whole it looks.
    log = a_log(3)
    whole = log[0].pop()
    assert walk(torn(log, whole.rstrip(b"\n"))).holds


def test_the_first_line_of_a_file_may_be_torn() -> None:
    log = a_log(3)
    rest = b'{"num torn\n'
    begin = chained(log[0][-1], event="file")
    row = {"event": "torn", "sha256": hashlib.sha256(rest).hexdigest()}
    assert walk([log[0], [rest, begin, chained(begin, **row)]]).holds


@pytest.mark.parametrize("rest", [b'{"number":4,"e', b'{"number":4,"e torn\n'])
def test_a_line_that_is_being_written_is_a_remark_at_most(rest: bytes) -> None:
    log = a_log(3)
    log[0].append(rest)
    check = walk(log)
    assert check.holds
    said = (
        "1:4: the last line is incomplete: it is being written, or the program was stopped in the "
        "middle of it; the next start marks it",
    )
    assert check.remarks == (() if rest.endswith(b"\n") else said)


def test_remarks_on_what_the_program_states_about_its_log() -> None:
    log = a_log(3)
    for event in ("unfinished", "entries_lost", "unfinished"):
        log[0].append(chained(log[0][-1], event=event))
    log[0].append(chained(log[0][-1], utc="2026-11-23T16:00:00.000000Z"))
    log[0].append(chained(log[0][-1], utc="no time"))
    assert walk(log).holds
    assert walk(log).remarks == (
        "2 runs have no stop",
        "entries were lost once",
        "times go back by more than 1 s: 1 (the clock was set)",
    )


def test_a_newer_form_is_a_remark() -> None:
    log = a_log(2)
    entries = [chained(log[0][-1], event="file", log=version) for version in (1, 2)]
    assert walk([*log, [entries[0]]]).remarks == ()
    assert walk([*log, [entries[1]]]).remarks == (
        "a file has a newer form than this version reads: entries may contain more",
    )


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"\0\xff\xfe",
        b"[" * 100_000,
        b'{"number":4,"event":"x","previous":null,"a":' + b"[" * 500 + b"]" * 500 + b"}",
        b'{"number":' + b"9" * 5000 + b',"event":"x","previous":null}',
        b'{"number":99999999999999999999,"event":"x","previous":null}',
        b'{"number":true,"event":"x","previous":null}',
        b'{"number":0,"event":"x","previous":null}',
        b'{"number":4.0,"event":"x","previous":null}',
        b'{"number":NaN,"event":"x","previous":null}',
        b'{"number":4,"event":"x","previous":null,"a":1e999}',
        b'{"number":4,"event":7,"previous":null}',
        b'{"number":4,"event":"x","previous":"12"}',
        b'{"number":4,"event":"x"}',
        b'{"number":4,"number":4,"event":"x","previous":null}',
        b"x" * (5 << 20),
    ],
)
def test_a_hostile_line_is_not_an_entry(line: bytes) -> None:
    log = a_log(3, 2)
    log[0].append(line + b"\n")
    check = walk(log)
    assert [(f.file, f.line) for f in check.findings] == [("1", 4)]
    assert check.entries == 5
    assert check.files[0].size_bytes == sum(map(len, log[0]))


def test_a_line_of_many_pieces_has_one_hash() -> None:
    data = b"y" * ((3 << 20) + 5)
    (line,) = log_lines(io.BytesIO(data + b"\n"))
    assert (line.data, line.size_bytes, line.ends) == (None, len(data) + 1, True)
    assert line.sha256 == hashlib.sha256(data).hexdigest()
    (line,) = log_lines(io.BytesIO(data))
    assert (line.size_bytes, line.ends) == (len(data), False)


def test_findings_are_bounded() -> None:
    log = [[json.dumps({"number": 7, "event": "x", "previous": None}).encode() + b"\n"] * 200]
    check = walk(log)
    assert (len(check.findings), check.more) == (50, 150)


def test_texts_are_fit_to_print() -> None:
    log = a_log(1)
    hostile = {"event": "\x1b[2J", "text": "a\nb\u202e\ud800", "user": "\x07", "pid": 1 << 70}
    log[0].append(chained(log[0][0], **hostile))
    last = walk(log).last
    assert last is not None
    shown = last.event + last.text + last.who
    assert shown.isprintable()
    assert "7" not in last.who


@pytest.mark.parametrize(
    "text", ["", "2026", "2026-13-01T00:00:00Z", "2026-01-01T00:00:00", "x" * 99]
)
def test_an_invalid_time_is_none(text: str) -> None:
    assert utc_of(text) is None


@pytest.mark.parametrize(
    ("row", "who"),
    [
        ({}, ""),
        ({"user": "anna", "uid": 1000, "program": "fsoe-net", "pid": 7}, "anna, fsoe-net 7"),
        ({"user": None, "uid": 1000, "program": None, "pid": 7}, "uid 1000, 7"),
        ({"uid": 0, "pid": 0}, "uid 0, 0"),
        ({"uid": (1 << 32) - 1, "pid": (1 << 32) - 1}, "uid 4294967295, 4294967295"),
        ({"uid": 1 << 32, "pid": -1, "program": "x"}, "x"),
        ({"uid": True, "pid": "7", "user": 5}, ""),
    ],
)
def test_user_and_process_of_a_client(row: dict[str, object], who: str) -> None:
    log = a_log(1)
    log[0].append(chained(log[0][0], **row))
    last = walk(log).last
    assert last is not None
    assert last.who == who


@pytest.mark.parametrize(
    ("wanted", "numbers"),
    [
        (LogFilter(), [1, 2, 3, 4, 5]),
        (LogFilter(since=utc_of("2026-11-23T16:52:02.111178Z")), [2, 3, 4]),
        (LogFilter(until=utc_of("2026-11-23T16:52:02.111178Z")), [1]),
        (LogFilter(events=("file", "state")), [1, 3, 5]),
        (LogFilter(who="fsoe-net"), [2, 4]),
        (LogFilter(who="anna", until=utc_of("2026-11-23T16:52:04Z")), [2]),
    ],
)
def test_entries_that_fit(wanted: LogFilter, numbers: list[int]) -> None:
    """The last one has no time: it fits no time."""
    log = a_log(4)
    log[0].append(chained(log[0][3], utc="soon"))
    chain = LogChain()
    chain.begin("x")
    entries = [chain.take(line) for line in log_lines(io.BytesIO(b"".join(log[0])))]
    assert [e.number for e in entries if e is not None and wanted.fits(e)] == numbers
