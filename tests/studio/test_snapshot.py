"""One page of a network, without scripts, that opens from the disk."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from live.watched_master import WatchedMaster, subdevice
from master.rig import running
from networks import EXAMPLES

from fsoe_net.cli.main import cli
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import FilePresent
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


def test_each_bus_has_a_row_of_its_own() -> None:
    page = _page(EXAMPLES / "two-buses" / "network.yaml")
    labels = re.findall(r'<text x="(\S+)" y="(\S+)"[^>]*>(cell|drives|[0-9] \w+)</text>', page)
    heights = {text: float(y) for _, y, text in labels}
    rows = [
        [heights[t] for t in row] for row in (("1 el6910", "3 el2904"), ("0 drive_1", "1 drive_2"))
    ]
    assert [len(set(row)) for row in rows] == [1, 1]
    assert heights["cell"] < rows[0][0] < heights["drives"] < rows[1][0]


def test_one_that_compiles_to_no_plan_is_shown_too(cell: Path) -> None:
    text = cell.read_text("utf-8")
    cell.write_text(text.replace("address: 101", "unconfirmed: <b>guessed</b>", 1), "utf-8")
    page = _page(cell)
    assert "not confirmed: &lt;b&gt;guessed" in page
    assert re.search(r"FSN\d{3}", page)
    assert page.count('stroke:var(--red)" stroke-dasharray="2 4"') == 1
    assert ">✖</text>" in page
    cell.write_text(text.replace("devices/el1904.yaml", "devices/x.yaml"), "utf-8")
    page = _page(cell)
    assert page.count('class="arc"') == 3
    assert ">✖ 2 el1904</text>" in page
    cell.write_text("nets: [\n", "utf-8")
    page = _page(cell)
    assert "network.yaml" in page
    assert "Slots" not in page


def test_hostile_names_are_text(cell: Path) -> None:
    evil = "<img src=x onerror=alert(1)>"
    cell.write_text(cell.read_text("utf-8").replace("name: el6910-cell", f'name: "{evil}"'))
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
    assert isinstance(found.exception, FilePresent)
    page.write_text("")
    assert done(".", "--snapshot", "cell.html", "--overwrite").exit_code == 0
    assert "<svg" in page.read_text("utf-8")
    found = done("--snapshot", "cell.pdf")
    assert (found.exit_code, "write a page, .html" in found.output) == (2, True)


# -- with a bus -----------------------------------------------------------------------------------


@pytest.fixture
def bus() -> Iterator[WatchedMaster]:
    with tempfile.TemporaryDirectory(prefix="fsn-") as folder:  # the path of a socket is short
        server = WatchedMaster(Path(folder, "s"))
        yield server
        server.close()


def _live(socket: Path, *more: str) -> Result:
    words = ["studio", *more, "--snapshot", "bus.html", "--socket", str(socket), "--overwrite"]
    return CliRunner().invoke(cli, words)


def test_a_running_bus_is_before_its_network(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cell.parent)
    with running() as master:
        done = _live(master.path)
        assert done.output == (
            f"bus.html: network.yaml and the bus at {master.path} as one page, without scripts\n"
        )
        socket = master.path
    page = Path("bus.html").read_text("utf-8")
    seen = rf"snapshot of network.yaml; bus at {socket}, seen \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d UTC"
    assert re.search(seen, page)
    assert "No findings; bus: not every connection in Data with its SubDevices in OP" in page
    live, _, file = page.partition('<section id="bus">')
    for text in ("The bus at this moment", "el6910-el1904", "el2904", "AL state", "SHA-256"):
        assert text in live
    assert re.search(r"working counter \d+ of \d+<", live)
    assert "el6910 → drive_2" in file
    assert not re.search(r"<script|<link|\ssrc=|\shref=\"http|\son\w+=|url\(", page)
    Path("bus.html").unlink()
    gone = _live(socket)  # nobody is there now
    assert "no answer" in str(gone.exception)
    assert gone.exception.exit_code == 3
    assert not Path("bus.html").exists()


def test_a_bus_without_a_network_file_is_shown_alone(
    bus: WatchedMaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert _live(bus.path).output.startswith(f"bus.html: the bus at {bus.path} as one page")
    page = Path("bus.html").read_text("utf-8")
    for text in (
        "every connection in Data, every SubDevice in OP",
        "Data · ProcessData",
        "90 % of 100 ms",
        "working counter 6 of 6",
        "wake-up latency",
        "0 up, 1 open",
    ):
        assert text in page
    assert "Findings" not in page
    evil = "<b>drive</b>"
    bus.subdevices = [
        subdevice("logic", al="SAFE-OP", al_code=0x1B, detail="watchdog of its outputs", link=[]),
        subdevice(evil, al="none", found=9),
        subdevice("valve", known=False, al="none"),
    ]
    assert _live(bus.path).exit_code == 0
    page = Path("bus.html").read_text("utf-8")
    assert "not every connection in Data" in page
    assert "SAFE-OP, AL status code 0x001b: watchdog of its outputs" in page
    assert evil not in page
    assert '<b>&lt;b&gt;drive&lt;/b&gt;</b></div></td><td data-head="AL state"><div>' in page
    assert page.count('<span class="muted">absent') == 1
    bus.state = "stopped"
    assert _live(bus.path).exit_code == 0
    assert "the bus does not run (stopped)" in Path("bus.html").read_text("utf-8")


def test_a_named_file_that_is_missing_is_not_left_out(
    bus: WatchedMaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = _live(bus.path, "cell.yaml")
    assert "cannot read" in Path("bus.html").read_text("utf-8") + str(found.exception)


def test_a_bus_that_leaves_meanwhile_is_an_error(
    bus: WatchedMaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def leaves() -> None:
        raise OSError

    monkeypatch.setattr(bus, "_snapshot", leaves)
    gone = _live(bus.path)
    assert (gone.exception.exit_code, "has closed it" in str(gone.exception)) == (3, True)
    assert not Path("bus.html").exists()
