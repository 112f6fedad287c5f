"""Campaigns over a network: its connections, many processes, interruption, the command."""

import dataclasses
import gc
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from live.children import none_left
from networks import EXAMPLES, example
from patience import PATIENCE_S

from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.recording.replay import replay_file
from fsoe_net.campaign.trials import CampaignConfig
from fsoe_net.cli.main import main
from fsoe_net.document.write_markdown import document_markdown
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.report.campaign import campaign_document, to_json
from fsoe_net.simulate import campaign as campaign_module
from fsoe_net.simulate import workers as workers_module
from fsoe_net.simulate.campaign import campaign_links, run_campaign, save_failures
from fsoe_net.simulate.device_logic import device_factory

ROBOT = example("el6910")
NETWORK = str(EXAMPLES / "el6910" / "network.yaml")


def _config(seed=1, **changes) -> CampaignConfig:
    return CampaignConfig(links=campaign_links(ROBOT, **changes), seed=seed)


def test_connections_are_those_of_the_network():
    links = campaign_links(ROBOT)
    assert [link.name for link in links] == [
        "el6910-el1904",
        "el6910-el2904",
        "el6910-drive_1",
        "el6910-drive_2",
    ]
    drive = links[2]
    assert drive.sizes == (4, 14)
    assert drive.cycle_ns == 1_000_000
    main, other = drive.main, drive.other
    assert (main.connection_id, main.address, main.watchdog_ms) == (3, 201, 100)
    assert main.app_parameters == b"\1\0\0\0"
    assert drive.sub.app_parameter_bytes == 4
    assert other.connection_id == 4  # the other drive
    assert links[0].other.connection_id == 2
    (only,) = campaign_links(ROBOT, connection="el6910-drive_2")
    assert only == links[3]
    with pytest.raises(InputError, match="no connection 'x'; there are el6910-el1904"):
        campaign_links(ROBOT, connection="x")


def test_a_lonely_connection_gets_a_made_up_neighbour():
    (link,) = campaign_links(example("estop"))
    assert link.other.connection_id != link.main.connection_id
    assert link.other.address != link.main.address
    with pytest.raises(InputError, match="no FSoE connection"):
        campaign_links(dataclasses.replace(ROBOT, connections=()))


def test_as_many_processes_as_wanted_give_one_result(monkeypatch):
    monkeypatch.setattr(campaign_module, "_CHUNK", 100)
    names, seen = ("corruption", "loss", "late_cycle"), []
    alone = run_campaign(_config(), names, 350, jobs=1)
    many = run_campaign(_config(), names, 350, jobs=3, on_progress=lambda *row: seen.append(row))
    assert many == alone
    assert [row.name for row in many.classes] == list(names)
    assert all(row.injected == 350 for row in many.classes)
    assert [done for done, _, _ in seen] == sorted({done for done, _, _ in seen})
    assert seen[-1][:2] == (1050, 1050)
    assert not many.interrupted
    assert many.passed


def test_interrupted_campaigns_tell_what_was_done(monkeypatch):
    monkeypatch.setattr(campaign_module, "_CHUNK", 50)
    monkeypatch.setattr(campaign_module, "_SHOWN_EVERY_S", 0)

    def stop(done, _total, _name):
        if done >= 100:
            raise KeyboardInterrupt

    result = run_campaign(_config(), ("loss", "delay"), 200, jobs=1, on_progress=stop)
    assert result.interrupted
    (row,) = result.classes
    assert (row.name, row.injected) == ("loss", 100)
    assert "incomplete" in text_of(result)
    assert to_json(result)["passed"] is False


def test_interruption_leaves_no_process(monkeypatch):
    monkeypatch.setattr(campaign_module, "_CHUNK", 50)
    monkeypatch.setattr(campaign_module, "_SHOWN_EVERY_S", 60)  # stop when a piece is done

    def stop(_done, _total, _name):
        raise KeyboardInterrupt

    result = run_campaign(_config(), ("late_cycle",), 100_000, jobs=2, on_progress=stop)
    assert result.interrupted
    assert result.classes[0].injected == 50
    gc.collect()
    assert none_left()


