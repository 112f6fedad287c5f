"""The arguments that all commands share: the files, and how references in them are followed."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar, cast

import click

from fsoe_net.cli.options import NETWORK, NETWORK_FILE, named_folders
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.rules.runtime import Runtime

_F = TypeVar("_F", bound=Callable[..., Any])


LOADING = ("packages", "xacro_args", "xacro_env", "trust_xacro")
"""Names of the options of `reference_options`."""


def _pair(separator: str, what: str) -> Callable[..., dict[str, str]]:
    def parse(
        _ctx: click.Context, _param: click.Parameter, values: Sequence[str]
    ) -> dict[str, str]:
        rows = {}
        for value in values:
            name, found, rest = value.partition(separator)
            if not found or not name:
                raise click.BadParameter(f"{value!r} is not {what}")
            rows[name] = rest
        return rows

    return parse


def network_of_folder(
    ctx: click.Context, _param: click.Parameter, files: tuple[str, ...]
) -> tuple[str, ...]:
    """Use the network of the current folder if no file is given."""
    if ctx.params.get("is_replay"):
        return files
    if files:
        return files
    if os.path.isfile(NETWORK):
        named_folders.add(".")
        return (NETWORK,)
    raise click.UsageError(f"name a network; there is no {NETWORK} in this folder")


def input_options(function: _F) -> _F:
    """Add FILES and the options of `reference_options` to a command."""
    argument = click.argument("files", nargs=-1, type=NETWORK_FILE, callback=network_of_folder)
    return reference_options(argument(function))


def reference_options(function: _F) -> _F:
    """Add the options for following references in files; they are passed as ``loading``."""

    @functools.wraps(function)
    def with_loading(
        *args: Any,
        packages: dict[str, str],
        xacro_args: dict[str, str],
        xacro_env: tuple[str, ...],
        trust_xacro: bool,
        **kwargs: Any,
    ) -> Any:
        named_folders.update(packages.values())
        loading = LoadOptions(
            packages=packages, xacro_args=xacro_args, xacro_env=xacro_env, trust_xacro=trust_xacro
        )
        return function(*args, loading=loading, **kwargs)

    for decorate in (
        click.option(
            "--trust-xacro",
            is_flag=True,
            help="Expand xacro without confinement. The file can then do anything that you can do.",
        ),
        click.option(
            "--env",
            "xacro_env",
            multiple=True,
            metavar="NAME",
            help="Environment variable that a xacro file may read with $(env NAME).",
        ),
        click.option(
            "--arg",
            "xacro_args",
            multiple=True,
            metavar="NAME:=VALUE",
            callback=_pair(":=", "NAME:=VALUE"),
            help="Argument for a xacro file.",
        ),
        click.option(
            "--package",
            "packages",
            multiple=True,
            metavar="NAME=DIR",
            callback=_pair("=", "NAME=DIR"),
            help="Folder of a ROS package for $(find NAME) and package://NAME.",
        ),
    ):
        with_loading = decorate(with_loading)
    return cast(_F, with_loading)


def master_option(function: _F) -> _F:
    """Add ``--master``; the command must also have `reference_options`, applied above it."""

    @functools.wraps(function)
    def with_master(*args: Any, master: str, loading: LoadOptions, **kwargs: Any) -> Any:
        return function(*args, loading=replace(loading, master=master), **kwargs)

    decorate = click.option(
        "--master",
        default="",
        metavar="MASTER",
        help="Number or name of the EtherCAT master to read from a URDF, TwinCAT project "
        "or linuxcnc-ethercat configuration with several masters.",
    )
    return cast(_F, decorate(with_master))


def runtime_option(function: _F) -> _F:
    """Add ``--runtime``."""
    return click.option(
        "--runtime",
        type=click.Choice([r.value for r in Runtime]),
        default=Runtime.FSN.value,
        show_default=True,
        help="Also report how this version of another program handles the same files.",
    )(function)
