"""The queries of `examples/fleet/queries.sql` over a million generated incidents."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections import Counter, defaultdict
from datetime import timedelta
from itertools import pairwise
from pathlib import Path

import duckdb
import pytest
from fleet.rig import FLEET

from fsoe_net.fleet.incident_table import COLUMNS

ROWS = 1_000_000
# Connections with a high number are more frequent; all else is evenly spread by hashes.
_MADE = f"""
SELECT
    sha256(i::VARCHAR) AS sha256, 'press-' || (h1 % 40) AS machine, i || '.fsnincident' AS file,
    TIMESTAMP '2026-01-01' + to_milliseconds(h2 % 31536000000) AS utc,
    ['left_data', 'left_data', 'not_connected', 'request'][1 + h3 % 4] AS kind,
    'c' || (sqrt(h4 % 400)::INT) AS connection, 'logic' AS main, 'drive' AS sub,
    ['main', 'sub', ''][1 + h5 % 3] AS reset_by,
    CASE WHEN h5 % 3 < 2 THEN h6 % 12 END AS reset_code,
    CASE WHEN h5 % 3 < 2 THEN 'code' || h6 % 12 ELSE '' END AS reset_cause,
    ['', 'plug', 'crc', 'watchdog', 'supply'][1 + h7 % 5] AS cause,
    CASE WHEN h7 % 5 > 0 THEN 50 + h7 % 50 END AS cause_score, 'eth0' AS interface,
    sha256((h8 % 9)::VARCHAR) AS plan_sha256, 1000000 AS cycle_ns, h9 % 7 AS incomplete_cycles,
    CASE WHEN h8 % 9 > 2 THEN h9 % 3 ELSE 0 END AS lost_frames, 0 AS late_cycles, TRUE AS complete
FROM (SELECT i, {", ".join(f"(hash(i * 16 + {n}) >> 8)::BIGINT AS h{n}" for n in range(1, 10))}
      FROM range({ROWS}) made(i))
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A table of incidents, with the columns of the command."""
    path = tmp_path_factory.mktemp("queries") / "incidents.parquet"
    types = ", ".join(f"{name}::{kind} AS {name}" for name, kind in COLUMNS.items())
    duckdb.execute(f"COPY (SELECT {types} FROM ({_MADE})) TO '{path}' (FORMAT parquet)")
    return path


def queries() -> list[str]:
    text = re.sub(r"(?m)^--.*$", "", (FLEET / "queries.sql").read_text("utf-8"))
    return [query.strip() for query in text.split(";") if query.strip()]


@pytest.fixture(scope="module")
def answers(made) -> list[list[tuple]]:
    duckdb.execute(f"CREATE OR REPLACE VIEW incidents AS FROM '{made}'")
    return [duckdb.execute(query).fetchall() for query in queries()]


@pytest.fixture(scope="module")
def losses(made) -> list[tuple]:
    """Machine, connection and time of each lost connection, counted again in Python."""
    names = "machine, connection, utc"
    return duckdb.execute(f"SELECT {names} FROM '{made}' WHERE kind = 'left_data'").fetchall()


def test_the_worst_connection_of_each_machine_and_shift(answers, losses):
    shifts = ["night"] * 6 + ["early"] * 8 + ["late"] * 8 + ["night"] * 2
    counts: dict[tuple, Counter] = defaultdict(Counter)
    for machine, connection, utc in losses:
        counts[machine, shifts[utc.hour]][connection] += 1
    worst = {
        place: min(c.items(), key=lambda row: (-row[1], row[0])) for place, c in counts.items()
    }
    assert answers[0] == [(*place, *worst[place]) for place in sorted(worst)]
    assert len(answers[0]) == 40 * 3


def test_incidents_that_repeat_within_ten_minutes(answers, losses):
    times = defaultdict(list)
    for machine, connection, utc in losses:
        times[machine, connection].append(utc)
    repeats = Counter()
    for place, moments in times.items():
        near = sum(b - a <= timedelta(minutes=10) for a, b in pairwise(sorted(moments)))
        repeats[place] = near
    expected = [(*place, n) for place, n in repeats.items() if n]
    assert answers[3] == sorted(expected, key=lambda row: (-row[2], row[0], row[1]))
    assert expected


def test_causes_resets_and_plans(answers, made):
    names = "cause, machine, reset_by, reset_code, plan_sha256, lost_frames"
    rows = duckdb.execute(f"SELECT {names} FROM '{made}'").fetchall()
    causes = Counter(row[0] for row in rows if row[0])
    assert {row[0]: row[1] for row in answers[1]} == causes
    assert {row[2] for row in answers[1]} == {40}
    resets = Counter((row[2], f"code{row[3]}") for row in rows if row[3] is not None)
    assert {row[:2]: row[2] for row in answers[2]} == resets
    lost = Counter()
    for row in rows:
        lost[row[4]] += row[5]
    assert {row[0]: row[2] for row in answers[4]} == {plan: n for plan, n in lost.items() if n}
    assert len(answers[4]) == 6


def _postgres_program(name: str) -> str:
    places = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    found = shutil.which(name) or (str(places[-1]) if places else None)
    if found is None or shutil.which("setpriv") is None:
        pytest.skip(f"{name} is not installed: apt install postgresql")
    return found


def test_postgresql_answers_the_same(answers, made, tmp_path):
    if os.getuid() == 0 and "postgres:" not in Path("/etc/passwd").read_text("utf-8"):
        pytest.skip("PostgreSQL refuses to run as root, and its user is missing")
    initdb, server, psql = map(_postgres_program, ("initdb", "pg_ctl", "psql"))
    rows = tmp_path / "rows.csv"
    duckdb.execute(f"COPY (FROM '{made}') TO '{rows}' (FORMAT csv, HEADER FALSE, NULL '\\N')")
    columns = ", ".join(f"{name} {kind}" for name, kind in COLUMNS.items())
    script = f"CREATE TABLE incidents ({columns});\n"
    script += f"\\copy incidents FROM '{rows}' (FORMAT csv, NULL '\\N')\n"
    script += ";\n\\echo ==\n".join([*queries(), ""])
    folder = Path(tempfile.mkdtemp(prefix="fsn-"))  # the path of a socket must be short
    as_user = []
    if os.getuid() == 0:
        shutil.chown(folder, "postgres")
        as_user = ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"]

    def run(*words: object, text: str = "") -> str:
        done = subprocess.run(
            [*as_user, *map(str, words)],
            input=text,
            capture_output=True,
            text=True,
            check=False,
            cwd=folder,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    try:
        data, options = folder / "data", f"-k {folder} -c listen_addresses= -c fsync=off"
        run(initdb, "-D", data, "-U", "fsn", "--auth=trust", "--encoding=UTF8", "--locale=C")
        run(server, "-D", data, "-o", options, "-l", folder / "log", "-w", "start")
        try:
            # psql as the user of this test reads the rows; the server need not.
            done = subprocess.run(
                [psql, "-h", str(folder), "-U", "fsn", "-d", "postgres", "-qtA", "-F,"],
                input=script,
                capture_output=True,
                text=True,
                check=False,
            )
        finally:
            run(server, "-D", data, "-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder)
    assert done.stderr == ""
    printed = [part.strip().splitlines() for part in done.stdout.split("==\n")]
    expected = [[",".join(map(str, row)) for row in answer] for answer in answers]
    assert [part for part in printed if part] == expected
