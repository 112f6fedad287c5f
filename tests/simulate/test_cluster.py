"""A campaign on a Dask cluster: the bytes of one machine, dead workers, invalid results."""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import time
from dataclasses import replace

import pytest
from dask_cluster import one_scheduler, three_workers  # noqa: F401 - fixtures
from networks import EXAMPLES, example
from patience import PATIENCE_S

from fsoe_net.campaign.trials import CampaignConfig, Failure, run_trials
from fsoe_net.cli.main import main
from fsoe_net.errors import EnvironmentFault
from fsoe_net.report.campaign import to_json
from fsoe_net.simulate import campaign, workers
from fsoe_net.simulate import cluster as cluster_module
from fsoe_net.simulate.campaign import campaign_links, run_campaign
from fsoe_net.simulate.cluster import ClusterWorkers, run_pieces

CONFIG = CampaignConfig(links=campaign_links(example("el6910")), seed=1)
NETWORK = str(EXAMPLES / "estop" / "network.yaml")


@pytest.mark.weekly
def test_results_are_those_of_one_machine_even_if_a_worker_dies(cluster, monkeypatch):
    monkeypatch.setattr(campaign, "_CHUNK", 100)
    address, (first, *others) = cluster
    names, seen = ("corruption", "loss", "late_cycle"), []

    def on_progress(done: int, total: int, _name: str) -> None:
        # With three workers busy and more work waiting for each.
        if not seen:
            os.kill(first.pid, signal.SIGKILL)
            first.wait()
        seen.append((done, total))

    far = run_campaign(CONFIG, names, 1000, cluster=address, on_progress=on_progress)
    assert first.returncode == -signal.SIGKILL
    assert [process.poll() for process in others] == [None, None]
    here = run_campaign(CONFIG, names, 1000, jobs=1)
    assert json.dumps(to_json(far)) == json.dumps(to_json(here))
    assert far == here
    assert seen == sorted(set(seen))
    assert seen[-1] == (3000, 3000)


def test_a_stopped_campaign_leaves_the_cluster_without_work(cluster, monkeypatch):
    from distributed import Client

    monkeypatch.setattr(campaign, "_CHUNK", 50)
    address, _ = cluster

    def stop(_done: int, _total: int, _name: str) -> None:
        raise KeyboardInterrupt

    result = run_campaign(CONFIG, ("loss",), 100_000, cluster=address, on_progress=stop)
    assert result.interrupted
    assert result.classes[0].injected == 50
    with Client(address, set_as_default=False) as client:
        end = time.monotonic() + PATIENCE_S
        while any(client.processing().values()):
            assert time.monotonic() < end
            time.sleep(0.05)


def test_a_module_that_is_missing_on_the_workers_is_named(cluster, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "only_here.py").write_text("def run(piece):\n    return piece\n")
    address, processes = cluster
    run = importlib.import_module("only_here").run
    there = ClusterWorkers[int, int](address, run, lambda _part, _piece: True)

    def all_run(_running: object = None) -> None:
        assert [process.poll() for process in processes] == [None, None, None]

    with pytest.raises(EnvironmentFault, match="No module named 'only_here'"):
        list(run_pieces([1], there, every_s=0.1, waiting=all_run))
    all_run()


def test_a_scheduler_without_workers_is_reported(scheduler):
    address, _ = scheduler
    with pytest.raises(EnvironmentFault, match="has no worker"):
        run_campaign(CONFIG, ("loss",), 10, cluster=address)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "127.0.0.1", "nowhere://x", ""])
def test_an_address_without_a_scheduler_is_reported(address, monkeypatch):
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr(cluster_module, "_CONNECT_S", 0.2)
    with pytest.raises(EnvironmentFault, match="no Dask scheduler at"):
        run_campaign(CONFIG, ("loss",), 10, cluster=address)


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        EnvironmentFault, match="--cluster needs distributed, which is not installed"
    ):
        run_campaign(CONFIG, ("loss",), 10, cluster="tcp://127.0.0.1:1")


def test_processes_of_this_machine_do_not_go_with_a_cluster(monkeypatch, capsys):
    arguments = ["campaign", NETWORK, "--jobs", "2", "--cluster", "tcp://127.0.0.1:1"]
    monkeypatch.setattr(sys, "argv", ["fsoe-net", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "--jobs" in capsys.readouterr().err


def test_results_of_other_work_are_rejected():
    piece = (0, "loss", range(10))
    part = run_trials(CONFIG, "loss", range(10))
    link = CONFIG.links[0].name
    failure = Failure(trial=10, link=link, reason=""), Failure(trial=0, link="other", reason="")
    assert workers.is_of(part, CONFIG, piece)
    for wrong in (
        None,
        replace(part, name="delay"),
        replace(part, injected=11),
        replace(part, detected=part.detected + 1),
        replace(part, detected=-1, tolerated=part.tolerated + part.detected + 1),
        replace(part, detected=float(part.detected)),
        *(replace(part, failures=[row]) for row in failure),
    ):
        assert not workers.is_of(wrong, CONFIG, piece), wrong
