"""An interrupted campaign continues from a file of its completed work."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from networks import EXAMPLES, example

from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.trials import CampaignConfig, Failure, Shown, run_trials
from fsoe_net.cli.main import main
from fsoe_net.errors import EnvironmentFault, FsnError, InputError
from fsoe_net.simulate import campaign
from fsoe_net.simulate.campaign import CampaignResult, campaign_links, run_campaign
from fsoe_net.simulate.device_logic import device_factory

LINKS = campaign_links(example("el6910"))
CONFIG = CampaignConfig(links=LINKS, seed=1)
NAMES = ("bit_errors", "loss")
FAULTS = 30


def cut_small(patch: pytest.MonkeyPatch) -> None:
    """Let a campaign have small pieces."""
    patch.setattr(campaign, "_CHUNK", 10)
    patch.setattr(campaign, "trial_count", lambda _config, _name, faults: faults)


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    cut_small(monkeypatch)


def run(
    file: Path | None, *, config: CampaignConfig = CONFIG, until: int = 10**9
) -> CampaignResult:
    """Run the campaign, and interrupt it after so many faults."""

    def stop(done: int, _total: int, _name: str) -> None:
        if done >= until:
            raise KeyboardInterrupt

    return run_campaign(config, NAMES, FAULTS, jobs=1, resume=file, on_progress=stop)


@pytest.fixture(scope="module")
def whole() -> CampaignResult:
    """The result of a run that was not interrupted."""
    with pytest.MonkeyPatch.context() as patch:
        cut_small(patch)
        return run(None)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What two pieces of six leave."""
    file = tmp_path_factory.mktemp("kept") / "kept"
    with pytest.MonkeyPatch.context() as patch:
        cut_small(patch)
        assert run(file, until=20).interrupted
    return file.read_bytes()


@pytest.fixture
def kept(tmp_path: Path, interrupted: bytes) -> Path:
    """A file of two pieces of six."""
    file = tmp_path / "kept"
    file.write_bytes(interrupted)
    return file


def test_the_result_is_that_of_one_run(
    kept: Path, whole: CampaignResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = kept.read_bytes().splitlines(keepends=True)
    assert len(lines) == 1 + 2
    # As other processes complete them.
    kept.write_bytes(b"".join([lines[0], *reversed(lines[1:])]))
    done = []
    monkeypatch.setattr(
        campaign, "run_trials", lambda *a, real=campaign.run_trials: (done.append(a), real(*a))[1]
    )
    assert run(kept) == whole
    assert len(done) == 6 - 2
    assert run(kept) == whole
    assert len(done) == 6 - 2, "nothing is left to do"


def test_a_line_that_was_cut_is_done_again(kept: Path, whole: CampaignResult) -> None:
    kept.write_bytes(kept.read_bytes()[:-30])
    assert run(kept) == whole
    assert run(kept) == whole, "the file is whole again"


def test_the_progress_begins_with_what_is_done(kept: Path) -> None:
    seen: list[int] = []
    run_campaign(
        CONFIG, NAMES, FAULTS, jobs=2, resume=kept, on_progress=lambda done, *_: seen.append(done)
    )
    assert seen[:2] == [10, 20]
    assert seen[-1] == 60


@pytest.mark.parametrize(
    "config",
    [
        replace(CONFIG, seed=2),
        replace(CONFIG, links=LINKS[:1]),
        replace(CONFIG, links=(replace(LINKS[0], cycle_ns=2_000_000), *LINKS[1:])),
        replace(
            CONFIG,
            links=tuple(
                replace(k, sub_factory=device_factory("fsoe.broken_devices:deaf")) for k in LINKS
            ),
        ),
    ],
)
def test_another_campaign_is_refused(kept: Path, config: CampaignConfig) -> None:
    before = kept.read_bytes()
    with pytest.raises(InputError, match="is not of this campaign"):
        run(kept, config=config)
    assert kept.read_bytes() == before


def changed(line: bytes, **other: object) -> bytes:
    """Return a line with other values in its result."""
    index, row = json.loads(line)
    return json.dumps([index, row | other]).encode() + b"\n"


@pytest.mark.parametrize(
    "change",
    [
        lambda _: b"\n",
        lambda _: b"\xff\xfe\n",
        lambda _: b"[" * 100_000 + b"\n",
        lambda _: b"x" * (1 << 21) + b"\n",
        lambda line: b"[-1," + line.partition(b",")[2],
        lambda line: b"[99," + line.partition(b",")[2],
        lambda line: b"[0.0," + line.partition(b",")[2],
        lambda line: changed(line, injected=9, detected=9),
        lambda line: changed(line, injected=True),
        lambda line: changed(line, expected="1"),
        lambda line: changed(line, expected=float("nan")),
        lambda line: changed(line, exposed=-1),
        lambda line: changed(line, latency_sum_ns=1.5),
        lambda line: changed(line, latency_min_ns="0"),
        lambda line: changed(line, codes=[["0", 1]]),
        lambda line: changed(line, failures=[[0, "nobody", ""]]),
        lambda line: changed(line, failures=[[0, LINKS[0].name, 5]]),
        lambda line: changed(line, shown=[[0, LINKS[0].name, "end", "", "", 0, 0]]),
        lambda line: changed(line, shown=[[0, LINKS[0].name, "main", "zz", "", 0, 0]]),
        lambda line: changed(line, more=1),
    ],
)
def test_a_line_that_is_no_result_is_refused_at_its_place(kept: Path, change) -> None:
    lines = kept.read_bytes().splitlines(keepends=True)
    before = b"".join([*lines[:1], change(lines[1]), *lines[2:]])
    kept.write_bytes(before)
    with pytest.raises(InputError, match="kept:2: not a result of this campaign"):
        run(kept)
    assert kept.read_bytes() == before


def test_what_cannot_be_written_is_named(kept: Path, tmp_path: Path) -> None:
    (tmp_path / "other").write_text("of a user\n", "utf-8")
    for file in (tmp_path, tmp_path / "no" / "folder", tmp_path / "other", Path("/dev/full")):
        with pytest.raises(FsnError, match=file.name):
            run(file)
    assert (tmp_path / "other").read_text("utf-8") == "of a user\n"
    with (
        campaign.KeptCampaign(tmp_path / "new", CONFIG, []),
        pytest.raises(EnvironmentFault, match="in use by another campaign"),
    ):
        campaign.KeptCampaign(tmp_path / "new", CONFIG, [])


def test_a_full_disk_is_named_and_what_fits_is_kept(kept: Path, whole: CampaignResult) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (kept.stat().st_size + 20, limits[1]))
    try:
        with pytest.raises(EnvironmentFault, match=r"cannot write .*kept: File too large"):
            run(kept)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert run(kept) == whole


