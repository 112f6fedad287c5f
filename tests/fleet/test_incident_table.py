"""Incident files of several machines as one Parquet file."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import duckdb
import pytest
from cli.tool import fsn
from live.support import ROOT
from networks import EXAMPLES

from fsoe_net.fleet.incident_table import COLUMNS
from fsoe_net.fleet.labels import LABEL_CHARS

ESTOP = EXAMPLES / "estop"


@pytest.fixture(scope="module")
def incident(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    scenario = f"--scenario={ESTOP / 'scenario.yaml'}"
    done = fsn("run", str(ESTOP), "--virtual-time", scenario, f"--incidents={folder}")
    assert done.returncode == 0, done.stdout
    (path,) = folder.iterdir()
    return path


@pytest.fixture
def machines(tmp_path, incident) -> Path:
    """Two machines: the second has another incident, and a copy of that of the first."""
    folder = tmp_path / "incidents"
    for name in ("press-1", "press-2"):
        (folder / name / "old").mkdir(parents=True)
    shutil.copy(incident, folder / "press-1" / "a.fsnincident")
    shutil.copy(incident, folder / "press-2" / "copy.fsnincident")
    shutil.copy(changed(incident, folder / "other", utc="2026-11-21T23:59:59.500+01:00"),
                folder / "press-2" / "b.fsnincident")  # fmt: skip
    (folder / "other").unlink()
    (folder / "press-2" / "notes.txt").write_text("not an incident", "utf-8")
    return folder


def changed(incident: Path, path: Path, **values: object) -> Path:
    """Write the incident with other values in its head."""
    head, rest = incident.read_bytes().split(b"\n", 1)
    path.write_bytes(json.dumps(json.loads(head) | values).encode() + b"\n" + rest)
    return path


def collect(folder: Path, *more: str):
    return fsn(
        "log", "incident-table", str(folder), "--parquet", str(folder.parent / "t.parquet"), *more
    )


def rows(folder: Path, columns: str = "*") -> list[tuple]:
    table = str(folder.parent / "t.parquet")
    return duckdb.execute(f"SELECT {columns} FROM '{table}' ORDER BY machine", []).fetchall()


def test_each_incident_is_one_row(machines, incident):
    done = collect(machines)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("t.parquet: 2 incidents, 2 new\n")
    page = json.loads(fsn("log", "incident", str(incident), "--format", "json").stdout)
    names = "machine, file, sha256, kind, connection, reset_by, reset_code, cause, complete"
    first, second = rows(machines, names)
    digest = hashlib.sha256(incident.read_bytes()).hexdigest()
    facts = (page["kind"], page["connection"], page["reset_by"], page["reset_code"])
    assert first == ("press-1", "a.fsnincident", digest, *facts, page["likely"]["key"], True)
    assert second[:2] == ("press-2", "b.fsnincident")
    (_, (moment,)) = rows(machines, "utc")
    assert moment.isoformat() == "2026-11-21T22:59:59.500000"


def test_a_second_run_changes_nothing(machines):
    collect(machines)
    table = machines.parent / "t.parquet"
    before = (table.read_bytes(), table.stat().st_mtime_ns)
    assert collect(machines).stdout.endswith("2 incidents, 0 new\n")
    assert (table.read_bytes(), table.stat().st_mtime_ns) == before


def test_a_new_incident_is_added_and_the_old_ones_stay(machines, incident):
    collect(machines)
    before = set(rows(machines))
    shutil.rmtree(machines / "press-1")
    changed(incident, machines / "press-2" / "old" / "c.fsnincident", interface="eth7")
    assert collect(machines, "--machine", "cell-9").stdout.endswith("3 incidents, 1 new\n")
    assert before < set(rows(machines))
    assert rows(machines, "machine, interface")[0] == ("cell-9", "eth7")


def test_a_missing_file_is_named_once_and_makes_no_table(tmp_path):
    table = tmp_path / "t.parquet"
    done = fsn("log", "incident-table", str(tmp_path / "none"), "--parquet", str(table))
    assert (done.returncode, done.stdout, table.exists()) == (1, "", False)
    assert done.stderr.count("no such file") == 1


def test_a_damaged_file_is_named_and_the_others_are_in_the_table(machines):
    (machines / "press-1" / "x.fsnincident").write_bytes(b"{}\n")
    done = collect(machines)
    assert done.returncode == 1
    assert "press-1/x.fsnincident:1: incident is missing" in done.stderr
    assert len(rows(machines)) == 2


def test_no_table_is_made_of_unreadable_files_alone(tmp_path):
    (tmp_path / "x.fsnincident").write_bytes(b"{}\n")
    for folder in (tmp_path / "x.fsnincident", tmp_path / "missing"):
        assert collect(folder).returncode == 1
        assert not (tmp_path / "t.parquet").exists()


def test_a_folder_without_incidents_is_an_empty_table(tmp_path):
    (tmp_path / "none").mkdir()
    assert collect(tmp_path / "none").returncode == 0
    assert rows(tmp_path / "none") == []


def test_a_cut_off_file_is_marked(machines, incident):
    (machines / "press-1" / "a.fsnincident").write_bytes(incident.read_bytes()[:-200])
    collect(machines)
    assert [row for row in rows(machines, "machine, complete") if not row[1]] == [
        ("press-1", False)
    ]


def test_names_are_bounded_and_printable(machines, incident):
    changed(incident, machines / "press-1" / "a.fsnincident", interface="\x1b[2J" + "x" * 999)
    collect(machines)
    (interface,) = rows(machines, "interface")[0]
    assert len(interface) == LABEL_CHARS
    assert interface.isprintable()
    assert interface.endswith("[2J" + "x" * (LABEL_CHARS - 4))


def test_a_link_in_a_folder_is_not_followed(machines, incident):
    (machines / "press-1" / "a.fsnincident").unlink()
    (machines / "press-1" / "a.fsnincident").symlink_to(incident)
    (machines / "press-2" / "copy.fsnincident").unlink()
    collect(machines)
    assert rows(machines, "machine") == [("press-2",)]


def test_another_file_is_not_replaced(machines):
    table = machines.parent / "t.parquet"
    table.write_bytes(b"something else")
    done = collect(machines)
    assert (done.returncode, table.read_bytes()) == (1, b"something else")
    assert "is not a Parquet file; name another one" in done.stderr
    duckdb.execute(f"COPY (SELECT 1 AS x) TO '{table}' (FORMAT parquet)")
    before = table.read_bytes()
    done = collect(machines)
    assert (done.returncode, table.read_bytes()) == (1, before)
    assert "not a table of incidents" in done.stderr


def test_a_name_with_the_characters_of_a_pattern(machines):
    table = machines.parent / "it's [a]*.parquet"
    for new in (2, 0):
        done = fsn("log", "incident-table", str(machines), "--parquet", str(table))
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.endswith(f"2 incidents, {new} new\n")


def test_the_page_lists_each_column():
    page = (ROOT / "docs/howto/fleet.md").read_text("utf-8")
    assert [name for name in COLUMNS if f"`{name}`" not in page] == []
