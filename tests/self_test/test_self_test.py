"""`fsoe-net doctor --self-test` passes here and fails in a copy with one broken piece."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from cli.tool import fsn
from networks import EXAMPLES
from weekly import first

import fsoe_net
from fsoe_net.core.module import compiled
from fsoe_net.errors import CoreMissing
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.fingerprint import fingerprint_of
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.project.installed import installed_files, versions
from fsoe_net.self_test import run
from fsoe_net.self_test.model import NotTried, SelfTestPart, TriedValue, reference, tried
from fsoe_net.self_test.run import PARTS

PACKAGE = Path(fsoe_net.__file__).parent
REFERENCE = PACKAGE / "project" / "self_test" / "reference.yaml"
NAMES = [part.name for part in PARTS]


@pytest.fixture(scope="module", autouse=True)
def core() -> Path:
    try:
        compiled()
    except CoreMissing as exc:
        pytest.skip(str(exc))
    from fsoe_net.core import _core

    return Path(_core.__file__)


@pytest.mark.parametrize("name", reference()["networks"])
def test_known_hashes_are_those_of_the_examples(name: str):
    """``FSN_RECORD=1`` writes them anew after a change that is meant."""
    files = [str(EXAMPLES / name / "network.yaml")]
    plan = compile_plan(whole_network(check_files(files), "nothing compiled"))
    made = {
        "plan_sha256": hashlib.sha256(plan.to_bytes()).hexdigest(),
        "fingerprint": fingerprint_of(plan).whole,
    }
    if os.environ.get("FSN_RECORD"):
        text = REFERENCE.read_text("utf-8")
        for key, value in made.items():
            text = re.sub(rf"(\n  {name}:\n(?:    .*\n)*?    {key}: ).*", rf'\1"{value}"', text)
        REFERENCE.write_text(text, "utf-8")
        reference.cache_clear()
    assert reference()["networks"][name] == made


@pytest.fixture(scope="module")
def here() -> subprocess.CompletedProcess[str]:
    return fsn("doctor", "--self-test", "--format", "json")


@pytest.mark.shows("R25")
def test_it_passes_here_and_names_its_versions(here: subprocess.CompletedProcess[str]):
    document = json.loads(here.stdout)
    assert [p["name"] for p in document["parts"]] == NAMES
    assert [p for p in document["parts"] if p["different"]] == []
    assert (here.returncode, document["result"]) == (0, "pass")
    tried_parts = [p for p in document["parts"] if not p["not_tried"]]
    assert {*NAMES} - {p["name"] for p in tried_parts} <= {"installed files", "fsn-master"}
    assert all(p["compared"] > 0 for p in tried_parts)
    assert document["build"]["sha256"] == installed_files().build
    assert document["versions"]["click"] != "not installed"


def test_the_build_is_what_sha256sum_prints():
    found = installed_files()
    listed = "".join(f"{found.hashes[path]}  {path}\n" for path in sorted(found.hashes))
    assert found.build == hashlib.sha256(listed.encode()).hexdigest()
    own = f"{PACKAGE.name}/self_test/estop.frames"
    assert found.hashes[own] == hashlib.sha256((PACKAGE.parent / own).read_bytes()).hexdigest()
    assert any(re.fullmatch(r"fsoe_net/core/_core.*\.so", path) for path in found.hashes)


def test_a_part_that_compares_nothing_or_breaks_down_has_failed():
    def breaks():
        yield TriedValue("one", 1, 1)
        raise RuntimeError("no such thing")

    def part(compare) -> SelfTestPart:
        return SelfTestPart(name="p", compare=compare, next_step="stop")

    assert tried(part(lambda: iter(()))).result == "fail"
    broken = tried(part(breaks))
    assert (broken.result, broken.compared) == ("fail", 1)
    assert broken.different[0].got == "RuntimeError: no such thing"
    assert broken.next_step == "stop"

    def not_here():
        raise NotTried("elsewhere")
        yield

    assert tried(part(not_here)).result == "not tried"


@pytest.mark.parametrize("program", ["missing", "no program"])
def test_fsn_master_is_not_tried_where_it_is_not_and_fails_where_it_cannot_start(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "fsn-master"
    if program == "no program":
        path.write_bytes(b"\x00" * 100)
        path.chmod(0o755)
    monkeypatch.setenv("FSN_MASTER", str(path))
    (result,) = (tried(part) for part in PARTS if part.name == "fsn-master")
    state = run.master_state()
    if program == "missing":
        assert (result.result, state) == ("not tried", None)
        assert "is not an executable program" in result.not_tried
    else:
        assert result.result == "fail"
        assert state is not None
        assert state[0].startswith("cannot be started: ")
        assert "install-master" in result.next_step


def test_versions_are_stated_also_of_what_is_missing(monkeypatch: pytest.MonkeyPatch):
    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.version", missing)
    assert versions()["click"] == "not installed"
    monkeypatch.setattr("importlib.metadata.requires", missing)
    assert list(versions()) == ["fsoe-net", "Python", "system"]


# -- one broken piece at a time -------------------------------------------------------------------

RUN = """
import sys
sys.meta_path[:] = [f for f in sys.meta_path if "editable" not in type(f).__module__]
sys.path.insert(0, {folder!r})
from fsoe_net.cli.self_test import _document
from fsoe_net.document.write_terminal import document_text
from fsoe_net.self_test import run
run.PARTS = tuple(p for p in run.PARTS if p.name in {parts!r})
done = run.run_self_test()
sys.stdout.write(document_text(_document(done)))
sys.exit(not done.passed)
"""


def installed_copy(folder: Path, core: Path) -> Path:
    """Return a folder like that of an installed wheel, with the record of the installer."""
    skipped = shutil.ignore_patterns("__pycache__", "*.so")
    shutil.copytree(PACKAGE, folder / "fsoe_net", ignore=skipped, copy_function=os.symlink)
    shutil.copytree(EXAMPLES, folder / "fsoe_net" / "examples", dirs_exist_ok=True)
    shutil.copytree(PACKAGE.parent / "schemas", folder / "fsoe_net" / "schemas", dirs_exist_ok=True)
    shutil.copy(core, folder / "fsoe_net" / "core" / core.name)
    info = folder / "fsoe_net-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fsoe-net\nVersion: 0.1.0\n")
    rows = [path for path in folder.rglob("*") if path.is_file()]
    lines = []
    for path in rows:
        digest = base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest())
        hashed = digest.rstrip(b"=").decode()
        size = path.stat().st_size
        lines.append(f"{path.relative_to(folder).as_posix()},sha256={hashed},{size}\n")
    (info / "RECORD").write_text("".join(lines))
    return folder


def self_test(folder: Path, *parts: str) -> tuple[int, str]:
    """Return exit code and text, whose lines are joined; nothing is on standard error.

    Lines of the copy are not counted: it is gone when they would be reported.
    """
    env = {key: value for key, value in os.environ.items() if key != "COVERAGE_PROCESS_START"}
    done = subprocess.run(
        [sys.executable, "-B", "-c", RUN.format(folder=str(folder), parts=parts)],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env=env,
    )
    assert done.stderr == ""
    return done.returncode, " ".join(done.stdout.split())


def rewrite(path: Path, find: str, put: str) -> None:
    text = path.read_text("utf-8")
    assert find in text, f"{find!r} is not in {path}"
    path.unlink()  # the copy has links to the files of the package
    path.write_text(text.replace(find, put, 1), "utf-8")


# Piece: the part that must fail; file, text to find, text to put.
BROKEN = {
    "formula": ("timing formulas", "timing/formulas.py", "RESERVE = 1.2", "RESERVE = 1.1"),
    "handshake": ("timing formulas", "timing/handshake.py", "2 * max(", "1 * max("),
    "PFH of FSoE": ("safety function", "timing/pfh.py", "FSOE_PFH = 1.0e-9", "FSOE_PFH = 0"),
    "limit of a PL": ("safety function", "timing/pfh.py", '"d": 1e-6', '"d": 1e-5'),
    "weakest element": ("safety function", "timing/claims.py", "lowest = min(", "lowest = max("),
    "polynomial": ("CRCs of FSoE", "fsoe/crc.py", "0x139B7", "0x139B5"),
    "table of CRCs": ("CRCs of FSoE", "fsoe/crc.py", "_HEAD_TWO.pack", "_HEAD_ONE.pack"),
    "SRA polynomial": ("CRCs of FSoE", "fsoe/crc.py", "0x1814141AB", "0x1814141AF"),
    "monitor": ("C core and Python", "self_test/monitor.py", "crcs != pdu.crcs", "False"),
    "decoder": ("recorded run", "core/monitor.py", "tuple(CrcVerdict)", "tuple(CrcVerdict)[::-1]"),
    "rule": ("broken networks", "rules/transfer_ends.py", '"FSN203"', '"FSN205"'),
    "compiler": ("reference networks", "plan/codec.py", "zlib.crc32(", "1 ^ zlib.crc32("),
    "fingerprint": (
        "reference networks",
        "plan/fingerprint.py",
        "cycle_ns={cycle_ns",
        "cycle={cycle_ns",
    ),
    "example": ("reference networks", "examples/estop/network.yaml", "address: 14", "address: 15"),
    "broken example": ("broken networks", "examples/broken/04_size.yaml", "size: 7", "size: 6"),
    "scenario": ("emulated runs", "examples/estop/scenario.yaml", "break: ek1914", "break: el1918"),
    "recording": ("recorded run", "self_test/estop.frames", "4e34cc05", "4e34cc06"),
    "no code": ("emulated runs", "simulate/session.py", "def ", "dfe "),
    "no reference": ("timing formulas", "self_test/reference.yaml", "timing:", "time: :"),
    "any file": ("installed files", "devices/ek1914.yaml", "EK1914", "EK1915"),
}


@pytest.mark.shows("R25")
@pytest.mark.parametrize("piece", first(5, BROKEN))
def test_a_broken_piece_is_found(piece: str, tmp_path: Path, core: Path):
    part, file, find, put = BROKEN[piece]
    folder = installed_copy(tmp_path, core)
    rewrite(folder / "fsoe_net" / file, find, put)
    code, text = self_test(folder, part)
    assert code == 1
    assert text.endswith(f"FAILED: {part}")
    assert re.search(r": expected .+, got .+", text)
    assert "install fsoe-net again" in text


def test_a_copy_with_nothing_broken_passes(tmp_path: Path, core: Path):
    code, text = self_test(installed_copy(tmp_path, core), *NAMES[:-1])
    assert text.endswith(f"{len(NAMES) - 1} parts passed")
    assert "files, installed)" in text
    assert code == 0


@pytest.mark.shows("R25")
def test_a_file_too_many_or_too_few_is_found(tmp_path: Path, core: Path):
    folder = installed_copy(tmp_path, core)
    (folder / "fsoe_net" / "timing" / "extra.py").write_text("")
    (folder / "fsoe_net" / "timing" / "pfh.py").unlink()
    _, text = self_test(folder, "installed files", "safety function")
    assert "fsoe_net/timing/extra.py: expected no such file, got " in text
    assert re.search(r"fsoe_net/timing/pfh.py: expected \w{64}, got no such file", text)
    assert "FAILED: installed files, safety function" in text


@pytest.mark.shows("R25")
def test_files_are_compared_with_the_record_of_their_own_installation(
    tmp_path: Path, core: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = installed_copy(tmp_path / "one", core)
    other = installed_copy(tmp_path / "other", core)

    def different(installed: Path) -> list[str]:
        info = next(installed.glob("*.dist-info"))
        monkeypatch.setattr(metadata, "distribution", lambda _: metadata.PathDistribution(info))
        (result,) = (tried(part) for part in PARTS if part.name == "installed files")
        return [row.what for row in result.different]

    monkeypatch.setattr("fsoe_net.project.installed._PACKAGE", folder / "fsoe_net")
    assert different(folder) == []
    rewrite(folder / "fsoe_net" / "py.typed", "", "x")
    assert different(folder) == ["fsoe_net/py.typed"]
    init = other / "fsoe_net" / "__init__.py"
    rewrite(init, "", "")  # no link to the same file any more
    assert different(other) == ["record of the installer"]
    init.unlink()
    assert different(other) == ["record of the installer"]
    monkeypatch.setattr(metadata, "distribution", metadata.Distribution.from_name)
    monkeypatch.setattr("sys.path", [])
    (result,) = (tried(part) for part in PARTS if part.name == "installed files")
    assert [row.got for row in result.different] == ["not there"]


@pytest.mark.shows("R25")
def test_an_installation_without_the_record_of_its_files_is_found(tmp_path: Path, core: Path):
    folder = installed_copy(tmp_path, core)
    (folder / "fsoe_net-0.1.0.dist-info" / "RECORD").unlink()
    code, text = self_test(folder, "installed files")
    assert code == 1
    assert "record of the installer: expected fsoe_net-*.dist-info/RECORD, got not there" in text


@pytest.mark.shows("R25")
def test_an_fsn_master_that_takes_every_plan_is_found(tmp_path: Path):
    program = tmp_path / "fsn-master"
    program.write_text(f"#!/bin/sh\necho fsn-master {fsoe_net.__version__}\n")
    program.chmod(0o755)
    done = fsn("doctor", "--self-test", env=os.environ | {"FSN_MASTER": str(program)})
    text = " ".join(done.stdout.split())
    assert (done.returncode, text.partition("FAILED: ")[2].partition(";")[0]) == (1, "fsn-master")
    assert f"build {installed_files().build} (" in text
    assert "exit code for a plan with a byte changed: expected 1, got 0" in text
    assert "fsoe-net install-master --overwrite" in text


def test_without_the_compiled_module_the_parts_that_need_it_fail(tmp_path: Path, core: Path):
    folder = installed_copy(tmp_path, core)
    (folder / "fsoe_net" / "core" / core.name).unlink()
    _, text = self_test(folder, "C core and Python", "copies", "timing formulas")
    assert "FAILED: C core and Python, copies" in text
    assert "the compiled part of fsoe-net is missing" in text


# -- in a report ----------------------------------------------------------------------------------


def test_a_report_names_what_it_gave(here: subprocess.CompletedProcess[str], tmp_path: Path):
    result = tmp_path / "self-test.json"
    result.write_text(here.stdout)
    network = str(EXAMPLES / "estop" / "network.yaml")

    def report() -> str:
        page = tmp_path / "report.md"
        options = ["--self-test-result", str(result), "--overwrite", "-o", str(page)]
        done = fsn("report", network, *options)
        return done.stdout + done.stderr + (page.read_text("utf-8") if page.exists() else "")

    text = report()
    assert "### Self-test of the tool" in text
    assert re.search(r"\| Result +\| .*passed", text)
    assert "against it: Identity" not in text
    document = json.loads(here.stdout)
    for part, word in ((2, "not tried"), (3, "fail")):
        document["parts"][part]["result"] = word
        document["result"] = "fail" if word == "fail" else "pass"
        result.write_text(json.dumps(document))
        text = report()
        assert ("against it: Identity: FAILED: CRCs of FSoE" in text) is (word == "fail")
        assert re.search(r"\| Not tried +\| .*broken networks", text)
    document["parts"][3]["result"] = document["result"] = "pass"
    del document["parts"][4]
    result.write_text(json.dumps(document))
    assert "it does not have the parts of this build" in report()
    document["build"]["sha256"] = "0" * 64
    result.write_text(json.dumps(document))
    assert "self-test of the tool: of another build than this report" in report()


DAMAGED = {
    "no JSON": "{",
    "no object": "[1]",
    "another tool": '{"tool": "x", "self_test": 1, "parts": []}',
    "a scan": '{"tool": "fsoe-net", "subdevices": []}',
    "no result": '{"tool": "fsoe-net", "self_test": 1, "parts": [{"name": "a", "result": 1}]}',
    "another result": """{"tool": "fsoe-net", "self_test": 1, "version": "1", "result": "pass",
        "build": {"sha256": "%s"}, "parts": [{"name": "a", "result": "fail"}]}"""
    % ("0" * 64),
    "no build": """{"tool": "fsoe-net", "self_test": 1, "version": "1", "result": "pass",
        "build": {"sha256": "x"}, "parts": [{"name": "a", "result": "pass"}]}""",
    "deep": "[" * 100_000,
    "no text": "\ufffe",
}


@pytest.mark.parametrize("what", DAMAGED)
def test_an_invalid_result_is_rejected(what: str, tmp_path: Path):
    result = tmp_path / "result.json"
    result.write_text(DAMAGED[what], "utf-16" if what == "no text" else "utf-8")
    page = tmp_path / "report.html"
    network = str(EXAMPLES / "estop" / "network.yaml")
    done = fsn("report", network, "--self-test-result", str(result), "-o", str(page))
    assert (done.returncode, page.exists()) == (1, False)
    assert "is not the result of a self-test" in done.stderr
    assert "fsoe-net doctor --self-test --format json > self-test.json" in done.stderr


def test_a_result_in_which_nothing_was_tried_has_failed(tmp_path: Path):
    result = tmp_path / "result.json"
    parts = [{"name": "a\x1b[2J", "result": "not tried"}]
    document = {"tool": "fsoe-net", "self_test": 1, "version": "1", "result": "pass"}
    document["build"] = {"sha256": "0" * 64}
    result.write_text(json.dumps(document | {"parts": parts}))
    page = tmp_path / "report.md"
    network = str(EXAMPLES / "estop" / "network.yaml")
    done = fsn("report", network, "--self-test-result", str(result), "-o", str(page))
    assert "against it: Identity: FAILED: nothing was tried" in done.stdout
    assert "\x1b" not in done.stdout + page.read_text("utf-8")
