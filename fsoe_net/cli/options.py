"""Types and options that several commands share, each with one name and one meaning."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from fsoe_net.model.times import time_ns, time_text

if TYPE_CHECKING:
    from fsoe_net.acceptance.ssh_signatures import SshSigners
    from fsoe_net.model.network import NetworkConfig

_F = TypeVar("_F", bound=Callable[..., Any])

# click puts these names into its sentence "'x' is not a valid …", where "integer range" is wrong.
click.IntRange.name, click.FloatRange.name = "integer", "number"


class Time(click.ParamType):  # type: ignore[type-arg]
    """A time in nanoseconds: ``30``, ``30s``, ``500ms``, ``2min``.

    Args:
        least: Smallest time, written as above.
        most: Largest time.
        bare: Whether a number without a unit is accepted, as seconds.
    """

    name = "time"

    def __init__(self, least: str, most: str, *, bare: bool = True) -> None:
        self._least_ns = time_ns(least) or 0
        self._most_ns = time_ns(most) or 0
        self._bare_ns = 1_000_000_000 if bare else 0

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> int:
        """Return nanoseconds; on error, list the accepted forms."""
        text = str(value)
        found = time_ns(text, bare_ns=self._bare_ns)
        if found is None:
            # A bare number is only accepted where its unit is obvious.
            if not self._bare_ns and time_ns(text, bare_ns=1) is not None:
                self.fail(f"{text!r} has no unit; write {text}ms or {text}us", param, ctx)
            example = "30s, 500ms or 2min" if self._bare_ns else "250us or 1ms"
            self.fail(f"{text!r} is not a time; write {example}", param, ctx)
        if not self._least_ns <= found <= self._most_ns:
            limits = f"{time_text(self._least_ns)} to {time_text(self._most_ns)}"
            self.fail(f"{text} is out of range: {limits}", param, ctx)
        return found


RUN_TIME = Time("1ms", "168h")
CYCLE = Time("50us", "1s", bare=False)  # the range that fsn-master accepts


named_folders: set[str] = set()
"""Folders of the files that the user named; lines of other files are not printed."""


class _Path(click.ParamType):  # type: ignore[type-arg]
    """A path. It is not opened here: the reader reports errors, with one exit code."""

    def __init__(self, name: str, completion: str) -> None:
        self.name = name
        self._completion = completion

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Return the path; record its folder if it is for reading."""
        path = str(value)
        if param is not None and param.name != "output":
            named_folders.add(path if os.path.isdir(path) else os.path.dirname(path) or ".")
        return path

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        return [CompletionItem(incomplete, type=self._completion)]


