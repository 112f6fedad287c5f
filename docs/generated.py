"""What is made when the documentation is built: help of commands, examples and tables of findings.

An example is what `check` prints for the mistake of that code in tests/diagnostics/cases.yaml.
"""

from __future__ import annotations

import contextlib
import difflib
import importlib.util
import io
import re
import shutil
import tempfile
from pathlib import Path

import click
from shown import sections

from fsoe_net.bench.document import bench_document
from fsoe_net.bench.result import read_result
from fsoe_net.cli.main import GROUPS, cli
from fsoe_net.cli.options import named_folders
from fsoe_net.cli.output import print_diagnostics
from fsoe_net.diag.catalogue import CATALOGUE
from fsoe_net.document.style import PICTURES, STYLE
from fsoe_net.document.write_markdown import document_markdown
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve
from fsoe_net.project.check import check_files
from fsoe_net.report.network_picture import network_picture
from fsoe_net.report.robot_boxes import robot_graph
from fsoe_net.report.robot_picture import robot_picture
from fsoe_net.rules.effects import effects_today
from fsoe_net.rules.runtime import Runtime

ROOT = Path(__file__).resolve().parents[1]
CASES = ROOT / "tests" / "diagnostics"
MOST = 6  # lines of one run of added or removed ones
EXAMPLES = {  # on the first page, with the page that uses each
    "estop": "tutorial/ten-minutes.md",
    "el6910": "howto/run-live.md",
    "robot-cell": "howto/emulate.md",
    "two-buses": "howto/several-buses.md",
    "tool-exchange": "howto/several-buses.md",
}
FAMILIES = {
    "1": "Loading",
    "2": "Copies",
    "3": "FSoE",
    "4": "Devices and layout",
    "5": "Live bus",
    "6": "Timing",
}

spec = importlib.util.spec_from_file_location("test_cases", CASES / "test_cases.py")
cases = importlib.util.module_from_spec(spec)
spec.loader.exec_module(cases)


def _shorten(rows: list[str]) -> list[str]:
    more = [f"{rows[0][0]} (and {len(rows) - MOST} more lines)"] if len(rows) > MOST else []
    return rows[:MOST] + more


def _diff(folder: Path, file: str) -> list[str]:
    base = CASES / "base" / file
    old = base.read_text("utf-8").splitlines() if base.is_file() else []
    new = (folder / file).read_text("utf-8").splitlines()
    rows: list[str] = []
    for tag, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if tag != "equal":
            rows.append(f"@@ {file}, line {c + 1} @@")
            rows += _shorten([f"- {line}" for line in old[a:b]])
            rows += _shorten([f"+ {line}" for line in new[c:d]])
    # What cannot be seen is written out.
    return [re.sub(r"[^\S \n]", lambda m: f"<U+{ord(m[0]):04X}>", row) for row in rows]


def _changed(folder: Path, file: str) -> set[tuple[str, int]]:
    """Return the lines of a file that are not those of the clean one; a removed one is line 0."""
    clean = CASES / "base" / file
    before = clean.read_text("utf-8", "replace").split("\n") if clean.is_file() else []
    after = (folder / file).read_text("utf-8", "replace").split("\n")
    changed = set()
    for tag, _, _, start, end in difflib.SequenceMatcher(
        None, before, after, autojunk=False
    ).get_opcodes():
        if tag in ("replace", "insert"):
            changed |= {(file, line) for line in range(start + 1, end + 1)}
        elif tag == "delete":
            changed.add((file, 0))
    return changed


def _example(code: str, case: dict) -> str:
    command, runtime = " ".join(case.get("check", ())), Runtime(case.get("runtime", "fsn"))
    named_folders.add(".")  # lines of the files are shown
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "case"
        shutil.copytree(CASES / "base", folder)
        cases._seed(folder, case)
        with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()) as out:
            found = cases.findings(case)
            print_diagnostics([d for d in found if d.code == code], runtime=runtime)
        # The output shows the line of a finding; only what is changed elsewhere needs a diff.
        shown = {(d.span.file, d.span.line) for d in found if d.code == code}
        files = dict.fromkeys(row[0] for row in (*case.get("edit", ()), *case.get("write", ())))
        diffs = [_diff(folder, file) for file in files if not _changed(folder, file) <= shown]
    diff = "\n".join(line for rows in diffs for line in rows)
    diff = f"```diff\n{diff}\n```\n\n" if diff else ""
    if "scan" in case:
        command += f" --scan {case['scan']}"
    if runtime is not Runtime.FSN:
        command += f" --runtime {runtime.value}"
    also = ", ".join(f"[{other}]({other}.md)" for other in case.get("also", ()))
    if "reader" in case:
        choice = ", ".join(f"{key}={value:#x}" for key, value in case.get("choice", {}).items())
        choice = f", choice=EsiChoice({choice})" if choice else ""
        prompt = f">>> {case['reader'].rpartition('.')[2]}({case['check'][0]!r}, out{choice})"
    elif "init" in case:
        answers = f" --answers {case['answers']}" if "answers" in case else ""
        prompt = f"$ fsoe-net init {' '.join(case['init'])}{answers}"
    else:
        prompt = f"$ fsoe-net check {command}"
    more = f"\nRaised by the same edit: {also}.\n" if also else ""
    return f"{diff}```text\n{prompt}\n{out.getvalue()}```\n{more}"


