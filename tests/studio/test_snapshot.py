"""One page of a network, without scripts, that opens from the disk."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from networks import EXAMPLES

from fsoe_net.cli.main import cli
from fsoe_net.document.write_html import document_html
from fsoe_net.project.check import check_files
from fsoe_net.project.snapshot import snapshot


def _page(path: Path) -> str:
    return document_html(snapshot(check_files([str(path)], compared=True), path.name))


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    shutil.copytree(EXAMPLES / "el6910", tmp_path / "cell")
    return tmp_path / "cell" / "network.yaml"


def test_it_shows_bus_slots_connections_and_findings(cell: Path) -> None:
    page = _page(cell)
    assert 'aria-label="Bus with 5 SubDevices, 4 FSoE connections"' in page
    assert page.count('class="arc"') == page.count("stroke:var(--c2)") == 4
    assert "stroke-dasharray" not in page
    for text in ("el6910 → drive_2", "with drive_2", "No findings"):
        assert text in page
    assert not re.search(r"<script|<link|\ssrc=|\shref=\"http|\son\w+=|url\(", page)


def test_one_that_compiles_to_no_plan_is_shown_too(cell: Path) -> None:
    text = cell.read_text("utf-8")
    cell.write_text(text.replace("address: 101", "unconfirmed: <b>guessed</b>", 1), "utf-8")
    page = _page(cell)
    assert "not confirmed: &lt;b&gt;guessed" in page
    assert re.search(r"FSN\d{3}", page)
    assert page.count('stroke:var(--red)" stroke-dasharray="2 4"') == 1
    assert ">✕</text>" in page
    cell.write_text(text.replace("devices/el1904.yaml", "devices/x.yaml"), "utf-8")
    page = _page(cell)
    assert page.count('class="arc"') == 3
    assert ">✕ 2 el1904</text>" in page
    cell.write_text("nets: [\n", "utf-8")
    page = _page(cell)
    assert "network.yaml" in page
    assert "Slots" not in page


def test_hostile_names_are_text(cell: Path) -> None:
    evil = "<img src=x onerror=alert(1)>"
    cell.write_text(cell.read_text("utf-8").replace("name: robot-cell", f'name: "{evil}"'))
    page = _page(cell)
    cell.write_text(cell.read_text("utf-8").replace("drive_2", '"<b>drive</b> behind the door"'))
    page += _page(cell)
    assert "<img" not in page
    assert "<b>drive</b>" not in page
    assert "&lt;b&gt;drive&lt;/b&gt; behind…" in page
    assert "&lt;img src=x" in page


def test_the_command_writes_it_once(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cell.parent)

    def done(*given: str) -> Result:
        return CliRunner().invoke(cli, ["studio", *given])

    assert done("--snapshot", "cell.html").output == (
        "cell.html: network.yaml as one page, without scripts\n"
    )
    page = cell.with_name("cell.html")
    assert "<svg" in page.read_text("utf-8")
    found = done("--snapshot", "cell.html")
    assert "replace it with --overwrite" in str(found.exception)
    page.write_text("")
    assert done(".", "--snapshot", "cell.html", "--overwrite").exit_code == 0
    assert "<svg" in page.read_text("utf-8")
    found = done("--snapshot", "cell.pdf")
    assert (found.exit_code, "write a page, .html" in found.output) == (2, True)
