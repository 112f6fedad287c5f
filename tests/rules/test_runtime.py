"""What each version of the user's present driver minds, and what it does with a mistake."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from diagnostics import test_cases as cases
from networks import EXAMPLES, resolved

from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.rules.check import check
from fsoe_net.rules.effects import effect_today, effects_today
from fsoe_net.rules.runtime import ROS2, Runtime

ALIAS = '<param name="alias">0</param>\n        <param name="position">2</param>'
ROOT = Path(__file__).parents[2]


def _codes(runtime: Runtime, folder: Path, *edits: tuple[str, str, str]) -> set[str]:
    """Return what is found in the clean robot with one runtime and not with ``fsn``."""
    shutil.copytree(cases.HERE / "base", folder, dirs_exist_ok=True)
    cases._seed(folder, {"edit": edits})
    network = resolved(folder / "robot.urdf")
    both = [{d.code for d in check(network, runtime=r)} for r in (runtime, Runtime.FSN)]
    return both[0] - both[1]


@pytest.mark.parametrize(
    ("runtime", "codes"),
    [
        (Runtime.FSN, set()),
        (Runtime.ROS2_2025, {"FSN461", "FSN463", "FSN468"}),
        (Runtime.ROS2_2026_06, {"FSN461", "FSN462"}),
        (Runtime.ROS2_2026_08, {"FSN460", "FSN461", "FSN462"}),
        (Runtime.ROS2_NEWEST, {"FSN462"}),
        (Runtime.LCEC, {"FSN465"}),
    ],
)
def test_each_runtime_reports_its_own(runtime: Runtime, codes: set[str], tmp_path: Path):
    assert _codes(runtime, tmp_path) == codes


@pytest.mark.parametrize("runtime", Runtime)
def test_identity_after_an_alias(runtime: Runtime, tmp_path: Path):
    edit = ("robot.urdf", ALIAS, ALIAS.replace(">0<", ">7<").replace(">2<", ">0<"))
    checked_at_start = {Runtime.ROS2_2026_08, Runtime.ROS2_NEWEST}
    assert ("FSN469" in _codes(runtime, tmp_path, edit)) == (runtime in checked_at_start)


# Key, where it is written, first version that knows it, severity before that.
KEYS = [
    ("transfer_config", None, Runtime.ROS2_2026_06, Severity.WARNING),
    (
        "transfer_modules",
        ("transfers.yaml", "safety_modules", "transfer_modules"),
        Runtime.ROS2_2026_06,
        Severity.WARNING,
    ),
    (
        "transfer_master",
        ("transfers.yaml", "safety_master", "transfer_master"),
        Runtime.ROS2_2026_06,
        Severity.INFO,
    ),
    (
        "master_plugin",
        ("robot.urdf", "    </hardware>", '<param name="master_plugin">a/B</param></hardware>'),
        Runtime.ROS2_2026_08,
        Severity.INFO,
    ),
    (
        "readiness_timeout_s",
        ("robot.urdf", "    </hardware>", '<param name="readiness_timeout_s">9</param></hardware>'),
        Runtime.ROS2_NEWEST,
        Severity.INFO,
    ),
    (
        "required",
        ("robot.urdf", ALIAS, ALIAS + '<param name="required">true</param>'),
        Runtime.ROS2_NEWEST,
        Severity.INFO,
    ),
    (
        "sdo_check",
        ("devices/drive.yaml", "sdo:\n", "sdo_check: []\nsdo:\n"),
        Runtime.ROS2_NEWEST,
        Severity.INFO,
    ),
]


@pytest.mark.parametrize(("key", "edit", "since", "severity"), KEYS, ids=[k[0] for k in KEYS])
def test_keys_of_later_versions(key: str, edit, since: Runtime, severity: Severity, tmp_path: Path):
    shutil.copytree(cases.HERE / "base", tmp_path, dirs_exist_ok=True)
    cases._seed(tmp_path, {"edit": [edit] if edit else []})
    network = resolved(tmp_path / "robot.urdf")
    for runtime in ROS2:
        rows = [d for d in check(network, runtime=runtime) if d.code == "FSN463"]
        levels = [d.level for d in rows if d.message.startswith(f"{key} ")]
        assert levels == ([severity] if ROS2.index(runtime) < ROS2.index(since) else []), runtime


def test_lcec_has_the_role_of_a_type(tmp_path: Path):
    el1904, ek1914 = "0x07703052", "0x077a2c52"
    edits = [
        ("devices/ek1914.yaml", ek1914, "0x1af43052"),  # a logic as SubInstance
        ("devices/el6910.yaml", "0x1afe3052", el1904),  # a terminal as MainInstance
    ]
    shutil.copytree(cases.HERE / "base", tmp_path, dirs_exist_ok=True)
    cases._seed(tmp_path, {"edit": edits})
    rows = check(resolved(tmp_path / "robot.urdf"), runtime=Runtime.LCEC)
    roles = [re.findall(r"(Main|Sub)Instance", d.message) for d in rows if d.code == "FSN465"]
    assert sorted(roles) == [["Main"], ["Sub"]]
    edits = [("devices/ek1914.yaml", "0x1af43052", el1904)]
    edits += [("devices/el6910.yaml", el1904, "0x1af43052")]
    cases._seed(tmp_path, {"edit": edits})
    rows = check(resolved(tmp_path / "robot.urdf"), runtime=Runtime.LCEC)
    assert [d.code for d in rows if d.code.startswith("FSN46")] == []


def test_lcec_names_forks_that_have_a_type(tmp_path: Path):
    """The base has an EL6910 as logic and an EK1914, whose drivers are in forks only."""
    shutil.copytree(cases.HERE / "base", tmp_path, dirs_exist_ok=True)
    rows = check(resolved(tmp_path / "robot.urdf"), runtime=Runtime.LCEC)
    forks = [re.search(r"forks have a driver for (\w+)", d.message) for d in rows]
    assert sorted(m[1] for m in forks if m) == ["EK1914", "EL6910"]


def test_slots_filled_from_the_first_are_right_for_lcec():
    rows = check(resolved(EXAMPLES / "el6910" / "network.yaml"), runtime=Runtime.LCEC)
    assert "FSN466" not in {d.code for d in rows}


@pytest.mark.parametrize("code", CATALOGUE)
def test_every_effect_is_listed_once_for_each_runtime(code: str):
    listed = {r: text for runtimes, text in effects_today(code) for r in runtimes}
    assert listed == {r: effect_today(code, r) for r in Runtime if effect_today(code, r)}
    assert Runtime.FSN not in listed


def test_versions_differ_where_the_driver_changed():
    assert effect_today("FSN230", Runtime.ROS2_2026_08).startswith("ignores required: false")
    assert effect_today("FSN230", Runtime.ROS2_NEWEST).startswith("leaves the module out")
    assert effect_today("FSN123", Runtime.ROS2_2025).startswith("reads fsoe_config")
    assert "exception" in effect_today("FSN123", Runtime.ROS2_2026_06)
    assert {effect_today("FSN122", r) for r in ROS2} == {
        "does not find the class and does not start"
    }


def test_the_page_has_all_runtimes_and_their_findings():
    text = (ROOT / "docs" / "reference" / "runtimes.md").read_text("utf-8")
    assert all(f"| `{r.value}` |" in text for r in Runtime)
    assert {c for c in CATALOGUE if c.startswith("FSN46")} <= set(re.findall(r"FSN46[0-9]", text))
    assert "<!-- effects -->" in text  # the table is made when the documentation is built


@pytest.mark.parametrize("runtime", Runtime)
def test_a_default_that_the_chosen_version_does_not_write_is_a_warning(
    runtime: Runtime, tmp_path: Path
):
    shutil.copytree(cases.HERE / "base", tmp_path, dirs_exist_ok=True)
    cases._seed(tmp_path, cases.CASES["FSN450"])
    rows = check(resolved(tmp_path / "robot.urdf"), runtime=runtime)
    level = Severity.WARNING if runtime is Runtime.ROS2_2025 else Severity.INFO
    assert [d.level for d in rows if d.code == "FSN450"] == [level]