def _effects() -> str:
    names = "ethercat_driver_ros2"
    ros2 = [r for r in Runtime if r.value.startswith("ros2-")]
    rows = ["| finding | program | does today |", "|---|---|---|"]
    for code in CATALOGUE:
        for runtimes, text in effects_today(code):
            who = names if list(runtimes) == ros2 else ", ".join(f"`{r.value}`" for r in runtimes)
            rows.append(f"| [{code}](../diagnostics/{code}.md) | {who} | {text} |")
    return "\n".join(rows) + "\n"


def _codes() -> str:
    parts = []
    for digit, title in FAMILIES.items():
        parts.append(f"## {title} (FSN{digit}xx)\n\n| code | severity | title |\n|---|---|---|")
        rows = [row for code, row in CATALOGUE.items() if code[3] == digit]
        parts += [f"| [{r.code}]({r.code}.md) | {r.severity} | {r.title} |" for r in rows]
        parts.append("")
    return "\n".join(parts)


def fill_in(page: str, text: str) -> str:
    """Return the text of a page, such as ``diagnostics/FSN101``, with what is made."""
    code = page.rpartition("/")[2]
    if page == "diagnostics/index":
        return text.replace("<!-- codes -->\n", _codes())
    if page == "index":
        return text.replace("<!-- gallery -->\n", _gallery())
    if page == "howto/ros2":
        return text.replace("<!-- robot -->\n", _robot())
    if page == "reference/validation":
        return text.replace("<!-- requirements -->\n", sections())
    if page == "performance/index":
        return text.replace("<!-- reports -->\n", _reports())
    if page == "reference/runtimes":
        return text.replace("<!-- effects -->\n", _effects())
    if page != f"diagnostics/{code}" or code not in CATALOGUE:
        return text
    title, _, rest = text.partition("\n")
    what, _, fix = rest.partition("**Fix.**")
    example = _example(code, cases.CASES[code])
    return (
        # 220 entries in the navigation of each page would be most of the site.
        f"---\norphan: true\n---\n{title}\n\n*{CATALOGUE[code].severity}*, one of "
        f"[all diagnostics](index.md)\n{what}{example}\n**Fix.**{fix}"
    )


def _gallery() -> str:
    """Return a card for each example: what it is, a drawing, and the page that uses it."""
    cards = []
    for name, page in EXAMPLES.items():
        network = load_network([ROOT / "examples" / name / "network.yaml"]).network
        title = network.project.removeprefix("Example, ")
        cards.append(
            f":::{{container}} card\n**{title[0].upper()}{title[1:]}**\n\n"
            f'<div class="picture">{network_picture(resolve(network), [])}</div>\n\n'
            f"`examples/{name}`, in []({page})\n:::\n"
        )
    return "::::{container} cards gallery\n" + "\n".join(cards) + "::::\n"


def _reports() -> str:
    """Return the report of each machine, one heading below the page."""
    parts = []
    for file in sorted((ROOT / "docs" / "performance").glob("*.json")):
        _, _, report = document_markdown(bench_document(read_result(str(file)))).partition("\n")
        parts.append(f"## {file.stem}\n{report}")
    return "\n".join(parts)


def _robot() -> str:
    """Return the drawing of a robot, as `fsoe-net graph` makes it."""
    folder = ROOT / "examples" / "robot-cell"
    checked = check_files([str(folder / name) for name in ("robot.urdf.xacro", "controllers.yaml")])
    drawing = robot_picture(robot_graph(checked.resolution, checked.diagnostics))
    return f'<div class="picture">{drawing}</div>\n'


def picture_style() -> str:
    """Return the style of our drawings on a page, in the colours of its theme."""
    light, dark = re.findall(r":root\{(.*?)\}", STYLE.replace("\n", ""))[:2]
    is_dark = 'body[data-theme="dark"] .picture'
    return (
        f".picture {{ {light}; {PICTURES} }}\n{is_dark} {{ {dark} }}\n"
        "@media (prefers-color-scheme: dark) "
        f"{{ {is_dark.replace('dark', 'auto')} {{ {dark} }} }}\n"
    )


def commands() -> str:
    """Return the page with the help of each command."""
    root = click.Context(cli, info_name="fsoe-net", terminal_width=100)
    head = "# Commands\n\nAs `--help` prints them. [The command line](cli.md) has what all share.\n"
    parts = [head]
    for title, names in GROUPS.items():
        links = ", ".join(f"[{name}](#{name})" for name in names)
        parts.append(f"**{title}:** {links}\n")
    for name in cli.list_commands(root):
        parts.append(f"## {name}\n\n{_help(cli, name, root)}")
    return "\n".join(parts)


def _help(group: click.Group, name: str, parent: click.Context) -> str:
    command = group.commands.get(name) or cli.get_command(parent, name)
    if command is None:
        raise KeyError(name)
    context = click.Context(command, info_name=name, parent=parent, max_content_width=100)
    parts = [f"```text\n{command.get_help(context)}\n```\n"]
    if isinstance(command, click.Group):
        for inner in command.list_commands(context):
            parts.append(f"### {name} {inner}\n\n{_help(command, inner, context)}")
    return "\n".join(parts)
