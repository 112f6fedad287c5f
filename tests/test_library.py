"""What `import fsoe_net` gives: few names, all documented, and the programs of the page run."""

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
from cli.tool import fsn
from live.support import EXAMPLES, ROOT, needs_core
from patience import PATIENCE_S
from public_types import reachable_types

import fsoe_net
from fsoe_net.testing.fake_master import FakeMaster

PAGE = ROOT / "docs" / "tutorial" / "library.md"
SOCKET = "/run/fsn-master-eth1.sock"
STOP = "set drive_1.0x6040:00=0"
BROKEN = sorted((EXAMPLES / "broken").glob("*.yaml"))


def test_the_names_are_few_and_all_of_them_exist():
    assert len(fsoe_net.__all__) <= 24
    assert sorted(fsoe_net.__all__) == fsoe_net.__all__
    assert set(dir(fsoe_net)) == {*fsoe_net.__all__, "__version__"}
    with pytest.raises(AttributeError, match="no attribute 'Everything'"):
        fsoe_net.Everything  # noqa: B018 - it raises


def test_a_network_lists_its_parts_as_its_files_state_them():
    network = fsoe_net.load(EXAMPLES / "two-buses" / "network.yaml")
    facts = [(s.bus, s.name, s.position, s.frame_pairs) for s in network.subdevices]
    assert facts == [
        ("cell", "el6910", 1, 4),
        ("cell", "el1904", 2, 1),
        ("cell", "el2904", 3, 1),
        ("drives", "drive_1", 0, 1),
        ("drives", "drive_2", 1, 1),
    ]
    assert {s.vendor_id for s in network.subdevices} == {0x2, 0x22D2}
    first = network.connections[0]
    assert (first.main, first.sub, first.slot, first.is_confirmed) == ("el6910", "el1904", 0, True)
    assert (first.address, first.connection_id, first.watchdog_ms) == (101, 1, 100)
    assert len(network.transfers) == 8
    assert all(row.is_fsoe for row in network.transfers)
    assert (network.transfers[0].source, network.transfers[0].source_entry) == (
        "el1904",
        (0x6000, 1),
    )


def test_a_network_with_errors_still_lists_its_parts(tmp_path):
    broken = fsoe_net.load(EXAMPLES / "broken" / "04_size.yaml")
    assert not broken.check().ok
    assert [row.size_bytes for row in broken.transfers] == [6, 7]
    nothing = tmp_path / "nothing.yaml"
    nothing.write_text("[")
    unread = fsoe_net.load(nothing)
    assert (unread.subdevices, unread.connections, unread.transfers) == ((), (), ())
    assert unread._repr_svg_() is None


def test_a_notebook_shows_a_network_as_a_picture():
    network = fsoe_net.load(EXAMPLES / "estop" / "network.yaml")
    root = ElementTree.fromstring(network._repr_svg_())
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    shown = {text.text for text in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"ek1914", "el1918", "MainInstance", "SubInstance"} <= shown


def test_the_text_of_an_exception_holds_the_first_finding(tmp_path):
    shutil.copytree(EXAMPLES, tmp_path / "examples")  # its devices are in another folder
    folder = tmp_path / "examples" / "broken"
    path = (folder / "04_size.yaml").rename(folder / "a\x1b[2Jb.yaml")
    with pytest.raises(fsoe_net.InputError) as refused:
        fsoe_net.load(path).compile()
    assert str(refused.value).startswith(refused.value.message)
    assert f": {folder}/a\\u001b[2Jb.yaml:17:15: FSN209: size 7 " in str(refused.value)
    assert refused.value.__notes__ == ["next step: write size: 6"]  # a traceback shows it as well
    first, *_ = str(refused.value.diagnostics[0]).split("\n")
    assert str(refused.value).endswith(first)


@pytest.mark.parametrize("name", fsoe_net.__all__)
def test_every_name_and_its_public_methods_are_documented(name):
    thing = getattr(fsoe_net, name)
    public = [thing]
    if inspect.isclass(thing):
        public += [v for k, v in vars(thing).items() if not k.startswith("_") and callable(v)]
    assert all(inspect.getdoc(one) for one in public)
    assert re.search(rf":: {name}\b", (ROOT / "docs/reference/library.md").read_text("utf-8"))


