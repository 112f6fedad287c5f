"""What is drawn in the page is what the network means; what no change touches stays as it is."""

from __future__ import annotations

import contextlib
import itertools
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from networks import write_big_network

from fsoe_net.errors import InputError
from fsoe_net.studio.workspace import Workspace

EXAMPLES = Path(__file__).parents[2] / "examples"
NETWORKS = sorted(p.parent.name for p in EXAMPLES.glob("*/network.yaml"))


@pytest.mark.uncounted
@pytest.mark.parametrize("name", NETWORKS)
def test_every_connection_is_drawn_again_as_it_was(tmp_path: Path, name: str) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    workspace = Workspace(str(tmp_path / "examples" / name / "network.yaml"))
    before = workspace.text
    drawn = workspace.checked.resolution.connections
    facts = {(c.main.name, c.sub.name, c.slot): c.stated for c in drawn}
    for _ in drawn:
        workspace.change(workspace.version, {"change": "disconnect", "connection": 0})
    assert workspace.checked.resolution.connections == ()
    kept = [line for line in before.splitlines() if line.startswith("#")]
    assert [line for line in workspace.text.splitlines() if line.startswith("#")] == kept
    for c in drawn:
        ends = {"main": c.main.name, "slot": c.slot, "sub": c.sub.name, "sub_slot": c.sub_slot}
        workspace.change(workspace.version, {"change": "connect", **ends})
    for number, c in enumerate(workspace.checked.resolution.connections):
        stated = facts[c.main.name, c.sub.name, c.slot]
        for key in ("address", "connection_id", "watchdog_ms"):
            change = {"change": "set", "connection": number, "key": key}
            workspace.change(workspace.version, {**change, "value": getattr(stated, key)})
        workspace.change(workspace.version, {"change": "confirm", "connection": number})
    again = workspace.checked.resolution.connections
    assert {(c.main.name, c.sub.name, c.slot, c.sub_slot) for c in again} == {
        (c.main.name, c.sub.name, c.slot, c.sub_slot) for c in drawn
    }
    assert [d for d in workspace.checked.diagnostics if d.level.value == "error"] == []
    for sub in workspace.checked.resolution.network.subdevices:
        change = {"change": "place", "subdevice": sub.name, "position": sub.position + 100}
        workspace.change(workspace.version, change)
    moved = workspace.checked.resolution.network.subdevices
    assert all(sub.position >= 100 for sub in moved)
    while workspace.can_undo:
        workspace.undo(workspace.version)
    assert workspace.text == before


@st.composite
def written(draw: st.DrawFn) -> str:
    """Return a network as somebody may have written it: order of keys, forms, comments, blanks."""
    count = itertools.count(1)

    def comment(indent: str = "") -> list[str]:
        kind = draw(st.sampled_from(["", "", "own", "blank"]))
        return [f"{indent}# note {next(count)}"] if kind == "own" else [""] * (kind == "blank")

    def tail() -> str:
        return draw(st.sampled_from(["", "", "  # note {}", " "])).format(next(count))

    def item(values: dict[str, object], indent: str) -> list[str]:
        pairs = [f"{key}: {value}" for key, value in draw(st.permutations(list(values.items())))]
        if draw(st.booleans()):
            return [f"{indent}- {{{', '.join(pairs)}}}{tail()}"]
        return [f"{indent}{'  ' if n else '- '}{pair}{tail()}" for n, pair in enumerate(pairs)]

    subs = draw(st.integers(1, 4))
    quote = draw(st.sampled_from(["{}", '"{}"', "'{}'"]))
    step = draw(st.sampled_from(["", "  "]))
    lines = [*comment(), "version: 1", f"cycle_us: 1000{tail()}", "subdevices:"]
    for n in range(subs + 1):
        values = {"name": quote.format(f"s{n}"), "position": n}
        values["config"] = "terminal.yaml" if n else "logic.yaml"
        lines += comment(step) + item(values, step)
    lines += [*comment(), "nets:", f"{step}- name: cell{tail()}", f"{step}  connections:"]
    for n in range(subs):
        values = {"main": "s0", "sub": f"s{n + 1}", "slot": n}
        numbers = {"address": n + 1, "connection_id": draw(st.just(n + 1) | st.just(hex(n + 1)))}
        numbers["watchdog_ms"] = draw(st.integers(50, 500))
        values |= {key: numbers[key] for key in numbers if draw(st.integers(0, 4))}
        if not draw(st.integers(0, 3)):
            values["unconfirmed"] = "proposed"
        lines += comment(f"{step}    ") + item(values, f"{step}    ")
    lines += comment()
    return "\n".join(lines) + draw(st.sampled_from(["", "\n", "\n\n"]))


def meaning(workspace: Workspace) -> list[object]:
    """Return what a network says, wherever it stands in the file."""
    resolution = workspace.checked.resolution
    said = [(c.main.name, c.sub.name, c.slot, c.sub_slot) for c in resolution.connections]
    keys = ("address", "connection_id", "watchdog_ms", "unconfirmed")
    stated = [[getattr(c.stated, key) for key in keys] for c in resolution.connections]
    return [[(s.name, s.position) for s in resolution.network.subdevices], said, stated]


CHANGES = st.fixed_dictionaries(
    {
        "change": st.sampled_from(["set", "confirm", "disconnect", "place", "rename", "network"]),
        "connection": st.integers(0, 3),
        "key": st.sampled_from(["address", "connection_id", "watchdog_ms"]),
        "value": st.none() | st.integers(1, 65534),
        "subdevice": st.sampled_from(["s0", "s1", "s2"]),
        "position": st.integers(0, 9),
        "name": st.sampled_from(["left", "right"]),
        "cycle_us": st.just(2000),
    }
)


@pytest.mark.uncounted
@settings(max_examples=30)
@given(written(), st.sampled_from(["\n", "\r\n"]), st.lists(CHANGES, max_size=4))
def test_drawn_files_keep_what_no_change_touches(
    folder: Path, text: str, end: str, changes: list[dict[str, object]]
) -> None:
    file = folder / "network.yaml"
    given_bytes = text.replace("\n", end).encode("utf-8")
    file.write_bytes(given_bytes)
    workspace = Workspace(str(file))
    workspace.save(workspace.version)
    assert file.read_bytes() == given_bytes  # nothing was changed

    notes = set(re.findall(r"# note \d+", text))
    for change in changes:
        before = workspace.text
        with contextlib.suppress(InputError):  # there is no such connection, or it is confirmed
            workspace.change(workspace.version, change)
        lost = [line for line in before.splitlines() if line not in workspace.text.splitlines()]
        assert len(lost) <= 12, lost
        left = set(re.findall(r"# note \d+", workspace.text))
        # A note in the line of a value that is removed goes with it.
        gone = change["change"] == "confirm" or (
            change["change"] == "set" and change["value"] is None
        )
        assert len(notes - left) <= int(gone) or change["change"] == "disconnect", (before, change)
        notes = left
    workspace.save(workspace.version)
    assert meaning(Workspace(str(file))) == meaning(workspace)
    assert workspace.text.count("\r\n") == (workspace.text.count("\n") if end == "\r\n" else 0)

    while workspace.can_undo:
        workspace.undo(workspace.version)
    workspace.save(workspace.version)
    assert file.read_bytes() == given_bytes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the device files of drawn networks."""
    made = tmp_path_factory.mktemp("drawn")
    write_big_network(made, 2, 2)
    return made
