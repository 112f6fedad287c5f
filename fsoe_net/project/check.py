"""Load, resolve and check the files of a network: the one way in for everything else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.diag.words import summary
from fsoe_net.errors import InputError
from fsoe_net.formats.library import builtin_library
from fsoe_net.formats.network import load_network
from fsoe_net.formats.options import LoadOptions
from fsoe_net.model.library import Library
from fsoe_net.model.network import NetworkConfig, SourceFile
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.model.scan import Scan
from fsoe_net.project.references import References, read_references, split_files
from fsoe_net.rules.check import check
from fsoe_net.rules.library import check_library
from fsoe_net.rules.references import check_references
from fsoe_net.rules.runtime import Runtime
from fsoe_net.rules.scan import check_scan
from fsoe_net.rules.timing import check_timing
from fsoe_net.timing.budget import make_budget

__all__ = ["Checked", "check_files", "library_of", "whole_network"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """A network with everything found in it. ``resolution`` is ``None`` when nothing was read.

    ``references`` are the other files it was compared with.
    """

    resolution: Resolution | None
    diagnostics: list[Diagnostic]
    references: tuple[SourceFile, ...] = ()

    @property
    def network(self) -> NetworkConfig | None:
        """The network, if any."""
        return self.resolution.network if self.resolution else None


def whole_network(checked: Checked, refusal: str) -> Resolution:
    """Return the network when it can be compiled.

    Args:
        checked: What was read.
        refusal: What is not done otherwise, e.g. ``no plan written``.

    Raises:
        InputError: It has an error, is only a part of a network, or moves nothing.
    """
    errors = [d for d in checked.diagnostics if d.level is Severity.ERROR]
    resolution = checked.resolution
    if errors or resolution is None:
        raise InputError(f"{refusal}: {summary(errors) or 'nothing was read'}", errors)
    if resolution.network.partial:
        raise InputError(
            f"{refusal}: these files alone are no whole network; name the URDF or network file too"
        )
    if not resolution.transfers:
        raise InputError(f"{refusal}: no transfers are given; a URDF names them in transfer_config")
    return resolution


def library_of(network: NetworkConfig) -> Library:
    """Return the device library as far as it is about devices of a network."""
    return builtin_library(
        frozenset(s.device.product_code for s in network.subdevices if s.device is not None)
    )


def check_files(
    files: Sequence[str],
    loading: LoadOptions | None = None,
    *,
    runtime: Runtime = Runtime.FSN,
    scan: Scan | None = None,
    compared: bool = False,
    timed: bool = True,
) -> Checked:
    """Load, resolve and check the files a user named, and compare them with what is on a bus.

    Args:
        files: Files of the network.
        loading: How references in them are followed.
        runtime: Also what this runtime minds.
        scan: What is on the bus.
        compared: There may be other files among ``files``, and the device library is asked too.
        timed: Check the safety functions too; a caller with a budget of its own does that itself.
    """
    own, others = split_files(files) if compared else (files, [])
    loaded = load_network(own, loading)
    found = list(loaded.diagnostics)
    resolution = resolve(loaded.network) if loaded.network is not None else None
    references = References()
    if resolution is not None:
        found += check(resolution, runtime=runtime)
        if timed and resolution.network.safety_functions:
            budget = make_budget(resolution, library_of(resolution.network))
            found += check_timing(resolution.network, budget, found=found)
        if scan is not None:
            found += check_scan(resolution, scan)
        if compared:
            library = library_of(resolution.network)
            references = read_references(others, resolution.network)
            found += references.diagnostics
            found += check_references(
                resolution, references.descriptions, library=library, found=found
            )
            found += check_library(resolution, library, found=found, notes=bool(others))
    return Checked(
        resolution=resolution,
        diagnostics=sort_diagnostics(found),
        references=tuple(references.sources),
    )