def test_every_type_that_a_user_can_meet_is_documented():
    page = (ROOT / "docs/reference/library.md").read_text("utf-8")
    documented = re.findall(r"^\.\. auto(?:class|exception):: ([\w.]+)", page, re.MULTILINE)
    left_out = re.findall(r"`(\w+\.\w+)`", page.partition("not part of the library:")[2])
    names = {n if "." in n else f"{getattr(fsoe_net, n).__module__}.{n}" for n in documented}
    reached = reachable_types(left_out)
    assert {f"{name} by {place}" for name, place in reached.items() if name not in names} == set()
    # An attribute that is left out leads to a type that is not on the page.
    for attribute in left_out:
        others = [one for one in left_out if one != attribute]
        assert reachable_types(others).keys() > reached.keys(), attribute


def test_every_method_of_a_client_is_in_a_group_of_its_page():
    page = (ROOT / "docs/reference/library.md").read_text("utf-8")
    grouped = re.findall(r"^\.\. auto(?:method|property):: Client\.(\w+)", page, re.MULTILINE)
    methods = [name for name, _ in inspect.getmembers(fsoe_net.Client) if not name.startswith("_")]
    assert sorted(grouped) == sorted(methods)


def test_it_is_imported_without_a_command_line_or_anything_else():
    loaded = (
        "import sys, fsoe_net; print(sorted(m for m in sys.modules if m.startswith('fsoe_net')))"
    )
    words = [sys.executable, "-c", loaded]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout == "['fsoe_net', 'fsoe_net.version']\n"
    used = (
        "import sys, fsoe_net\n"
        "fsoe_net.load(sys.argv[1]).check()\n"
        "own = ('own', 'shared', 'registry', 'recognise', 'unsupported')\n"
        "formats = [m.split('.') for m in sys.modules if m.startswith('fsoe_net.formats.')]\n"
        "readers = ['.'.join(m) for m in formats if m[2] not in own and len(m) > 3]\n"
        "print(readers)\n"
        "print([m for m in ('click', 'rich', 'fsoe_net.cli') if m in sys.modules])"
    )
    words = [sys.executable, "-c", used, str(EXAMPLES / "estop" / "network.yaml")]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n[]\n"


def test_it_is_typed():
    assert (Path(fsoe_net.__file__).parent / "py.typed").is_file()


def _lose_the_connection(master: FakeMaster) -> None:
    """Report a loss to the client that takes events, and stop the bus after its answer."""
    _wait_for(master, "snapshot")  # comes after the subscription
    master.send_event(
        event="connection",
        connection="c1",
        before="process data",
        after="reset",
        text="c1 was lost",
    )
    _wait_for(master, STOP)
    master.state = "stopped"


def _wait_for(master: FakeMaster, request: str) -> None:
    until = time.monotonic() + PATIENCE_S
    while request not in master.asked and time.monotonic() < until:
        time.sleep(0.01)


@needs_core
def test_the_programs_of_the_page_run(tmp_path, monkeypatch, capsys):
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    monkeypatch.chdir(tmp_path / "examples" / "estop")
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(blocks) == 13
    names: dict[str, object] = {}
    with FakeMaster() as master:
        # `examples/el6910` has this name for its input.
        master.inputs["drive_1.status_word"] = 0x27
        threading.Thread(target=_lose_the_connection, args=(master,), daemon=True).start()
        for block in blocks:
            exec(compile(block.replace(SOCKET, str(master.path)), str(PAGE), "exec"), names)
        assert "set drive_1.0x6040:00=6" in master.asked
        assert STOP in master.asked
    out = capsys.readouterr().out
    stopped = "c1 is in Reset - controlword of drive_1: 0"
    assert f"c1 is in Data · ProcessData\nc1 was lost\n{stopped}\n" in out
    assert "\npassed\n" in out
    assert "no plan: 1 error" in out
    assert "NOT HELD" not in out
    assert "100.0 ms; at least 38.4 ms\n" in out  # 1.2 x 32 ms
    written = {p.name for p in Path().iterdir()}
    assert {"machine.fsnplan", "report.html", "run.pcapng", "out", "proposed"} <= written


def test_names_of_the_page_are_those_of_its_network():
    text = PAGE.read_text("utf-8")
    plan = fsoe_net.load(EXAMPLES / "el6910" / "network.yaml").compile()
    names = {symbol.name for symbol in plan.symbols}
    assert set(re.findall(r"\"(drive_1\.[^\"]+)\"", text)) <= names
    assert "here `examples/el6910`" in text


@needs_core
def test_kept_file_is_reported_with_the_argument_of_the_caller(tmp_path):
    path = tmp_path / "machine.fsnplan"
    network = EXAMPLES / "estop" / "network.yaml"
    plan = fsoe_net.load(network).compile()
    plan.save(path)
    with pytest.raises(fsoe_net.InputError, match=r"exists; .* replace it\n") as kept:
        plan.save(path)
    assert kept.value.__notes__ == ["overwrite=True replaces it"]
    plan.save(path, overwrite=True)
    command = fsn("plan", str(network), "-o", str(path))
    assert command.returncode == 1
    assert command.stderr.endswith("replace it with --overwrite\n")


