"""The search of the docs and its first page: what a reader finds first."""

from __future__ import annotations

import io
import json
import re
import shlex
import shutil
import subprocess
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import generated
import pytest
from networks import EXAMPLES
from studio.browser import chromium  # noqa: F401 - a fixture

from fsoe_net.cli.main import cli
from fsoe_net.formats.own.network import load_network

DOCS = Path(__file__).parents[1] / "docs"
SCORER = DOCS / "site" / "scorer.js"
TITLE = 15  # what Sphinx gives a page whose title is the searched word
PAGES = ["diagnostics/FSN301", "development/testing", "reference/cli", "howto/scan", "index"]


def ranked(browser: Any, query: str) -> list[str]:
    """Return the pages in the order of a search in which they score the same."""
    page = browser.new_page()
    page.route("**/*", lambda route: route.fulfill(content_type="text/html", body="<p>docs"))
    page.goto(f"http://docs.invalid/search.html?q={query}")
    page.add_script_tag(content=SCORER.read_text("utf-8"))
    scores = page.evaluate(
        f"{json.dumps(PAGES)}.map((name) => Scorer.score([name, '', '', null, {TITLE}, name]))"
    )
    page.close()
    order = sorted(range(len(PAGES)), key=lambda n: -scores[n])
    return [PAGES[n] for n in order]


def test_howtos_come_before_findings(chromium: Any):  # noqa: F811
    found = ranked(chromium, "scan+frame")
    assert found[0] == "howto/scan"
    assert found[-1] == "diagnostics/FSN301"


def test_a_code_finds_its_own_page(chromium: Any):  # noqa: F811
    assert ranked(chromium, "fsn301") == PAGES


def test_the_gallery_draws_each_example_with_a_report():
    text = generated.fill_in("index", (DOCS / "index.md").read_text("utf-8"))
    assert "<!-- gallery -->" not in text
    for name, page in generated.EXAMPLES.items():
        network = load_network([EXAMPLES / name / "network.yaml"]).network
        assert network is not None
        card = text.partition(f"`examples/{name}`")[0].rpartition("{container} card\n")[2]
        assert all(sub.name in card for sub in network.subdevices)
        assert (DOCS / page).is_file()


def test_the_page_of_performance_has_the_figures_of_each_report():
    text = generated.fill_in(
        "performance/index", (DOCS / "performance/index.md").read_text("utf-8")
    )
    files = sorted((DOCS / "performance").glob("*.json"))
    assert files
    for file in files:
        row = json.loads(file.read_text("utf-8"))
        section = text.partition(f"## {file.stem}\n")[2].partition("\n## ")[0]
        assert row["utc"] in section
        for times in row["times"].values():
            assert f" {times['p999_ns'] / 1000:.1f} " in section


def test_each_reader_has_a_card_whose_pages_exist():
    text = (DOCS / "index.md").read_text("utf-8")
    cards = re.findall(r"\{container\} card\n\*\*(.*?)\*\*\n(.*?)::::", text, flags=re.S)
    assert {title for title, _ in cards} >= {
        "Integrator", "Safety engineer", "Device maker", "ROS user", "Developer"
    }  # fmt: skip
    for _, links in cards:
        for page in re.findall(r"\]\((\w.*?)(?:#.*?)?\)", links):
            assert (DOCS / page).is_file()
    assert (DOCS / "extra" / "specimen.html").is_file()
    assert 'href="specimen.html"' in text


def test_our_drawings_follow_the_theme_of_the_page():
    style = generated.picture_style()
    rules = re.findall(r"([^{};]*)\{([^{}]*--back:[^{}]*)", style)
    backs = [re.search(r"--back:([^;]*)", body)[1] for _, body in rules]
    assert len(backs) == 3
    assert backs[0] != backs[1] == backs[2]
    assert style.count("{") == style.count("}")


@pytest.fixture
def site(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """The script of the published pages; the one page of this commit says `main`."""
    scripts = tmp_path / "scripts"
    scripts.mkdir()
    shutil.copy(DOCS.parent / "scripts" / "site", scripts)
    made = "#!/bin/sh\nmkdir -p build/docs && echo main >build/docs/index.html\n"
    (scripts / "docs").write_text(made)
    (scripts / "docs").chmod(0o755)

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        call = [scripts / "site", *map(str, arguments)]
        return subprocess.run(call, capture_output=True, text=True, check=False)

    return run


def archive(folder: Path, version: str) -> Path:
    path = folder / f"fsoe-net-{version}-docs.tar.xz"
    with tarfile.open(path, "w:xz") as pages:
        header = tarfile.TarInfo("./index.html")
        header.size = len(version)
        pages.addfile(header, io.BytesIO(version.encode()))
    return path


def test_each_version_has_its_pages_and_the_newest_release_is_first(site: Any, tmp_path: Path):
    releases = [archive(tmp_path, version) for version in ("0.9.1", "0.10.0", "0.2.0")]
    done = site(tmp_path / "site", *releases)
    assert (done.returncode, done.stderr) == (0, "")
    read = {
        path.parent.name: path.read_text("utf-8").strip()
        for path in (tmp_path / "site").rglob("index.html")
    }
    there = ["0.10.0", "0.9.1", "0.2.0", "main"]
    assert read == {"site": "0.10.0", **{name: name for name in there}}
    links = re.findall(r'href="(.*?)/"', (tmp_path / "site/versions.html").read_text("utf-8"))
    assert links == there


def test_before_a_release_the_pages_of_this_commit_are_first(site: Any, tmp_path: Path):
    assert site(tmp_path / "site").returncode == 0
    assert (tmp_path / "site/index.html").read_text("utf-8") == "main\n"


@pytest.mark.parametrize("more", [[], ["-x"], ["{tmp}"], ["{tmp}/site", "{tmp}/notes.tar.xz"]])
def test_wrong_arguments_of_the_site_write_nothing(site: Any, tmp_path: Path, more: list[str]):
    (tmp_path / "notes.tar.xz").touch()
    done = site(*(word.format(tmp=tmp_path) for word in more))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("site")
    assert not (tmp_path / "site").exists()


def test_what_an_issue_asks_for_can_be_called():
    folder = DOCS.parent / ".github" / "ISSUE_TEMPLATE"
    text = "".join(path.read_text("utf-8") for path in folder.iterdir())
    calls = re.findall(r"`fsoe-net (.*?)`", text)
    assert len(calls) >= 5
    for call in calls:
        name, *words = shlex.split(call)
        command = cli if name.startswith("-") else cli.get_command(click.Context(cli), name)
        assert command is not None, call
        options = {word for p in command.params for word in p.opts}
        assert [w for w in (name, *words) if w.startswith("-") and w not in options] == [], call
    pages = re.findall(r"docs/[\w/-]+\.md", text)
    assert [page for page in pages if not (DOCS.parent / page).exists()] == []


def test_the_page_of_support_names_the_versions_that_ci_locks():
    page = (DOCS / "reference" / "support.md").read_text("utf-8")
    locked = (DOCS.parent / ".ci" / "requirements.txt").read_text("utf-8")
    for name, told in (("pysoem", "pysoem"), ("kickcat", "KickCAT"), ("ziglang", "zig")):
        version = re.search(rf"^{name}==(\d+\.\d+)", locked, re.MULTILINE)[1]
        assert f"{told} {version}" in page
