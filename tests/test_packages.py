"""What is said of a package that is missing."""

import importlib.util
import subprocess
import sys
import sysconfig
from importlib import metadata

import pytest

from fsoe_net.diag.packages import missing_package


def test_the_command_is_one_that_pip_takes():
    said = missing_package("ros2", "mcap.writer", "ros2")
    begin = f"ros2 needs mcap, which is not installed; {sys.executable} -m pip install "
    assert said.startswith(begin)
    command = said.partition("; ")[2].replace("pip install", "pip install --dry-run --quiet")
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_without_pip_it_is_uv(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    said = missing_package("PDF", None, "pdf")
    assert said == (
        f"PDF needs pdf, which is not installed; uv pip install --python {sys.executable} "
        "'weasyprint>=70'"
    )


def test_in_the_python_of_a_distribution_it_is_not_pip(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "prefix", sys.base_prefix)
    monkeypatch.setattr(sysconfig, "get_path", lambda _name: str(tmp_path))
    assert " -m pip install " in missing_package("PDF", "weasyprint", "pdf")
    (tmp_path / "EXTERNALLY-MANAGED").touch()  # PEP 668
    assert missing_package("PDF", "weasyprint", "pdf") == (
        "PDF needs weasyprint, which is not installed; install weasyprint>=70 from your "
        "distribution, or fsoe-net with it in a virtual environment"
    )
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert " -m pip install " in missing_package("PDF", "weasyprint", "pdf")


@pytest.mark.parametrize("package", ["starlette", "uvicorn"])
def test_a_command_names_a_missing_dependency(package):
    code = f"import sys; sys.modules[{package!r}] = None; from fsoe_net.cli import start; start()"
    command = [sys.executable, "-c", code, "studio", "--no-browser", "absent.yaml"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert done.stderr.startswith(f"error: fsoe-net needs {package}, which is not installed; ")
    assert done.stderr.endswith(f"pip install {package}\n")


def test_a_tree_that_was_never_installed(monkeypatch):
    def absent(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "requires", absent)
    assert missing_package("ros2", "mcap", "ros2").endswith("-m pip install mcap")