def test_failures_and_proofs_of_collisions_are_kept(tmp_path: Path) -> None:
    work = [(0, "loss", range(10))]
    link = LINKS[0].name
    proof = Collision(end="sub", frame=b"\x36\0\xff", right=b"\x36\1", old_crc=0xFFFF, sequence=7)
    part = replace(
        run_trials(CONFIG, *work[0][1:]),
        failures=[Failure(trial=3, link=link, reason="“a\n\x1b[2J”")],
        shown=[Shown(trial=9, link=link, proof=proof)],
        expected=1 / 3,
    )
    with campaign.KeptCampaign(tmp_path / "kept", CONFIG, work) as kept:
        assert kept.parts == {}
        kept.add(0, part)
    with campaign.KeptCampaign(tmp_path / "kept", CONFIG, work) as kept:
        assert kept.parts == {0: part}


def test_the_command_continues(tmp_path: Path, capsys, monkeypatch) -> None:
    def run_main(*arguments: str) -> object:
        monkeypatch.setattr(sys, "argv", ["fsoe-net", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code

    network = str(EXAMPLES / "estop" / "network.yaml")
    call = ["campaign", network, "--faults", "loss", "--cycles", "100", "--format", "json"]
    assert run_main(*call) == 0
    whole = capsys.readouterr().out
    kept = str(tmp_path / "kept")
    for _ in range(2):
        assert run_main(*call, "--resume", kept) == 0
        assert capsys.readouterr().out == whole
    assert run_main(*call, "--resume", kept, "--seed", "1") == 1
    assert "is not of this campaign" in capsys.readouterr().err


def test_a_killed_campaign_loses_no_completed_piece(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    program = [sys.executable, "-m", "fsoe_net.cli", "campaign", "--jobs", "1", "--faults", "loss"]
    network = str(EXAMPLES / "estop" / "network.yaml")
    with subprocess.Popen(
        [*program, network, "--cycles", "99999999", "--resume", str(kept)]
    ) as one:
        while not kept.exists() or kept.read_bytes().count(b"\n") < 2:
            assert one.poll() is None
            time.sleep(0.05)
        one.kill()
    assert json.loads(kept.read_bytes().splitlines()[1])[0] == 0