class _Folder(_Path):
    """A folder; ``-`` is rejected, because it means standard output everywhere."""

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Return the path; reject ``-``."""
        if value == "-":
            self.fail("- is standard output; name a folder, ./- where it is called so", param, ctx)
        return super().convert(value, param, ctx)


class _NetworkFile(_Path):
    """A file, or a folder with a network."""

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> str:
        """Return the path; for a folder, that of its network file."""
        path = super().convert(value, param, ctx)
        inside = os.path.join(path, NETWORK)
        return inside if os.path.isfile(inside) else path


NETWORK = "network.yaml"
"""Name of the network file in a folder."""
FILE = _Path("file", "file")
NETWORK_FILE = _NetworkFile("file", "file")
FOLDER = _Folder("folder", "dir")


class _Interface(click.ParamType):  # type: ignore[type-arg]
    """A network interface, with completion."""

    name = "interface"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from socket import if_nameindex

        with contextlib.suppress(OSError):
            names = sorted(name for _, name in if_nameindex())
            return [CompletionItem(n) for n in names if n.startswith(incomplete) and n != "lo"]
        return []


INTERFACE = _Interface()
INTERFACES = click.option(
    "--interface",
    "interfaces",
    type=INTERFACE,
    multiple=True,
    metavar="IF",
    help="Live bus: interface or IgH master. With several buses: BUS=IF for each.",
)


def _by_bus(given: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in given:
        name, _, interface = text.partition("=")
        if name not in names or not interface:
            raise click.UsageError(
                f"--interface {text}: this network has several buses; write BUS=IF, where BUS is "
                f"{' or '.join(names)}"
            )
        if name in found:
            raise click.UsageError(f"--interface {text}: this bus has one already")
        found[name] = interface
    return found


def interfaces_of(given: Sequence[str], network: NetworkConfig, *, own: bool) -> tuple[str, ...]:
    """Return the interface of each bus of a network, in order.

    Args:
        given: Values of ``--interface``.
        network: The network, which defines the buses.
        own: Whether to use the interfaces in its file if none is given.

    Raises:
        click.UsageError: An interface is missing, belongs to no bus, or is given twice.
    """
    if not network.buses:
        if len(given) != 1:
            raise click.UsageError("one --interface IF: this network has one bus")
        return tuple(given)
    names = [bus.name for bus in network.buses]
    found = {bus.name: bus.interface for bus in network.buses if own and bus.interface}
    found |= _by_bus(given, names)
    missing = [name for name in names if name not in found]
    if missing:
        raise click.UsageError(f"bus {missing[0]} has no interface: --interface {missing[0]}=IF")
    # Two buses on one interface would receive the frames of each other.
    if len(set(found.values())) < len(names):
        raise click.UsageError("--interface: two buses on one interface")
    return tuple(found[name] for name in names)


def master_options(function: _F) -> _F:
    """Add ``--socket`` and ``--interface``, which select a running fsn-master."""
    for decorate in (
        click.option(
            "--interface",
            type=INTERFACE,
            metavar="IF",
            help="Interface that fsn-master drives. Used to find its socket.",
        ),
        click.option(
            "--socket", type=FILE, metavar="PATH", help="Control socket of a running fsn-master."
        ),
    ):
        function = decorate(function)
    return function


def master_socket(socket: str | None, interface: str | None) -> str:
    """Return the control socket of the fsn-master selected by `master_options`.

    Raises:
        click.UsageError: None is selected, or two are.
    """
    if (socket is None) == (interface is None):
        raise click.UsageError("give either --socket PATH or --interface IF")
    if socket is not None:
        return socket
    from fsoe_net.live.sockets import control_socket

    return control_socket(interface or "")


def named_master(socket: str | None, interface: str | None) -> str | None:
    """Return the same as `master_socket`, but ``None`` if none is selected."""
    if socket is None and interface is None:
        return None
    return master_socket(socket, interface)


def refuse_others(ctx: click.Context, flag: str, *names: str) -> None:
    """Reject options that have no effect together with a flag.

    Args:
        ctx: Context of the command.
        flag: The flag, such as ``--list``.
        names: Names of the parameters that may be combined with it, including the flag itself.

    Raises:
        click.UsageError: Another option is given.
    """
    for param in ctx.command.params:
        # A default does not count: only an option that the user typed can be unused.
        given = ctx.get_parameter_source(param.name or "") is ParameterSource.COMMANDLINE
        if given and isinstance(param, click.Option) and param.name not in names:
            raise click.UsageError(f"{param.opts[-1]} does not go with {flag}")


def overwrite_option(function: _F) -> _F:
    """Add ``--overwrite``."""
    return click.option("--overwrite", is_flag=True, help="Replace existing files.")(function)


def output_option(
    help: str,  # noqa: A002 - as click names it
    *,
    metavar: str = "FILE",
    type: click.ParamType[str] = FILE,  # noqa: A002
    required: bool = False,
) -> Callable[[_F], _F]:
    """Add ``-o``/``--output`` and ``--overwrite``."""
    option = click.option(
        "-o", "--output", type=type, metavar=metavar, required=required, help=help
    )
    return lambda function: option(overwrite_option(function))


def read_by(read: Callable[[Any], object]) -> Callable[..., object]:
    """Return a click callback that reads a value; its ``ValueError`` is a usage error."""

    def callback(_ctx: click.Context, _param: click.Parameter, value: object) -> object:
        try:
            return read(value)
        except ValueError as exc:
            raise click.BadParameter(str(exc)) from exc

    return callback


def read_sha256(text: str | None) -> str:
    """Return a SHA-256 in lower case, or an empty string; `ValueError` if it is invalid."""
    if text is None:
        return ""
    if len(text) != 64 or set(text.lower()) - set("0123456789abcdef"):
        raise ValueError("a SHA-256 has 64 hexadecimal digits")
    return text.lower()


def read_moment(text: str | None) -> datetime | None:
    """Return a day or time, in UTC if it has no zone; `ValueError` if it is invalid."""
    if text is None:
        return None
    try:
        found = datetime.fromisoformat(text)
    except ValueError as exc:
        raise ValueError(f"{text!r} is not a time; write 2026-11-23 or 2026-11-23T08:00") from exc
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)


def format_option(function: _F) -> _F:
    """Add ``--format text|json``, as ``fmt``."""
    return click.option(
        "--format", "fmt", type=click.Choice(["text", "json"]), default="text", show_default=True
    )(function)


def signer_options(function: _F) -> _F:
    """Add ``--signers`` and ``--revoked``: the allowed signers of an acceptance record."""
    function = click.option(
        "--revoked",
        type=FILE,
        metavar="FILE",
        help="Revoked keys (an ssh-keygen revocation file).",
    )(function)
    return click.option(
        "--signers",
        type=FILE,
        metavar="FILE",
        help="Allowed signers (an ssh-keygen allowed_signers file).",
    )(function)


def read_signers(signers: str | None, revoked: str | None) -> SshSigners | None:
    """Read the files of `signer_options`.

    Raises:
        click.UsageError: ``--revoked`` is given alone.
        InputError: A file cannot be used.
    """
    if signers is None:
        if revoked is not None:
            raise click.UsageError("--revoked FILE goes with --signers FILE")
        return None
    from fsoe_net.acceptance.ssh_signatures import SshSigners

    return SshSigners.read(signers, revoked)


def scenario_option(function: _F) -> _F:
    """Add ``--scenario``, as ``scenario_file``."""
    return click.option(
        "--scenario",
        "scenario_file",
        type=FILE,
        metavar="FILE",
        help="YAML file with steps and expectations.",
    )(function)


def device_period_option(function: _F) -> _F:
    """Add ``--device-period``."""
    return click.option(
        "--device-period",
        "device_period_ns",
        type=Time("100us", "1s"),
        metavar="TIME",
        help="Cycle of the emulated devices in real time. Default: 1ms.",
    )(function)
