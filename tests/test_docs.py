"""The reference pages say what the program does."""

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli.signed_folder import ANNA, BERT, fill_in
from cli.tool import fsn
from live.support import ESTOP, ROOT, document, needs_core, run, session_of
from networks import example
from patience import PATIENCE_S
from scans import scan_of

from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.trials import CampaignConfig
from fsoe_net.formats.own.json_schema import read_schema
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.formats.registry import all_formats, all_targets
from fsoe_net.fsoe.config import SubConfig
from fsoe_net.report.campaign import to_json
from fsoe_net.simulate.campaign import campaign_links, run_campaign
from fsoe_net.simulate.session import run_virtual

PAGES = ROOT / "docs" / "reference"


def page(name: str) -> str:
    return (PAGES / name).read_text("utf-8")


def code(text: str, language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", text, re.S)
    assert found
    return found.group(1)


@needs_core
def test_example_of_the_scenario_page_passes(tmp_path: Path):
    path = tmp_path / "s.yaml"
    path.write_text(code(page("scenario-file.md"), "yaml"), "utf-8")
    result = run(ESTOP, path)
    assert [v.held for v in result.verdicts] == [True, True, True]


@needs_core
def test_failed_expectation_reads_as_shown(tmp_path: Path):
    text = "duration_s: 0.2\nexpect:\n  - {at_ms: 100, state: data_process}\n"
    session = session_of(ESTOP, text, tmp=tmp_path)
    (v,) = run_virtual(session, session.duration_ns).verdicts
    shown = f"s.yaml{v.place.rpartition('.yaml')[2]}: not observed: {v.text}; {v.seen}\n"
    assert shown == code(page("scenario-file.md"), "text")


def test_every_key_of_the_schema_is_on_the_page():
    schema, text = read_schema("scenario"), page("scenario-file.md")
    keys = set(schema["properties"]) - {"logic"}
    for name in ("step", "expectation"):
        keys |= set(schema["$defs"][name]["properties"])
    keys |= set(schema["$defs"]["expectation"]["properties"]["state"]["enum"])
    assert [k for k in sorted(keys) if not re.search(rf"`{k}[`:]", text)] == []


@needs_core
def test_every_key_of_the_json_is_on_the_page():
    text, found = page("run-output.md"), document(run(ESTOP))
    keys = {*found, *found["connections"][0], *found["statistics"], *found["events"][0]}
    listed = {word for row in re.findall(r"^\| (`.*?) \|", text, re.M) for word in row.split("`")}
    listed |= {word for row in re.findall(r"\{([a-z_, ]+)\}", text) for word in row.split(", ")}
    assert sorted(keys - listed) == []
    fields = {f.name for f in dataclasses.fields(run(ESTOP).statistics)}
    assert sorted(fields - listed) == []


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="needs ssh-keygen of OpenSSH")
def test_the_page_on_acceptance_runs_as_written(tmp_path: Path):
    folder = tmp_path / "estop"
    shutil.copytree(ROOT / "examples" / "estop", folder)
    shown = [line for line in _accept_page(folder) if not line.startswith("$")]
    page_text = (ROOT / "docs" / "howto" / "accept.md").read_text("utf-8")
    blocks = "".join(re.findall(r"```console\n(.*?)```", page_text, re.DOTALL))
    fixed = [line for line in shown if not re.search(r"SHA256:|\d{4}-\d\d-\d\d|^evidence", line)]
    assert [line for line in fixed if line not in blocks.splitlines()] == []
    assert sum("signed, ED25519" in line for line in shown) == 2
    assert f"signed as author by {ANNA}" in "".join(shown)
    assert f"signed as verifier by {BERT}" in "".join(shown)


def _accept_page(folder: Path) -> Iterator[str]:
    """Run the commands of the page; fill in the test record and read the bus as a person would."""
    text = (ROOT / "docs" / "howto" / "accept.md").read_text("utf-8")
    blocks = "".join(re.findall(r"```console\n(.*?)```", text, re.DOTALL))
    commands = re.findall(r"^\$ ((?:.*\\\n)*.*)$", blocks, re.MULTILINE)
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command in commands:
        if command.startswith(("pipx", "sudo")):
            continue
        if command == "fsoe-net scan --interface eth1 -o bus":
            (folder / "bus").mkdir()
            scan = json.dumps(scan_of(example("estop")))
            (folder / "bus" / "scan.json").write_text(scan, "utf-8")
            continue
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=folder,
            env={**os.environ, "PATH": tools},
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
        changed = "verify network.yaml --accepted" in command  # the page has changed the network
        assert done.returncode == (1 if changed else 0), (command, done.stdout, done.stderr)
        yield from (done.stdout + done.stderr).splitlines()
        if command.startswith("fsoe-net test-record"):
            fill_in(folder / "test-record.yaml", loss=True)


