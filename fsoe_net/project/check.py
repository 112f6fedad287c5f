"""Loads, resolves and checks the files of a network; all other modules use this entry point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic, Severity, sort_diagnostics
from fsoe_net.diag.words import summary
from fsoe_net.errors import InputError
from fsoe_net.formats.own.library import builtin_library
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.model.library import Library
from fsoe_net.model.network import NetworkConfig, SourceFile
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.rules.check import check
from fsoe_net.rules.library import check_library
from fsoe_net.rules.runtime import Runtime

if TYPE_CHECKING:
    from fsoe_net.formats.registry import Format
    from fsoe_net.model.scan import Scan
    from fsoe_net.project.references import References


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedFiles:
    """The files as read.

    Attributes:
        diagnostics: Findings of the readers.
        resolution: The network; ``None`` if nothing was read.
        compared: Whether to compare it with the device library and ``references``.
        references: The other files; ``None`` if there are none.
    """

    diagnostics: Sequence[Diagnostic]
    resolution: Resolution | None
    compared: bool
    references: References | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """A network with all its findings. ``resolution`` is ``None`` if nothing was read.

    ``references`` are the other files that it was compared with.
    """

    resolution: Resolution | None
    diagnostics: list[Diagnostic]
    references: tuple[SourceFile, ...] = ()

    @property
    def network(self) -> NetworkConfig | None:
        """The network, if any."""
        return self.resolution.network if self.resolution else None


def whole_network(checked: Checked, refusal: str) -> Resolution:
    """Return the network if it can be compiled.

    Args:
        checked: The files as read.
        refusal: The consequence of an error, e.g. ``no plan written``.

    Raises:
        InputError: The network has an error, is incomplete, or copies none of its FSoE frames.
    """
    errors = [d for d in checked.diagnostics if d.level is Severity.ERROR]
    resolution = checked.resolution
    if errors or resolution is None:
        raise InputError(f"{refusal}: {summary(errors) or 'nothing was read'}", errors)
    if resolution.network.partial:
        raise InputError(
            f"{refusal}: these files alone are not a complete network; name the URDF or network "
            "file too"
        )
    layouts = [sub.layout for sub in resolution.network.subdevices]
    if not resolution.transfers and any(layout and layout.blocks for layout in layouts):
        raise InputError(
            f"{refusal}: there are FSoE frames, and no transfers; a URDF names them in "
            "transfer_config"
        )
    return resolution


def library_of(network: NetworkConfig) -> Library:
    """Return the entries of the device library for the devices of a network."""
    return builtin_library(
        frozenset(s.device.product_code for s in network.subdevices if s.device is not None)
    )


def load_files(
    files: Sequence[str], loading: LoadOptions | None = None, *, compared: bool = False
) -> LoadedFiles:
    """Read the files named by a user.

    Args:
        files: Files of the network.
        loading: How references in them are followed.
        compared: Whether ``files`` may include other files to compare with, and the device library
            is used.
    """
    own = files
    others: list[tuple[str, Format]] = []
    if compared and len(files) > 1:
        # Imports the recognition of all formats: only if there may be other files.
        from fsoe_net.project.references import read_references, split_files

        own, others = split_files(files)
    loaded = load_network(own, loading)
    resolution = resolve(loaded.network) if loaded.network is not None else None
    references = None
    if others and resolution is not None:
        master = loading.master if loading is not None else ""
        references = read_references(others, resolution.network, master=master)
    return LoadedFiles(
        diagnostics=loaded.diagnostics,
        resolution=resolution,
        compared=compared,
        references=references,
    )


def check_loaded(
    loaded: LoadedFiles,
    *,
    runtime: Runtime = Runtime.FSN,
    scan: Scan | None = None,
    timed: bool = True,
) -> Checked:
    """Check files after reading, and compare them with the scan of a bus.

    Args:
        loaded: The files.
        runtime: Also check for differences of this runtime.
        scan: Scan of the bus.
        timed: Also check the safety functions; a caller with its own budget does that itself.

    Raises:
        InputError: There is a scan, but no complete network to compare it with.
    """
    found = list(loaded.diagnostics)
    resolution, references = loaded.resolution, loaded.references
    if resolution is not None:
        found += check(resolution, runtime=runtime)
        if timed and resolution.network.safety_functions:
            from fsoe_net.rules.timing import check_timing
            from fsoe_net.timing.budget import make_budget

            budget = make_budget(resolution, library_of(resolution.network))
            found += check_timing(resolution.network, budget, found=found)
        if scan is not None:
            from fsoe_net.compare.bus_scan import check_scan

            found += check_scan(resolution, scan)
        if loaded.compared:
            library = library_of(resolution.network)
            if references is not None:
                found += references.diagnostics
                if references.descriptions:
                    from fsoe_net.compare.references import check_references

                    found += check_references(
                        resolution, references.descriptions, library=library, found=found
                    )
            found += check_library(resolution, library, found=found, notes=references is not None)
    found = sort_diagnostics(found)
    # After all checks, so that the error carries every finding.
    if scan is not None and (resolution is None or resolution.network.partial):
        raise InputError(
            "a bus is compared with a whole network: name the network file, or the URDF", found
        )
    return Checked(
        resolution=resolution,
        diagnostics=found,
        references=() if references is None else tuple(references.sources),
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
    """Read and check files; see `load_files` and `check_loaded`."""
    loaded = load_files(files, loading, compared=compared)
    return check_loaded(loaded, runtime=runtime, scan=scan, timed=timed)
