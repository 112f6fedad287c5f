"""Reads anything that describes a bus as one side of a comparison; recognised by content."""

from __future__ import annotations

import os

from fsoe_net.compare.sides import (
    Side,
    side_of_description,
    side_of_network,
    side_of_plan,
    side_of_scan,
)
from fsoe_net.diag.diagnostic import Severity, Span, sort_diagnostics
from fsoe_net.errors import InputError
from fsoe_net.formats.own.acceptance import is_acceptance, parse_acceptance
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.own.scan import parse_scan
from fsoe_net.formats.recognise import find_format
from fsoe_net.formats.registry import Format, Yields, read_foreign
from fsoe_net.formats.shared.files import Collector, read_bytes
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.accepted import accepted_plan
from fsoe_net.plan.codec import MAGIC, decode_plan

_NO_NET = "FSN125"


def read_side(path: str, options: LoadOptions) -> Side:
    """Read one side.

    Raises:
        InputError: It cannot be compared; the exception carries its errors.
    """
    out = Collector()
    side = _read(path, options, out)
    # A network without confirmed copies can also be compared.
    errors = [d for d in out.diagnostics if d.level is Severity.ERROR and d.code != _NO_NET]
    if side is None or errors:
        raise InputError(f"{path} cannot be compared", sort_diagnostics(errors))
    return side


def _read(path: str, options: LoadOptions, out: Collector) -> Side | None:
    known = find_format(path, Collector()) if os.path.isfile(path) else None
    if known is not None and known.is_streamed:
        return _side_of_description(path, known, out, path, "")  # of any size
    data = read_bytes(path, out, most=MAX_LARGE_BYTES)
    if data is None:
        return None
    if data.startswith(MAGIC):
        try:
            return side_of_plan(decode_plan(data), path)
        except InputError as exc:
            out.add("FSN101", Span(path), f"damaged plan: {exc}", hint="compile it again")
            return None
    if is_acceptance(data):
        return _side_of_record(data, path, out)
    if data.lstrip()[:1] == b"{":
        scan, found = parse_scan(data, path)
        out.diagnostics += found
        return None if scan is None else side_of_scan(scan, path)
    known = find_format(data, out, name=path)
    if known is None:
        return None
    if known.yields is not Yields.NETWORK:
        return _side_of_description(data, known, out, path, options.master)
    loaded = load_network([os.fspath(path)], options)
    out.diagnostics += loaded.diagnostics
    network = loaded.network
    return None if network is None else side_of_network(resolve(network), path)


def _side_of_record(data: bytes, path: str, out: Collector) -> Side | None:
    record = parse_acceptance(data, path, out)
    held = None if record is None else accepted_plan(record, out)
    if record is None or held is None:
        return None
    return side_of_plan(held[0], path, record.safety_functions)


def _side_of_description(
    source: str | bytes, known: Format, out: Collector, path: str, master: str
) -> Side | None:
    description = read_foreign(source, known, out, name=path, master=master)
    is_whole = description is not None and not description.truncated
    return side_of_description(description) if description and is_whole else None
