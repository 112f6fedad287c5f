"""Completed pieces of a campaign in a file, from which an interrupted campaign continues.

The first line identifies the campaign. Each further line is a piece: its number and its result.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, Self

from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.trials import CampaignConfig, ClassResult, Failure, Shown
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.simulate.workers import Piece, is_of
from fsoe_net.version import __version__

_LINE_BYTES = 1 << 20  # a hundred proofs of a collision need 40 kB


class KeptPieces:
    """A file of completed pieces; a context manager that closes it.

    Args:
        path: The file; created if missing.
        config: Connections and seed.
        work: All pieces of the campaign.

    Raises:
        InputError: The file is of another campaign, or a line of it is not a result of this one.
        EnvironmentFault: The file cannot be opened, or another process has it open.
    """

    def __init__(self, path: Path, config: CampaignConfig, work: Sequence[Piece]) -> None:
        self._path, self._config, self._work = path, config, work
        content = hashlib.sha256(repr((__version__, config)).encode())
        for piece in work:
            content.update(repr(piece).encode())
        self._head = f"fsoe-net campaign {content.hexdigest()}\n".encode()
        with ExitStack() as stack:
            try:
                self._file = stack.enter_context(path.open("a+b"))
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as exc:
                raise EnvironmentFault(f"{path} is in use by another campaign") from exc
            except OSError as exc:
                raise EnvironmentFault(f"cannot write {path}: {exc.strerror or exc}") from exc
            self.parts = self._read()
            stack.pop_all()  # no error: it stays open

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # of a full disk, which `add` has reported
            self._file.close()

    def _read(self) -> dict[int, ClassResult]:
        """Return the results by the number of their piece."""
        self._file.seek(0)
        head = self._file.readline(len(self._head))
        if not head:
            self._file.write(self._head)
            return {}
        if head != self._head:
            raise InputError(
                f"{self._path} is not of this campaign: network, faults, cycles, seed, devices and "
                "version of fsoe-net must be those of its first run; name another file"
            )
        parts: dict[int, ClassResult] = {}
        number, whole = 1, len(head)
        while line := self._file.readline(_LINE_BYTES):
            number += 1
            if not line.endswith(b"\n") and len(line) < _LINE_BYTES:
                os.truncate(self._file.fileno(), whole)  # it was killed while it wrote this line
                break
            piece, part = self._piece(line, number)
            parts[piece] = part
            whole += len(line)
        return parts

    def _piece(self, line: bytes, number: int) -> tuple[int, ClassResult]:
        try:
            index, row = json.loads(line)
            part = _part(row)
            is_good = (
                type(index) is int and index >= 0 and is_of(part, self._config, self._work[index])
            )
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
            is_good = False
        if not is_good:
            raise InputError(
                f"{self._path}:{number}: not a result of this campaign; without this line its "
                "faults are injected again"
            )
        return index, part

    def add(self, index: int, part: ClassResult) -> None:
        """Append the result of a piece.

        Raises:
            EnvironmentFault: The disk is full, or the file cannot be written.
        """
        try:
            self._file.write(json.dumps([index, _row(part)]).encode() + b"\n")
            self._file.flush()
        except OSError as exc:
            raise EnvironmentFault(f"cannot write {self._path}: {exc.strerror}") from exc


def _row(part: ClassResult) -> dict[str, Any]:
    return {field.name: getattr(part, field.name) for field in fields(part)} | {
        "codes": sorted(part.codes.items()),
        "failures": [astuple(failure) for failure in part.failures],
        "shown": [_shown_row(one) for one in part.shown],
    }


def _shown_row(one: Shown) -> list[Any]:
    proof = one.proof
    frames = proof.frame.hex(), proof.right.hex()
    return [one.trial, one.link, proof.end, *frames, proof.old_crc, proof.sequence]


def _part(row: dict[str, Any]) -> ClassResult:
    """Return the result in a row; any other row raises a common exception of Python."""
    return ClassResult(
        **row
        | {
            "codes": Counter(dict(row["codes"])),
            "failures": [Failure(trial=t, link=k, reason=why) for t, k, why in row["failures"]],
            "shown": [_shown(*one) for one in row["shown"]],
        }
    )


def _shown(
    trial: int, link: str, end: str, frame: str, right: str, old_crc: int, sequence: int
) -> Shown:
    proof = Collision(
        end=end,
        frame=bytes.fromhex(frame),
        right=bytes.fromhex(right),
        old_crc=old_crc,
        sequence=sequence,
    )
    return Shown(trial=trial, link=link, proof=proof)
