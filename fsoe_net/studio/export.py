"""The network of the page in the formats of ``fsoe-net convert``, as files to download."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fsoe_net.diag.diagnostic import Severity
from fsoe_net.diag.printable import printable
from fsoe_net.errors import InputError
from fsoe_net.formats.registry import all_formats, all_targets
from fsoe_net.project.convert import Conversion, convert_files
from fsoe_net.studio.workspace import StaleVersion, Workspace

Row = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Download:
    """A file for the browser: a single file unchanged, several as a ZIP."""

    name: str
    data: bytes


def targets() -> list[Row]:
    """Return the export formats of the network: name of the format, and its description."""
    return [
        {"name": target.name, "title": known.title, "is_folder": target.is_folder}
        for known in all_formats().values()
        for target in known.targets
    ]


def preview(
    workspace: Workspace,
    version: int,
    target: str,
    esis: Sequence[str] = (),
    *,
    named: Callable[[str], str] = printable,
) -> Row:
    """Return the files of a format, and notes on data that it cannot represent.

    Args:
        workspace: The network in the page.
        version: Version of the text to export.
        target: Name of a format, see `targets`.
        esis: ESI files with device data missing in the network.
        named: Returns a text for display.

    Raises:
        StaleVersion: ``version`` is not the current one.
        InputError: Unknown format, or it cannot represent the network.
    """
    made = _converted(workspace, version, target, esis)
    return {
        "version": version,
        "target": target,
        "files": [{"name": name, "bytes": len(data)} for name, data in made.files.items()],
        "notes": [named(note) for note in dict.fromkeys(made.notes)],
        "findings": [
            named(f"{row.span}: {row.message}")
            for row in made.findings
            if row.level is not Severity.INFO
        ],
    }


def download(workspace: Workspace, version: int, target: str, esis: Sequence[str] = ()) -> Download:
    """Return the file, or a ZIP of the files, of a format; arguments and errors as in `preview`."""
    made = _converted(workspace, version, target, esis)
    if len(made.files) == 1:
        ((name, data),) = made.files.items()
        return Download(name=name, data=data)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in made.files.items():
            # Without the current time, so that equal networks give equal bytes.
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return Download(name=f"{_stem(workspace)}-{target}.zip", data=stream.getvalue())


def _converted(workspace: Workspace, version: int, target: str, esis: Sequence[str]) -> Conversion:
    if version != workspace.version:
        raise StaleVersion
    known = all_targets().get(target)
    if known is None:
        raise InputError(f"unknown format {target!r}; there are {', '.join(all_targets())}")
    name = _stem(workspace) + (known.suffixes[0] if known.suffixes else "")
    with workspace.read_as_edited():
        return convert_files([workspace.path, *esis], target, name=name)


def _stem(workspace: Workspace) -> str:
    network = workspace.checked.network
    name = "" if network is None else network.name
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name)[:80].strip("_") or "network"
