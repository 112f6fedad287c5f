"""Results of a campaign: its report, its recordings and the final line."""

from __future__ import annotations

import json
from pathlib import Path

from fsoe_net.cli.terminal import echo, show
from fsoe_net.document.write_markdown import document_markdown
from fsoe_net.document.write_terminal import document_text
from fsoe_net.errors import EnvironmentFault, FsnError, InputError
from fsoe_net.formats.shared.write_files import STDOUT, write_whole
from fsoe_net.report.campaign import Saved, campaign_document, to_json
from fsoe_net.simulate.campaign import (
    CampaignResult,
    save_failures,
)

EPILOG = """\b
Examples:
  fsoe-net campaign network.yaml
  fsoe-net campaign network.yaml --faults corruption,loss --cycles 1000000 --seed 7
  fsoe-net campaign network.yaml --faults loss+torn_copy
  fsoe-net campaign network.yaml --sub my_device:make_sub --save-dir traces
  fsoe-net campaign network.yaml --format json -o campaign.json
  fsoe-net campaign --replay traces/*.jsonl

Fault classes: docs/reference/fault-catalogue.md; a + b combines two. Both ends run in virtual time;
nothing is sent to a bus. For --sub and --main see docs/howto/test-your-device.md.

Exit codes: 0 no wrong data were accepted, each end followed its state table, and collisions and
tolerated faults are within the limits of the catalogue; 1 otherwise, or a file has an error.
With --replay: 0 every recording replays; 1 a difference, or a file is not a recording. 2 usage
error; 130 interrupted, with the result so far; the same command with --resume continues."""


def write_report(
    result: CampaignResult, saved: Saved, fmt: str, output: str | None, *, overwrite: bool
) -> None:
    """Write a report to a file; print it if there is no file or it cannot be written."""
    document = campaign_document(result, saved)
    if fmt == "text" and output is None:
        show(document, width=100)
        return
    if fmt == "json":
        text = json.dumps(to_json(result, saved), indent=2, ensure_ascii=False) + "\n"
    elif fmt == "markdown":
        text = document_markdown(document)
    else:
        text = document_text(document)
    if output is None:
        echo(text, nl=False)
        return
    try:
        write_whole(output, text.encode(), overwrite=overwrite)
    except (EnvironmentFault, InputError):
        echo(text, nl=False)  # not lost if the disk is full or the file exists by now
        raise


def save_recordings(result: CampaignResult, folder: str | None) -> tuple[Saved, Exception | None]:
    """Return the recordings, and an error if there was one: the report is printed in any case."""
    saved: dict[tuple[str, int], str] = {}
    if not folder:
        return saved, None
    try:
        found = save_failures(result, Path(folder))
    except (OSError, FsnError) as exc:
        return saved, exc
    for case, path in found.items():
        if path is None:
            echo(f"{case[0]}, trial {case[1]}: fails only after a long run, no trace", err=True)
        else:
            saved[case] = str(path)
    return saved, None


def print_end(
    result: CampaignResult,
    elapsed_s: float,
    output: str | None,
    save_dir: str | None,
    resume: str | None,
) -> None:
    """Print how much was done, where the report is, and the next step after a failure."""
    done = sum(row.injected for row in result.classes)
    rate = f"{done / elapsed_s:.0f}" if elapsed_s > 0 else "?"
    speed = f" in {elapsed_s:.1f} s, {rate} per second"
    echo(f"{done} faults" + (f", with those in {resume}" if resume else speed), err=True)
    if output is not None and output != STDOUT:
        echo(f"report written to {output}", err=True)
    if result.interrupted:
        echo("interrupted: the report holds what was done until then", err=True)
        if resume:
            echo("next: the same command continues", err=True)
    if not result.passed and not result.interrupted:
        step = f"`fsoe-net campaign --replay {save_dir}/*.jsonl` shows each failure"
        if save_dir is None:
            step = "repeat it with --save-dir DIR; it records each failure for --replay"
        echo(f"next: {step}", err=True)
