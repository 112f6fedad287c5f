"""Entry point of ``fsoe-net``: collects the commands and turns exceptions into exit codes."""

from __future__ import annotations

import importlib
import io
import os
import signal
import sys

import click

from fsoe_net.cli.terminal import echo
from fsoe_net.errors import FilePresent, FsnError, InputError
from fsoe_net.version import __version__

# By task; also the order of the reference.
GROUPS = {
    "See it first": {
        "demo": "Run an emulated e-stop cell in a browser.",
    },
    "Find mistakes": {
        "check": "Check the files of a network, also against other files or a live bus.",
        "explain": "Explain a finding and how to fix it.",
        "graph": "Draw a robot: controllers, joints, channels, SubDevices.",
        "studio": "View and edit a network in a browser.",
        "plan": "Compile a network to a copy plan; show a plan and its fingerprint.",
    },
    "From the files you have": {
        "init": "Propose a network from files or a bus; list known FSoE devices.",
        "convert": "Convert a bus description to the format of another tool.",
        "diff": "Compare two descriptions or plans of a bus by meaning.",
    },
    "Run it on EtherCAT": {
        "install-master": "Build and install fsn-master, which drives a live bus.",
        "run": "Run a network on an emulated or a live bus.",
    },
    "Operate it": {
        "doctor": "Check this machine for real-time EtherCAT; test this installation.",
        "bench": "Measure how well this machine keeps a cycle.",
        "scan": "Read a live bus and write files to start from.",
        "log": "Explain incident files; show, verify and export the intervention log.",
        "monitor": "Watch a running fsn-master: connections, SubDevices, timing.",
        "console": "Control a running fsn-master, interactively or by script.",
        "export": "Serve metrics of running fsn-masters for Prometheus.",
        "ros2": "Publish a running fsn-master to ROS 2: diagnostics, joints, values.",
    },
    "Hand it in": {
        "timing": "Print the timing budget: watchdogs, reaction times, their limits.",
        "test-record": "Write a checklist of tests; run those that need no machine.",
        "report": "Write the report of a network.",
        "acceptance": "Record, sign and verify the accepted configuration.",
    },
    "Look into FSoE": {
        "decode": "Decode FSoE frames in hex or captures; write a Wireshark dissector.",
        "emulate": "Emulate the EtherCAT SubDevices of a network.",
        "campaign": "Inject faults into the connections of a network; replay recordings.",
    },
}
# Names that other tools use for a command.
_ALIASES = {"compile": "plan", "gui": "studio", "simulate": "run", "validate": "check"}
# Former and similar command names, with their replacement.
_INSTEAD = {
    "accept": "acceptance record",
    "devices": "init --list",
    "fingerprint": "plan",
    "incident": "log incident",
    "record": "acceptance record",
    "replay": "campaign --replay",
    "self-test": "doctor --self-test",
    "sign": "acceptance sign",
    "verify": "acceptance verify",
}
_COMMANDS = {name: about for group in GROUPS.values() for name, about in group.items()}


class _LazyGroup(click.Group):
    """Imports a command only when it is called, so that `check` starts fast and needs no core."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module = importlib.import_module(f"fsoe_net.cli.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and args[0] in ("help", "version"):
            args = [*args[1:], f"--{args[0]}"]
        if args:
            args = [_ALIASES.get(args[0], args[0]), *args[1:]]
        return super().parse_args(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        wide = max(map(len, _COMMANDS))
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(wide), text) for name, text in commands.items()])

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        # Click gives no hint for a misspelt command, or for a file given without a command.
        if args and args[0] not in _COMMANDS and not args[0].startswith("-"):
            from fsoe_net.diag.guesses import guesses, one_of

            meant = _INSTEAD.get(args[0])
            close = (meant,) if meant else guesses(args[0], _COMMANDS, cutoff=0.5)
            hint = f" Did you mean {one_of([repr(c) for c in close])}?" if close else ""
            if os.path.exists(args[0]):
                hint = f" To check a file: fsoe-net check {args[0]}"
            raise click.UsageError(f"No command {args[0]!r}.{hint}", ctx)
        return super().resolve_command(ctx, args)


_EPILOG = """\b
Examples:
  fsoe-net check examples/estop/network.yaml
  fsoe-net plan examples/estop/network.yaml -o estop.fsnplan
  fsoe-net run examples/estop/network.yaml --scenario examples/estop/scenario.yaml

Exit codes: 0 done; 1 findings, differences, a failed run or an invalid file; 2 usage error;
3 environment: a permission, device, socket or disk is missing; 130 interrupted.

Shell completion: eval "$(_FSOE_NET_COMPLETE=bash_source fsoe-net)" (also zsh, fish).

Part of the black channel: no safety function, not certified."""


_VERSION = """%(prog)s, version %(version)s
Part of the black channel: no safety function, not certified, not for the protection of persons by
itself. EtherCAT and Safety over EtherCAT are registered trademarks and patented technologies,
licensed by Beckhoff Automation GmbH, Germany."""


# https://no-color.org; editors and logs set TERM=dumb.
_COLOURS = False if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" else None


@click.command(
    cls=_LazyGroup,
    epilog=_EPILOG,
    context_settings={"max_content_width": 100, "color": _COLOURS},
)
@click.version_option(
    __version__,
    "-V",
    "--version",
    prog_name="fsoe-net",
    message=_VERSION,
)
def cli() -> None:
    """Check, compile, run and report FSoE (Safety over EtherCAT) networks."""


def main() -> None:
    """Run the command line and exit; no traceback for anything a user can cause."""
    try:
        sys.exit(cli.main(standalone_mode=False) or 0)
    except click.ClickException as exc:
        shown = io.StringIO()
        exc.show(shown)
        echo(shown.getvalue(), nl=False, err=True)
        sys.exit(exc.exit_code)
    except (click.Abort, KeyboardInterrupt):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # pressing it again prints no traceback
        echo("interrupted", err=True)
        sys.exit(130)
    except InputError as exc:
        from fsoe_net.cli.output import print_diagnostics

        option = " with --overwrite" if isinstance(exc, FilePresent) else ""
        echo(f"error: {exc.message}{option}", err=True)
        print_diagnostics(exc.diagnostics, err=True)
        sys.exit(exc.exit_code)
    except FsnError as exc:
        echo(f"error: {exc}", err=True)
        sys.exit(exc.exit_code)
    except ModuleNotFoundError as exc:  # a distribution may lack a package
        if (exc.name or "").startswith("fsoe_net"):
            raise
        from fsoe_net.diag.packages import missing_package

        echo(f"error: {missing_package('fsoe-net', exc.name, '')}", err=True)
        sys.exit(3)
    except BrokenPipeError:
        # The reader (such as `| head`) has closed the pipe; that is not an error.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as exc:
        name = f"{exc.filename}: " if exc.filename else ""
        echo(f"error: {name}{exc.strerror or exc}", err=True)
        sys.exit(3)
