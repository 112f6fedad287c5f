"""fsn-master is built from what is installed; its terms are named, errors say the next step."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fsoe_net.errors import EnvironmentFault
from fsoe_net.live import build_master, master

FSN = [sys.executable, "-m", "fsoe_net.cli", "install-master"]
needs_compiler = pytest.mark.skipif(
    shutil.which("cc") is None, reason="there is no C compiler on PATH"
)


def _run(*args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*FSN, *args],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


def test_terms_are_named_and_not_taken_for_granted(tmp_path: Path):
    done = _run("-o", str(tmp_path / "m"))
    assert done.returncode == 2
    assert "SOEM 1.4" in done.stderr
    assert "GPL, version 2, with an exception for linking" in done.stderr
    assert "--yes" in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_program_that_is_there_stays(tmp_path: Path):
    (tmp_path / "m").write_text("mine")
    done = _run("-o", str(tmp_path / "m"), "--without-soem")
    assert (done.returncode, (tmp_path / "m").read_text()) == (1, "mine")
    assert "--overwrite" in done.stderr


@needs_compiler
def test_an_older_igh_is_named_and_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its functions have other results: 1.5 and earlier ended the build with compiler errors."""
    prefix = tmp_path / "etherlab"
    for name, text in (
        ("include/ecrt.h", "#define ECRT_VER_MAJOR 1\n#define ECRT_VER_MINOR 5\n"),
        ("lib/libethercat.so", ""),
    ):
        (prefix / name).parent.mkdir(parents=True)
        (prefix / name).write_text(text)
    monkeypatch.setenv("CMAKE_PREFIX_PATH", str(prefix))
    done = _run("-o", str(tmp_path / "m"), "--without-soem")
    assert done.returncode == 0, done.stderr
    assert "bus igh: not in this build" in done.stdout
    cmake, env = build_master._cmake(tmp_path)
    wanted = [*cmake, "-S", "master_core", "-B", str(tmp_path / "b"), "-DFSN_IGH=ON"]
    with pytest.raises(EnvironmentFault, match=r"IgH EtherCAT Master 1\.5 in .*, not 1\.6"):
        build_master._run(wanted, "cmake", env)


@needs_compiler
def test_it_builds_a_program_that_runs(tmp_path: Path):
    """Without SOEM, so that no network is needed; `make master` builds it with."""
    done = _run("-o", str(tmp_path / "m"), "--without-soem")
    assert done.returncode == 0, done.stderr
    assert "bus emulated:" in done.stdout
    assert "bus soem: not in this build" in done.stdout
    assert f"sudo setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {tmp_path / 'm'}" in done.stdout
    assert [p.name for p in tmp_path.iterdir()] == ["m"]
    wanted = subprocess.run(
        [tmp_path / "m", "x.fsnplan", "--interface", "eth1"], capture_output=True, check=False
    )
    assert b"FSN_E_ABSENT" in wanted.stderr
    assert b"fsoe-net install-master" in wanted.stderr


@needs_compiler
def test_soem_2_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """By the tool and, where CMake is called by hand, by its file."""
    monkeypatch.setenv("MAKE_TERMOUT", "/dev/tty")  # as below make at a terminal: CMake 4 colours
    (tmp_path / "include" / "soem").mkdir(parents=True)
    (tmp_path / "include" / "soem" / "soem.h").touch()
    done = _run("-o", str(tmp_path / "m"), "--soem", str(tmp_path), "--yes")
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == (
        f"error: {tmp_path}: SOEM 2, which is not supported; fsn-master is built with SOEM 1.4, "
        "fetched without --soem"
    )
    cmake, env = build_master._cmake(tmp_path)
    call = [*cmake, "-S", str(build_master._source()), "-B", str(tmp_path / "b")]
    with pytest.raises(EnvironmentFault, match=r"cmake: exit code 1: CMake Error .* is SOEM 2"):
        build_master._run([*call, f"-DSOEM_SOURCE_DIR={tmp_path}"], "cmake", env)


@needs_compiler
def test_a_folder_without_soem_is_refused(tmp_path: Path):
    done = _run("-o", str(tmp_path / "m"), "--soem", str(tmp_path), "--yes")
    assert done.returncode == 3
    assert "SOEM" in done.stderr
    assert not (tmp_path / "m").exists()


def test_another_archive_is_refused_and_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    archive = tmp_path / "pysoem-1.1.13.tar.gz"
    archive.write_bytes(b"something else")
    monkeypatch.setattr(build_master, "_pip", lambda *_: None)
    with pytest.raises(EnvironmentFault, match="not the file that was expected"):
        build_master.fetch_soem(tmp_path)
    assert not archive.exists()


def test_missing_tools_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(EnvironmentFault, match="sudo apt-get install build-essential"):
        build_master.build_master(tmp_path / "m", with_soem=False)
    monkeypatch.setattr(build_master.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(EnvironmentFault, match="this Python has no pip"):
        build_master.fetch_soem(tmp_path)


def test_where_it_is_missing_the_command_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    shipped, on_path = tmp_path / "bin" / "fsn-master", tmp_path / "fsn-master"
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("FSN_MASTER", raising=False)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "venv" / "python"))
    monkeypatch.setattr(master, "_SHIPPED", shipped)
    with pytest.raises(EnvironmentFault, match="`fsoe-net install-master` builds it"):
        master.find_master()
    shipped.parent.mkdir()
    for program in (shipped, on_path):  # a program that was installed later, maybe with SOEM, wins
        program.touch(mode=0o755)
        assert master.find_master() == str(program)