@needs_core
@pytest.mark.parametrize(
    ("file", "name"), [("README.md", "estop"), ("docs/howto/emulate.md", "robot-cell")]
)
def test_shown_run_is_the_output_of_its_command(file: str, name: str):
    text = (ROOT / file).read_text("utf-8")
    command = f"run examples/{name}/network.yaml --scenario examples/{name}/scenario.yaml"
    shown = text.partition(f"$ fsoe-net {command} --virtual-time\n")[2].partition("```")[0]
    lines = fsn(*command.split(), "--virtual-time", cwd=ROOT).stdout.splitlines()
    after = 0
    # Lines are left out only where the page has an ellipsis.
    for part in shown.split("…\n"):
        rows = part.splitlines()
        starts = [n for n in range(after, len(lines)) if lines[n : n + len(rows)] == rows]
        assert starts, part
        after = starts[0] + len(rows)


@pytest.mark.parametrize("name", ["estop", "el6910"])
def test_the_scenario_examples_are_valid(name: str):
    scenario, found = load_scenario(ROOT / "examples" / name / "scenario.yaml")
    assert scenario is not None
    assert found == []


def test_anchors_work_on_github():
    """Sphinx reports dead anchors of its own; GitHub drops punctuation that Sphinx replaces."""
    dead = []
    for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for file, anchor in re.findall(r"\]\(([\w./-]*)#([^)]+)\)", path.read_text("utf-8")):
            target = (path.parent / file) if file else path
            heads = re.findall(r"^#+ (.*)$", target.read_text("utf-8"), re.MULTILINE)
            slugs = {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
            dead += [] if anchor in slugs else [f"{path.name}: {file}#{anchor}"]
    assert dead == []


def test_every_format_and_target_is_on_the_page():
    page = (ROOT / "docs" / "reference" / "input-files.md").read_text("utf-8")
    rows = "".join(line for line in page.splitlines() if line.startswith("|"))
    missing = [name for name in (*all_formats(), *all_targets()) if f"`{name}`" not in rows]
    assert missing == []


def test_fault_catalogue_names_every_class():
    named = re.findall(r"^\| `(\w+)` \|", page("fault-catalogue.md"), re.M)
    assert list(dict.fromkeys(named)) == list(CATALOGUE)  # some stand in a second table too


def test_every_key_of_a_campaign_is_documented():
    config = CampaignConfig(links=campaign_links(example("estop")))
    found = to_json(run_campaign(config, ("loss",), 8, jobs=1))
    text = page("json-output.md").partition("# Output of `campaign")[2]
    named = set(re.findall(r"`(\w+)(?:\[\])?`", text))
    keys = {*found, *found["classes"][0], *found["connections"][0]}
    assert keys <= named, keys - named


def test_device_of_the_how_to_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """The wrapper works with a library that has the functions of the header."""
    text = (ROOT / "docs" / "howto" / "test-your-device.md").read_text("utf-8")
    source = tmp_path / "my_sub.c"
    silent = code(text, "c").replace(";", " {", 4)
    bodies = iter(
        [
            "}",
            "(void)now_ns;(void)in;(void)in_len;(void)out;return 0;}",
            "return 0;}",
            "(void)data;}",
        ]
    )
    lines = []
    for line in silent.splitlines():
        lines.append(line + (next(bodies) if " {" in line else ""))
    source.write_text("\n".join(lines).replace("/* bytes sent, 0 for none */", ""), "utf-8")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = tmp_path / "libmy_sub.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(code(text, "python"), names)
    sub = names["make_sub"](SubConfig(address=1, safe_out_bytes=2, safe_in_bytes=2))
    assert sub.step(0, None) is None
    assert sub.step(1, bytes(7)) is None
    assert not sub.data_valid
    assert sub.received_safe_data == bytes(2)
    # The program that injects a fault into this device.
    program = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[1]
    (tmp_path / "my_device.py").write_text(code(text, "python"), "utf-8")
    shutil.copytree(ROOT / "examples" / "estop", tmp_path, dirs_exist_ok=True)
    monkeypatch.syspath_prepend(str(tmp_path))
    exec(program, names)
    assert names["link"].sub.address == 14
    assert capsys.readouterr().out == "False\n"
