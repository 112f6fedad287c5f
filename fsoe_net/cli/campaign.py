"""``fsoe-net campaign``: put faults into the connections of a network and count what happens."""

from __future__ import annotations

import os
import sys
import time
from contextlib import nullcontext
from pathlib import Path

import click

from fsoe_net.campaign.trials import CampaignConfig, class_names
from fsoe_net.cli.campaign_output import EPILOG, print_end, save_recordings, write_report
from fsoe_net.cli.inputs import input_options
from fsoe_net.cli.options import FILE, FOLDER, output_option, read_by, refuse_others
from fsoe_net.cli.progress import progress_bar
from fsoe_net.cli.replay import print_replay
from fsoe_net.cli.write import check_target, try_folder
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.project.check import check_files, whole_network
from fsoe_net.simulate.campaign import campaign_links, run_campaign
from fsoe_net.simulate.device_logic import device_factory, stdout_to_stderr


@click.command("campaign", epilog=EPILOG)
@input_options
@click.option(
    "--faults",
    "names",
    default="all",
    show_default=True,
    metavar="all|CLASS,…",
    callback=read_by(class_names),
    help="Fault classes.",
)
@click.option(
    "--cycles",
    type=click.IntRange(1, 10**9),
    default=20_000,
    show_default=True,
    help="Number of FSoE cycles with a fault, per class.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Seed. The same seed gives the same faults.",
)
@click.option(
    "--connection", metavar="NAME", help="Test only this connection (name as in `fsoe-net plan`)."
)
@click.option(
    "--jobs", type=click.IntRange(1, 1024), help="Number of processes. Default: one per core."
)
@click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Run on the workers of this Dask scheduler: tcp://…, tls://…",
)
@click.option(
    "--resume", type=FILE, metavar="FILE", help="Keep completed work here, and continue from it."
)
@click.option(
    "--sub", metavar="MODULE:FACTORY", help="Use your SubInstance instead of the built-in one."
)
@click.option(
    "--main", metavar="MODULE:FACTORY", help="Use your MainInstance instead of the built-in one."
)
@click.option(
    "--replay",
    "is_replay",
    is_flag=True,
    is_eager=True,
    help="FILES are recorded runs of FSoE implementations: compare each with this engine.",
)
@click.option(
    "--format",
    "fmt",
    type=click.Choice(["text", "json", "markdown"]),
    default="text",
    show_default=True,
)
@output_option("File to write; default: standard output.")
@click.option(
    "--save-dir", type=FOLDER, metavar="DIR", help="Folder for recordings of failing cases."
)
@click.pass_context
def command(
    ctx: click.Context,
    files: tuple[str, ...],
    loading: LoadOptions,
    names: tuple[str, ...],
    cycles: int,
    seed: int,
    connection: str | None,
    jobs: int | None,
    cluster: str | None,
    resume: str | None,
    sub: str | None,
    main: str | None,
    is_replay: bool,
    fmt: str,
    output: str | None,
    overwrite: bool,
    save_dir: str | None,
) -> None:
    """Inject seeded faults into the connections of a network and count the outcomes.

    FILES as for `check`. Sizes, ConnIDs, addresses, watchdogs and parameters are taken from the
    network.
    """
    if is_replay:
        refuse_others(ctx, "--replay", "is_replay", "fmt")
        if fmt == "markdown" or not files:
            raise click.UsageError("--replay takes recordings (*.jsonl), and prints text or JSON")
        ctx.exit(print_replay(files, fmt))
    if cluster is not None and jobs is not None:
        raise click.UsageError("--jobs are processes of this machine: leave it out with --cluster")
    checked = check_files(files, loading)
    resolution = whole_network(checked, "no fault put in")
    check_target(output, overwrite=overwrite, stdout=True)  # written hours later
    try_folder(save_dir)
    if main or sub:
        sys.path.insert(0, os.getcwd())  # the device is usually a module in the user's folder
    with stdout_to_stderr() if main or sub else nullcontext():
        links = campaign_links(
            resolution,
            connection=connection,
            main_factory=device_factory(main) if main else None,
            sub_factory=device_factory(sub) if sub else None,
        )
        config = CampaignConfig(links=links, seed=seed)
        start_s = time.monotonic()
        kept = Path(resume) if resume else None
        with progress_bar(names[0]) as bar:
            result = run_campaign(
                config, names, cycles, jobs=jobs, cluster=cluster, resume=kept, on_progress=bar
            )
        elapsed_s = time.monotonic() - start_s
        saved, broken = save_recordings(result, save_dir)
    # Written before an error is raised: hours of work must not be lost.
    write_report(result, saved, fmt, output, overwrite=overwrite)
    print_end(result, elapsed_s, output, save_dir, resume)
    if broken is not None:
        raise broken
    # 130 is what a shell returns after Ctrl-C.
    ctx.exit(130 if result.interrupted else int(not result.passed))
