"""Files that commands write: whole, or not at all."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from fsoe_net.errors import EnvironmentFault

__all__ = ["write_whole"]


def write_whole(output: str | os.PathLike[str], data: bytes) -> None:
    """Write a file: one that a full disk cuts off must not replace a good one.

    A link stays a link. What is no regular file, such as ``/dev/null``, ``/dev/stdout`` or a named
    pipe, is written to: giving its name to a new file would take it from every other program.

    Raises:
        EnvironmentFault: It cannot be written; what was there is unchanged.
    """
    partial: Path | None = None
    try:
        if os.path.exists(output) and not os.path.isfile(output):
            Path(output).write_bytes(data)
            return
        target = Path(os.path.realpath(output))
        partial = target.with_name(f"{target.name}.{os.getpid()}.part")
        partial.write_bytes(data)
        partial.replace(target)
    except OSError as exc:
        folder = Path(output).parent
        why = exc.strerror if folder.is_dir() else f"there is no folder {folder}"
        raise EnvironmentFault(f"cannot write {os.fspath(output)}: {why}") from exc
    finally:
        if partial is not None:
            with contextlib.suppress(OSError):  # it has its name by now, or was never made
                partial.unlink(missing_ok=True)
