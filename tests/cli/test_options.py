"""Options of all commands: one name for one thing, one type for times and files, one rule."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from cli.tool import commands, fsn
from networks import EXAMPLES

from fsoe_net.cli.main import cli
from fsoe_net.cli.options import CYCLE, FILE, FOLDER, NETWORK_FILE, RUN_TIME, Time
from fsoe_net.model.times import time_ns, time_text

ROOT = Path(__file__).parents[2]
ESTOP = str(EXAMPLES / "estop" / "network.yaml")
# A name that was chosen for each thing, and those that were given up for it.
GIVEN_UP = {
    "--socket": ("--live SOCKET", "--live PATH"),
    "--duration": ("--seconds", "--run-time"),
    "--redundant": ("--interface2",),
    "--device-period": ("--device-period-ms",),
}
# -o is where to write: a folder where a command writes several files.
SEVERAL_TYPES = {"--output": {"file", "folder"}}


def options() -> Iterator[tuple[str, click.Option]]:
    for name, command in commands():
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                yield name, parameter


def long_name(option: click.Option) -> str:
    return next((o for o in option.opts if o.startswith("--")), option.opts[0])


def kind(option: click.Option) -> str:
    return "flag" if option.is_flag else option.type.name


def test_one_name_has_one_type():
    types = defaultdict(set)
    for _, option in options():
        types[long_name(option)].add(kind(option))
    several = {name: found for name, found in types.items() if len(found) > 1}
    assert several == SEVERAL_TYPES


def test_one_thing_has_one_name():
    names = defaultdict(set)
    for _, option in options():
        names[option.name].add(long_name(option))
        if option.metavar in ("IF", "IF2", "SOCKET", "PLAN"):
            names[option.metavar].add(long_name(option))
        if option.help:
            names[option.help].add(long_name(option))
    assert {what: found for what, found in names.items() if len(found) > 1} == {}


def test_a_flag_that_disturbs_a_bus_is_not_an_address():
    found = {c: kind(o) for c, o in options() if long_name(o) == "--live"}
    assert found == {"test-record": "flag"}
    addresses = {long_name(o) for _, o in options() if o.metavar in ("IF", "IF2", "PATH")}
    assert addresses == {"--interface", "--redundant", "--socket"}


@pytest.mark.parametrize("given_up", [old for names in GIVEN_UP.values() for old in names])
def test_a_name_that_was_given_up_is_nowhere(given_up: str):
    places = ["fsoe_net", "master_core", "docs", "examples", "scripts", "README.md", "Makefile"]
    files = [
        path
        for place in places
        for path in ([ROOT / place] if (ROOT / place).is_file() else (ROOT / place).rglob("*"))
        if path.is_file() and path.suffix not in (".so", ".pyc", ".png")
    ]
    pattern = re.compile(rf"(?<![\w-]){re.escape(given_up)}(?![\w-])".encode())
    assert [str(p.relative_to(ROOT)) for p in files if pattern.search(p.read_bytes())] == []


def test_times_and_files_have_one_type_each():
    for command, option in options():
        place = f"{command} {long_name(option)}"
        if option.metavar == "TIME" or isinstance(option.type, Time):
            assert option.metavar == "TIME", place
            assert isinstance(option.type, Time), place
        assert not isinstance(option.type, click.Path | click.File), place
        if option.metavar in ("FILE", "PLAN", "SCRIPT", "PATH"):
            assert option.type in (FILE, NETWORK_FILE), place
        if option.metavar == "DIR":
            assert option.type is FOLDER, place


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("30", 30_000_000_000),
        ("30s", 30_000_000_000),
        ("0.5", 500_000_000),
        ("500ms", 500_000_000),
        ("2min", 120_000_000_000),
        ("168h", 604_800_000_000_000),
    ],
)
def test_times_are_taken_as_people_write_them(text: str, ns: int):
    assert RUN_TIME.convert(text, None, None) == ns


@pytest.mark.parametrize(
    ("type_", "text", "words"),
    [
        (RUN_TIME, "soon", "'soon' is not a time; write 30s, 500ms or 2min"),
        (RUN_TIME, "nan", "'nan' is not a time; write 30s, 500ms or 2min"),
        (RUN_TIME, "-1", "'-1' is not a time; write 30s, 500ms or 2min"),
        (RUN_TIME, "2 weeks", "'2 weeks' is not a time; write 30s, 500ms or 2min"),
        (RUN_TIME, "0", "0 is out of range: 1ms to 168h"),
        (RUN_TIME, "169h", "169h is out of range: 1ms to 168h"),
        (CYCLE, "1", "'1' has no unit; write 1ms or 1us"),
        (CYCLE, "1us", "1us is out of range: 50us to 1s"),
    ],
)
def test_other_times_are_refused_with_the_forms_that_are_taken(type_: Time, text: str, words: str):
    with pytest.raises(click.BadParameter) as told:
        type_.convert(text, None, None)
    assert str(told.value) == words


def advice() -> list[tuple[str, str]]:
    """Options with a time in any message, help, page or script of the project."""
    found = set()
    for folder, suffixes in (
        ("fsoe_net", {".py"}),
        ("master_core", {".c", ".h"}),
        ("docs", {".md"}),
        ("examples", {".md", ".service"}),
        ("scripts", {""}),
    ):
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and path.suffix in suffixes:
                text = path.read_text("utf-8", "replace")
                found |= set(re.findall(r"(--[a-z][a-z-]+)[ =]([0-9][0-9.]*(?:[a-z]+)?)\b", text))
    return sorted(found)


def test_every_time_in_a_message_or_page_is_taken():
    times = defaultdict(list)
    for command, option in options():
        if isinstance(option.type, Time):
            times[long_name(option)].append((command, option.type))
    tried = 0
    for name, text in advice():
        for _command, type_ in times[name]:
            tried += 1
            type_.convert(text, None, None)  # raises with what is wrong
    assert tried >= 10


def options_by_command(group: click.Group) -> Iterator[tuple[str, set[str]]]:
    """Yield each command with its options; a group has those of all its commands."""
    for name in group.list_commands(click.Context(group)):
        command = group.get_command(click.Context(group), name)
        assert command is not None
        inner = dict(options_by_command(command)) if isinstance(command, click.Group) else {}
        own = [p for p in command.params if isinstance(p, click.Option)]
        opts = {o for p in own for o in (*p.opts, *p.secondary_opts)}
        yield name, opts.union({"--help"}, *inner.values())


def written_commands() -> Iterator[tuple[str, str, str]]:
    """Yield each `fsoe-net COMMAND …` of any page, message or script: where, command, rest."""
    for place in ("README.md", "CONTRIBUTING.md", "docs", "fsoe_net", "examples", "scripts"):
        for path in [ROOT / place] if (ROOT / place).is_file() else (ROOT / place).rglob("*"):
            if path.is_file() and path.suffix in (".md", ".py", ".yaml", ".service", ".fsn", ""):
                lines = path.read_text("utf-8", "replace").replace("\\\n", "").splitlines()
                for number, line in enumerate(lines, 1):
                    for command, rest in re.findall(r"fsoe-net ([a-z][a-z-]*)([^`|;&#)]*)", line):
                        yield f"{path.relative_to(ROOT)}:{number}", command, rest


def test_every_option_of_a_written_command_exists():
    known = dict(options_by_command(cli))
    tried = 0
    wrong = []
    for place, command, rest in written_commands():
        for option in re.findall(r"(?<![\w-])(--[a-z][a-z-]*|-[a-zA-Z])(?![\w-])", rest):
            tried += command in known
            if option not in known.get(command, {option}):
                wrong.append(f"{place}: {command} {option}")
    assert wrong == []
    assert tried > 300


def test_a_time_is_written_as_it_is_read():
    for text in ("0s", "250us", "1ms", "90s", "2min", "168h"):
        assert time_text(time_ns(text)) == text


WRITERS = {
    "plan": f"{ESTOP} -o OUT.fsnplan",
    "convert": f"{ESTOP} -o OUT.yaml",
    "graph": f"{ESTOP} -o OUT.svg",
    "report": f"{ESTOP} -o OUT.md",
    "campaign": f"{ESTOP} --faults loss --cycles 1 --jobs 1 -o OUT.txt",
    "decode": f"--lua {ESTOP} -o OUT.lua",
    "timing": f"{ESTOP} --plot OUT.svg",
    "test-record": f"{ESTOP} -o OUT.html",
    "init": f"{ESTOP} -o OUT --no-input",
    "run": f"{ESTOP} --virtual-time --duration 10ms --capture OUT.pcapng",
    "studio": f"{ESTOP} --snapshot OUT.html",
}


def test_every_command_that_writes_has_the_flag():
    written = {"--output", "--capture", "--plot", "--stats", "--snapshot", "--record"}
    writers = {c for c, o in options() if long_name(o) in written}
    with_flag = {c for c, o in options() if long_name(o) == "--overwrite"}
    assert writers == with_flag - {"acceptance sign"}  # it writes next to the record
    assert set(WRITERS) == writers - {
        "acceptance record",
        "bench",
        "ros2",
        "log export",
        "log incident",
        "install-master",
        "monitor",
        "scan",
    }  # have own tests


@pytest.mark.parametrize("command", WRITERS)
def test_a_file_that_exists_is_replaced_only_with_overwrite(command: str, tmp_path: Path):
    words = WRITERS[command].replace("OUT", str(tmp_path / "x")).split()
    first = fsn(command, *words)
    made = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    assert made, first.stderr
    for path in made:
        path.write_bytes(b"precious")
    again = fsn(command, *words)
    assert again.returncode == 1
    assert re.search(
        r"^error: nothing written: \S+ exists; .*--overwrite\n\Z", again.stderr, re.MULTILINE
    ), again.stderr
    assert again.stdout == ""
    assert {p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == {b"precious"}
    done = fsn(command, *words, "--overwrite")
    assert done.returncode == first.returncode, done.stderr
    assert sorted(made) == sorted(p for p in tmp_path.rglob("*") if p.is_file())
    assert b"precious" not in {p.read_bytes() for p in made}


def test_documents_come_from_standard_input_and_go_to_standard_output():
    text = Path(ESTOP).read_text("utf-8").replace("devices/", f"{EXAMPLES}/estop/devices/")
    done = subprocess.run(
        _tool("plan", "-", "-o", "-"),
        input=text.encode(),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"FSNPLAN")
    assert b"fingerprint" in done.stderr
    shown = subprocess.run(
        _tool("plan", "--show", "-"),
        input=done.stdout,
        capture_output=True,
        check=False,
    )
    assert shown.returncode == 0, shown.stderr
    assert b"el1918" in shown.stdout


def _tool(*words: str) -> list[str]:
    return [sys.executable, "-m", "fsoe_net.cli", *words]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("campaign --replay x.jsonl --seed 3", "--seed does not go with --replay"),
        ("campaign --replay", "--replay takes recordings"),
        ("init --list --answers x", "--answers does not go with --list"),
        ("init --format json", "--device-file and --format belong to --list"),
        (f"plan {ESTOP} --canonical copies -o x", "--output does not go with --canonical"),
        (f"plan {ESTOP} --format json -o x", "-o writes a plan file"),
        ("doctor --self-test --interface x", "leave out --interface"),
    ],
)
def test_an_option_that_would_be_ignored_is_a_usage_error(words: str, said: str, tmp_path: Path):
    done = fsn(*words.split(), cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("export --port many", "'many' is not a valid integer."),
        ("ros2 --rate fast", "'fast' is not a valid number."),
    ],
)
def test_a_word_for_a_number_is_named_plainly(words: str, said: str):
    done = fsn(*words.split())
    assert (done.returncode, done.stderr.splitlines()[-1].split(": ")[-1]) == (2, said)


def test_a_line_of_a_file_that_only_another_file_names_is_not_printed(tmp_path: Path):
    secret = tmp_path / "secret.yaml"
    device = (EXAMPLES / "estop" / "devices" / "ek1914.yaml").read_text("utf-8")
    secret.write_text(f"password: hunter2\n{device}", "utf-8")
    folder = tmp_path / "theirs"
    folder.mkdir()
    text = Path(ESTOP).read_text("utf-8").replace("devices/ek1914.yaml", str(secret))
    (folder / "network.yaml").write_text(text, "utf-8")
    done = fsn("check", str(folder))
    assert f"{secret}:1:1: info[FSN109]: unknown key 'password'" in done.stdout
    assert "hunter2" not in done.stdout + done.stderr