def test_a_process_that_does_not_listen_is_killed(monkeypatch):
    monkeypatch.setattr(campaign_module, "_CHUNK", 20_000)
    monkeypatch.setattr(campaign_module, "_SHOWN_EVERY_S", 0.01)
    monkeypatch.setattr(workers_module, "_STOP_S", 0.01)

    def stop(_done, _total, _name):
        raise KeyboardInterrupt

    config = _config(sub_factory=device_factory("fsoe.broken_devices:deaf"))
    assert run_campaign(config, ("loss",), 100_000, jobs=2, on_progress=stop).interrupted
    gc.collect()
    assert none_left()


_ENDLESS = """
from networks import example
from fsoe_net.campaign.trials import CampaignConfig
from fsoe_net.simulate.campaign import campaign_links, run_campaign
config = CampaignConfig(links=campaign_links(example("estop")))
run_campaign(config, ("loss",), 10**9, jobs=2, on_progress=lambda *row: print(row, flush=True))
"""


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_a_campaign_that_is_killed_leaves_no_process_and_no_semaphore(end):
    """The process of `multiprocessing` that removes semaphores ends after the last worker."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", _ENDLESS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env) as parent:
        assert parent.stdout is not None
        parent.stdout.readline()
        children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
        parent.send_signal(end)
    assert len(children) == 3
    until = time.monotonic() + PATIENCE_S
    while running := [pid for pid in children if Path(f"/proc/{pid}").exists()]:
        assert time.monotonic() < until, running
        time.sleep(0.01)


def test_devices_that_raise_are_named_also_from_another_process():
    config = _config(sub_factory=device_factory("fsoe.devices:raising_sub"))
    with pytest.raises(EnvironmentFault, match="cucumber"):
        run_campaign(config, ("loss",), 20, jobs=2)


def text_of(*arguments) -> str:
    return document_text(campaign_document(*arguments), width=None)


def test_failing_cases_are_saved(tmp_path):
    config = _config(sub_factory=device_factory("fsoe.devices:ignores_crc"))
    result = run_campaign(config, ("corruption", "loss"), 60, jobs=1)
    saved = save_failures(result, tmp_path / "new" / "folder")
    assert len(saved) == 5
    assert {name for name, _ in saved} == {"corruption"}
    for path in saved.values():
        assert replay_file(path).differences
    assert "-> " in text_of(result, {key: str(path) for key, path in saved.items()})


def test_json_and_text_name_the_same_results(tmp_path):
    result = run_campaign(_config(), ("corruption", "loss+torn_copy"), 200, jobs=1)
    found = to_json(result)
    assert json.loads(json.dumps(found)) == found
    first, second = found["classes"]
    assert first["name"] == "corruption"
    assert second["kind"] == "loss + corruption"
    for row in found["classes"]:
        total = sum(
            row[key]
            for key in (
                "detected",
                "tolerated",
                "collisions",
                "wrongly_accepted",
                "wrong_reactions",
            )
        )
        assert total == row["injected"] == 200
        coded = sum(row["reset_codes"].values()) + row["detected_without_code"]
        assert coded == row["detected"]
    page = document_markdown(campaign_document(result))
    assert "| corruption | 200 |" in page
    assert "| el6910-drive\\_2 | 4 | 202 | 4 | 14 | 100 ms | 1 ms |" in page
    assert "**✔ passed: nothing wrongly accepted, every reaction right**" in page
    row = result.classes[0]
    row.exposed_collisions = row.collisions = 9
    assert "9 collisions, 0.00 expected" in text_of(result)
    assert "collisions are not as many" in text_of(result)


# ----------------------------------------------------------------------------------- the command


def _call(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["fsoe-net", "campaign", *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    out, err = capsys.readouterr()
    return caught.value.code, out, err


@pytest.fixture
def fsn(monkeypatch, capsys):
    return lambda *arguments: _call(monkeypatch, capsys, *arguments)


def test_text_report_has_a_row_per_class(fsn):
    code, out, err = fsn(NETWORK, "--faults", "late_cycle,loss", "--cycles", "64")
    assert code == 0
    assert out.splitlines()[:3] == [
        "Fault campaign",
        "seed 0, 64 faults per class",
        "passed: nothing wrongly accepted, every reaction right",
    ]
    rows = [line.split() for line in out.splitlines()]
    head = next(n for n, row in enumerate(rows) if row[:2] == ["class", "injected"])
    assert rows[head] == [
        *("class", "injected", "detected", "tolerated", "collisions", "plausible", "wrong"),
        *("latency", "mean", "max", "max", "/", "watchdog"),
    ]
    assert rows[head + 1] == ["late_cycle", *("64", "0", "64", "0", "-", "0"), *"---"]
    assert err.startswith("128 faults in ")


def test_json_to_a_file(fsn, tmp_path):
    path = tmp_path / "campaign.json"
    names = [name for name in CATALOGUE if name != "bit_errors"]
    code, out, err = fsn(
        *(NETWORK, "--faults", ",".join(names), "--cycles", "40", "--seed", "9"),
        *("--format", "json", "-o", str(path), "--connection", "el6910-drive_1", "--jobs", "1"),
    )
    found = json.loads(path.read_text("utf-8"))
    assert (code, out) == (0, "")
    assert f"report written to {path}" in err
    assert [row["name"] for row in found["classes"]] == names
    assert [row["name"] for row in found["connections"]] == ["el6910-drive_1"]
    assert (found["seed"], found["faults_per_class"], found["passed"]) == (9, 40, True)


@pytest.mark.uncounted
def test_a_broken_device(fsn, tmp_path):
    folder = tmp_path / "traces"
    code, out, err = fsn(
        *(NETWORK, "--faults", "corruption", "--cycles", "60", "--save-dir", str(folder)),
        *("--sub", "fsoe.devices:ignores_crc", "--format", "json"),
    )
    assert code == 1
    (row,) = json.loads(out)["classes"]
    assert row["wrongly_accepted"] > 10
    assert [case["trace"] for case in row["failures"]] == [str(p) for p in _in_order(folder)]
    assert f"next: `fsoe-net campaign --replay {folder}/*.jsonl`" in err
    _, out, err = fsn(NETWORK, "--faults", "corruption", "--sub", "fsoe.devices:ignores_crc")
    assert "FAILED" in out
    assert "next: repeat it with --save-dir DIR" in err


def _in_order(folder):
    return sorted(folder.iterdir(), key=lambda path: int(path.stem.split("-")[1]))


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (("--faults", "corupt"), 2, "Did you mean 'corruption'?"),
        (("--faults", "loss+dealy"), 2, "Did you mean 'delay'?"),
        (("--faults", "xyz"), 2, "There are all, bit_errors, corruption"),
        (("--faults", "loss+bit_errors"), 2, "go with nothing else"),
        (("--faults", ""), 2, "no class ''"),
        (("--cycles", "0"), 2, "--cycles"),
        (("--seed", "-1"), 2, "--seed"),
        (("--connection", "x"), 1, "no connection 'x'; there are el6910-el1904"),
        (("--sub", "x"), 1, "not module:factory"),
        (("--main", "fsoe.devices:no_end", "--faults", "loss"), 3, "test-your-device.md"),
        (("--sub", "fsoe.devices:dead_sub", "--faults", "loss"), 3, "does not reach state Data"),
        (("-o", "/no/such/folder/x", "--faults", "loss", "--cycles", "1"), 3, "/no/such/folder/x"),
    ],
)
def test_mistakes_of_a_user(fsn, arguments, code, text):
    found, _, err = fsn(NETWORK, *arguments)
    assert found == code
    assert text in err
    assert "Traceback" not in err


def test_files_that_are_not_network(fsn, tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text("version: 1\nname: x\n", "utf-8")
    code, _, err = fsn(str(path))
    assert code == 1
    assert "no fault put in" in err


def test_help_shows_examples(fsn):
    code, out, _ = fsn("--help")
    assert code == 0
    assert "fsoe-net campaign network.yaml --sub my_device:make_sub --save-dir traces" in out
