"""``fsoe-net init --list``: the device library, as a list or one device in full."""

from __future__ import annotations

import json

import click

from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo, show
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.errors import InputError
from fsoe_net.formats.own.library import load_library
from fsoe_net.model.library import Library, LibraryDevice
from fsoe_net.report.device_page import device_json, device_list, device_text


def print_devices(names: tuple[str, ...], own: tuple[str, ...], fmt: str) -> None:
    """Print the devices of the library; with a name or order number, that device in full.

    Args:
        names: At most one.
        own: Device files that take precedence over the library.
        fmt: ``text`` or ``json``.

    Raises:
        click.UsageError: More than one name, or one that the library does not have.
        InputError: A device file is invalid.
    """
    if len(names) > 1:
        raise click.UsageError("--list takes one name or order number")
    name = names[0] if names else None
    library, found = load_library(own)
    errors = [d for d in found if d.level is Severity.ERROR]
    if errors:
        raise InputError("a device file cannot be used", errors)
    print_diagnostics(found, err=True)
    found_devices = library.devices if name is None else (_named(library, name),)
    if fmt == "json":
        rows = [device_json(d) for d in found_devices]
        echo(json.dumps({"devices": rows}, indent=2, ensure_ascii=False))
    elif name is None:
        show(device_list(found_devices))
    else:
        echo("\n".join(device_text(found_devices[0])))


def _named(library: Library, name: str) -> LibraryDevice:
    device = library.named(name)
    if device is None:
        from fsoe_net.diag.guesses import guesses, one_of

        known = [w for d in library.devices for w in (d.name, *(i.order for i in d.identities))]
        close = [repr(c) for c in guesses(name.upper(), known, cutoff=0.5)]
        hint = f" Did you mean {one_of(close)}?" if close else " `fsoe-net init --list` lists all."
        others = " Of others, `fsoe-net init` reads process data from an ESI, ENI or bus."
        raise click.BadParameter(f"no device {name!r} is known.{hint}{others}", param_hint="NAME")
    return device
