"""Completed pieces of work in a file, from which interrupted work continues.

The first line identifies the work. Each further line is a piece: its number and its result.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any, Generic, Self, TypeVar

from fsoe_net.campaign.collision_proof import Collision
from fsoe_net.campaign.trials import CampaignConfig, ClassResult, Failure, Shown
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.simulate.workers import Piece, is_of
from fsoe_net.version import __version__

_LINE_BYTES = 1 << 20  # a hundred proofs of a collision need 40 kB
R = TypeVar("R")


class KeptPieces(ABC, Generic[R]):
    """A file of completed pieces; a context manager that closes it.

    Args:
        path: The file; created if missing.
        work: All pieces, and whatever else their results depend on; identified by their `repr`.

    Attributes:
        kind: A noun for the work.
        same: Values that must be equal to continue it.
        parts: The results by the number of their piece.

    Raises:
        InputError: The file is of other work, or a line of it is not a result of this work.
        EnvironmentFault: The file cannot be opened, or another process has it open.
    """

    kind: str
    same: str

    def __init__(self, path: Path, *work: object) -> None:
        self._path = path
        content = hashlib.sha256(repr((__version__, *work)).encode())
        self._head = f"fsoe-net {self.kind} {content.hexdigest()}\n".encode()
        with ExitStack() as stack:
            try:
                self._file = stack.enter_context(path.open("a+b"))
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as exc:
                raise EnvironmentFault(f"{path} is in use by another {self.kind}") from exc
            except OSError as exc:
                raise EnvironmentFault(f"cannot write {path}: {exc.strerror or exc}") from exc
            self.parts = self._read()
            stack.pop_all()  # no error: it stays open

    @abstractmethod
    def load(self, index: int, row: Any) -> R | None:
        """Return the result in a row, or `None` if it is not of this piece.

        Any other row raises a common exception of Python.
        """

    @abstractmethod
    def row(self, part: R) -> Any:
        """Return a result as data for JSON."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # of a full disk, which `add` has reported
            self._file.close()

    def _read(self) -> dict[int, R]:
        """Return the results by the number of their piece."""
        self._file.seek(0)
        head = self._file.readline(len(self._head))
        if not head:
            self._file.write(self._head)
            return {}
        if head != self._head:
            raise InputError(
                f"{self._path} is not of this {self.kind}: {self.same} must be those of its first "
                "run; name another file"
            )
        parts: dict[int, R] = {}
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

    def _piece(self, line: bytes, number: int) -> tuple[int, R]:
        part = None
        try:
            index, row = json.loads(line)
            if type(index) is int and index >= 0:
                part = self.load(index, row)
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
            pass
        if part is None:
            raise InputError(
                f"{self._path}:{number}: not a result of this {self.kind}; without this line its "
                "piece is run again"
            )
        return index, part

    def add(self, index: int, part: R) -> None:
        """Append the result of a piece.

        Raises:
            EnvironmentFault: The disk is full, or the file cannot be written.
        """
        try:
            self._file.write(json.dumps([index, self.row(part)]).encode() + b"\n")
            self._file.flush()
        except OSError as exc:
            raise EnvironmentFault(f"cannot write {self._path}: {exc.strerror}") from exc


class KeptCampaign(KeptPieces[ClassResult]):
    """The completed pieces of a campaign."""

    kind = "campaign"
    same = "network, faults, cycles, seed, devices and version of fsoe-net"

    def __init__(self, path: Path, config: CampaignConfig, work: Sequence[Piece]) -> None:
        self._config, self._work = config, work
        super().__init__(path, config, work)

    def load(self, index: int, row: Any) -> ClassResult | None:
        """Return the result of a piece; see `KeptPieces`."""
        part = _part(row)
        return part if is_of(part, self._config, self._work[index]) else None

    def row(self, part: ClassResult) -> dict[str, Any]:
        """Return a result as data; see `KeptPieces`."""
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
