"""``fsoe-net bench``: measures this machine, and compares two results."""

from __future__ import annotations

import json
import os

import click

from fsoe_net.bench.document import bench_document, comparison_document
from fsoe_net.bench.measure import MOST_CYCLES, BenchPlan, bench
from fsoe_net.bench.result import read_result
from fsoe_net.cli.bus import ask_before
from fsoe_net.cli.options import CYCLE, FILE, INTERFACE, RUN_TIME, output_option, refuse_others
from fsoe_net.cli.terminal import echo, show
from fsoe_net.cli.write import check_target
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.shared.write_files import write_whole
from fsoe_net.host.seam import Host, Unreadable

_EPILOG = """\b
Examples:
  fsoe-net bench
  fsoe-net bench -o press-1.html
  fsoe-net bench --cycle 500us -o press-1.json
  sudo fsoe-net bench --wire -o press-1.json
  fsoe-net bench --compare before.json after.json

Only --interface sends anything to a bus, after a question: one EtherCAT frame per cycle with a NOP
datagram, which no SubDevice executes. Exit codes: 0 measured; 1 a file is not a result; 2 usage
error; 3 a program or a permission is missing, or fsn-master drives a bus on this machine."""

_ENDINGS = (".html", ".json")


@click.command("bench", epilog=_EPILOG)
@click.option(
    "--cycle",
    "cycle_ns",
    type=CYCLE,
    default="1ms",
    show_default=True,
    metavar="TIME",
    help="Period of the cycle.",
)
@click.option(
    "--duration",
    "duration_ns",
    type=RUN_TIME,
    default="10s",
    show_default=True,
    metavar="TIME",
    help="Time of each part.",
)
@click.option(
    "--wire",
    is_flag=True,
    help="Also frames over a veth pair: bare send() and recv(), SOEM's loop, fsn-master; as root.",
)
@click.option(
    "--interface",
    type=INTERFACE,
    metavar="IF",
    help="Also frames on this interface that no SubDevice executes; without fsn-master.",
)
@click.option("-y", "--yes", is_flag=True, help="Do not ask before frames are sent.")
@click.option(
    "--compare",
    nargs=2,
    type=FILE,
    metavar="A B",
    help="Compare two JSON results; measure nothing.",
)
@output_option("File to write: FILE.html, or FILE.json to compare it later.")
@click.pass_context
def command(
    ctx: click.Context,
    cycle_ns: int,
    duration_ns: int,
    wire: bool,
    interface: str | None,
    yes: bool,
    compare: tuple[str, str] | None,
    output: str | None,
    overwrite: bool,
) -> None:
    """Measure how well this machine keeps a cycle; about a minute, with a wire two.

    Wake-up of an empty timer and of the cycle of fsn-master, execution time, copies, the cost of a
    monitor, wake-up of a real-time client, rate of the emulator: in memory. --wire adds frames.
    """
    if output is not None and os.path.splitext(output)[1].lower() not in _ENDINGS:
        raise click.UsageError(f"-o {output}: name a file that ends in {' or '.join(_ENDINGS)}")
    if duration_ns > MOST_CYCLES * cycle_ns:
        raise click.UsageError(f"--duration: more than {MOST_CYCLES // 1_000_000} million cycles")
    check_target(output, overwrite=overwrite)
    if compare is not None:
        refuse_others(ctx, "--compare", "compare", "output", "overwrite")
        first, second = map(read_result, compare)
        document = comparison_document(first, second)
        values: dict[str, object] = {"a": first.to_json(), "b": second.to_json()}
    else:
        if wire and interface is not None:
            raise click.UsageError("--wire makes a pair of its own; leave it or --interface out")
        if interface is not None:
            _announce(interface, cycle_ns, yes=yes)
        plan = BenchPlan(
            cycle_ns=cycle_ns,
            seconds=duration_ns / 1e9,
            wire=wire or interface is not None,
            interface=interface,
        )
        try:
            result = bench(plan, Host(), lambda part: echo(f"measuring {part}", err=True))
        except Unreadable as exc:
            raise EnvironmentFault(str(exc)) from exc
        document, values = bench_document(result), result.to_json()
    if output is not None:
        is_json = output.lower().endswith(".json")
        text = json.dumps(values, indent=2) + "\n" if is_json else document_html(document)
        write_whole(output, text.encode("utf-8"), overwrite=overwrite)
    show(document, width=100)


def _announce(interface: str, cycle_ns: int, *, yes: bool) -> None:
    echo(
        f"bench sends {1e9 / cycle_ns:g} EtherCAT frames per second on {interface}, with a "
        "datagram that no SubDevice executes; it refuses if another MainDevice sends there",
        err=True,
    )
    if not yes:
        ask_before("this sends frames on an interface")