@needs_core
def test_a_plan_and_a_run_are_shown_in_one_line():
    network = fsoe_net.load(EXAMPLES / "estop" / "network.yaml")  # 1 ms, two devices
    assert repr(network.compile()) == "<Plan: cycle 1 ms, 2 SubDevices, 1 connection, 2 copies>"
    run = network.simulate(EXAMPLES / "estop" / "scenario.yaml")
    assert repr(run) == "<Run of 'estop': virtual, 3000 ms, 1 connection, passed>"


def test_the_first_program_has_ten_lines():
    first = re.search(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len([line for line in first[1].splitlines() if line.strip()]) <= 10


@pytest.mark.parametrize("path", [*BROKEN, EXAMPLES / "estop/network.yaml"], ids=lambda p: p.stem)
def test_the_library_finds_what_the_command_finds_and_compiles_nothing_with_an_error(path):
    network = fsoe_net.load(path)
    found = network.check()
    command = fsn("check", str(path), "--format", "json")
    assert found.to_json() == json.loads(command.stdout)
    if found.ok:
        assert network.compile().to_bytes()
        return
    with pytest.raises(fsoe_net.InputError) as refused:
        network.compile()
    assert refused.value.diagnostics == found.errors


def test_unusable_arguments_raise_errors_with_a_reason():
    with pytest.raises(ValueError, match="at least one path"):
        fsoe_net.load()
    lost = fsoe_net.load("no-such-file.yaml")
    assert (lost.name, [f.code for f in lost.check()]) == ("no-such-file", ["FSN101"])
    with pytest.raises(fsoe_net.InputError, match="no plan: 1 error"):
        lost.compile()
    with pytest.raises(fsoe_net.InputError, match="no-such-file cannot be compared"):
        lost.diff(lost)
    network = fsoe_net.load(EXAMPLES / "estop" / "network.yaml")
    with pytest.raises(fsoe_net.InputError, match="no-such-plan cannot be compared"):
        network.diff("no-such-plan")
    with pytest.raises(fsoe_net.InputError, match="is not a complete scan document"):
        network.check(scan=EXAMPLES / "estop" / "network.yaml")
    with pytest.raises(ValueError, match="start"):
        network.report(against="a", accepted="b")
    with pytest.raises(ValueError, match=r"ends in none of \.html"):
        network.report().save("report.txt")
    with pytest.raises(ValueError, match="capture needs virtual=True"):
        network.simulate(capture="a.pcapng", virtual=False)
    with pytest.raises(ValueError, match="to='x' is not a format; there are eni, igh, c, lcec"):
        fsoe_net.convert(EXAMPLES / "estop" / "network.yaml", to="x")
    with pytest.raises(fsoe_net.InputError, match="no-such-answers cannot be used"):
        fsoe_net.propose(answers="no-such-answers")
    with pytest.raises(fsoe_net.EnvironmentFault, match="no answer on"):
        fsoe_net.connect("/no/such.sock")


def test_programs_of_users_are_typed_strictly(tmp_path):
    pytest.importorskip("mypy", reason="mypy is not installed; pip install -e '.[lint]'")
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    program = tmp_path / "program.py"
    program.write_text("".join(blocks), "utf-8")
    strict = ["--strict", "--config-file", os.devnull, "--follow-imports", "silent"]
    words = [sys.executable, "-m", "mypy", *strict, "--cache-dir", str(tmp_path), str(program)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stdout == "Success: no issues found in 1 source file\n"


def test_a_scan_gives_what_the_command_gives(tmp_path):
    base = ROOT / "tests" / "diagnostics" / "base"
    bus = json.loads((base / "scan.json").read_text("utf-8"))
    gone = bus["subdevices"].pop()
    scan = tmp_path / "scan.json"
    scan.write_text(json.dumps(bus), "utf-8")
    command = fsn("check", str(base / "network.yaml"), "--scan", str(scan), "--format", "json")
    found = fsoe_net.load(base / "network.yaml").check(scan=scan)
    assert found.to_json() == json.loads(command.stdout)
    assert [f.code for f in found.errors] == ["FSN501"], gone
    part = fsoe_net.load(base / "devices" / "ek1914.yaml")
    with pytest.raises(fsoe_net.InputError, match="compared with a whole network"):
        part.check(scan=scan)
