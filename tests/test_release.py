"""What the page of releases says that CI holds: versions that belong together."""

import re
import subprocess

import pytest
from live.support import ROOT

import fsoe_net
from fsoe_net.diag.catalogue import CATALOGUE


def text(path: str) -> str:
    return (ROOT / path).read_text("utf-8")


def test_package_library_and_changelog_have_one_version():
    header = text("master_core/include/fsn/version.h")
    assert re.search(r'FSN_VERSION_STRING "(.+)"', header)[1] == fsoe_net.__version__
    numbers = [re.search(rf"FSN_VERSION_{n} (\d+)", header)[1] for n in ("MAJOR", "MINOR", "PATCH")]
    assert ".".join(numbers) == fsoe_net.__version__
    assert text("packaging/debian/changelog").startswith(f"fsoe-net ({fsoe_net.__version__}) ")
    topmost = re.search(r"^## (\S+?),? (unreleased|\d{4}-\d\d-\d\d)$", text("CHANGELOG.md"), re.M)
    assert topmost[1] == fsoe_net.__version__


def test_the_changelog_names_the_diagnostics_there_are():
    numbers = sorted(code for code in CATALOGUE if code.startswith("FSN") and code[3:].isdigit())
    assert f"{numbers[0]} … {numbers[-1]}" in text("CHANGELOG.md")


def test_each_step_that_ci_holds_is_run_by_it():
    page = text("docs/development/release.md")
    named = set(re.findall(r"`scripts/([\w/]+)`", page.split("6. Run")[0]))
    assert named == {"wheel", "rig/consumer", "docs"}
    for script in named:
        assert script in text(".ci/run")
        assert (ROOT / "scripts" / script).is_file()


@pytest.mark.parametrize("arguments", [["--nativ"], ["a", "b"], ["--native", "-x"], ["README.md"]])
def test_wrong_arguments_of_the_release_build_nothing(arguments: list[str]):
    """The last one names a file that exists."""
    call = [ROOT / "packaging" / "build-release", *arguments]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "release" in done.stderr
