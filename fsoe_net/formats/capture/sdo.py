"""CoE SDO transfers in captured mailboxes: expedited, normal, segmented, complete access.

+--------+---------+----------+-------------+-------------+---------+-------+-----+------+
| length | address | priority | type, count | CoE service | command | index | sub | data |
+--------+---------+----------+-------------+-------------+---------+-------+-----+------+
"""

from __future__ import annotations

from dataclasses import field

from fsoe_net.dataclass import dataclass

_COE, _REQUEST, _RESPONSE = 3, 2, 3
_MAX_BYTES = 1 << 16
_ABORT = 4
_DOWNLOAD_SEGMENT, _DOWNLOAD, _UPLOAD, _UPLOAD_SEGMENT = 0, 1, 2, 3  # requested
_UPLOADED_SEGMENT, _DOWNLOADED_SEGMENT, _UPLOADED, _DOWNLOADED = 0, 1, 2, 3  # answered


@dataclass(frozen=True, slots=True, kw_only=True)
class CapturedSdo:
    """A completed transfer; ``subindex`` is the first one of a complete access."""

    index: int
    subindex: int
    data: bytes
    written: bool
    complete: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SdoAbort:
    """A transfer that one side aborted."""

    index: int
    subindex: int
    written: bool
    code: int


@dataclass(slots=True)
class _Transfer:
    index: int
    subindex: int
    written: bool
    complete: bool
    size: int | None = None  # unknown
    started: bool = False  # the first answer has arrived
    data: bytearray = field(default_factory=bytearray)
    toggle: int | None = None  # of the requested segment
    segment: bytes = b""
    last: bool = False


def _service(mailbox: bytes) -> tuple[int, bytes] | None:
    """Return service and body of a CoE mailbox."""
    length = int.from_bytes(mailbox[:2], "little")
    body = mailbox[6 : 6 + length]
    # CoE header (2) and SDO command with its data (8).
    if len(body) != length or length < 10 or mailbox[5] & 0x0F != _COE:
        return None
    return body[1] >> 4, body[2:]


def _place(body: bytes) -> tuple[int, int]:
    return int.from_bytes(body[1:3], "little"), body[3]


class SdoFollower:
    """Follows the transfers with one SubDevice, one at a time, as in the mailbox.

    A repeated read or write of a mailbox has no effect: each answer counts once, and only if it
    matches the request.
    """

    def __init__(self) -> None:
        self._now: _Transfer | None = None

    def request(self, mailbox: bytes) -> SdoAbort | None:
        """Process data written by the MainDevice to a mailbox."""
        found = _service(mailbox)
        if found is None or found[0] != _REQUEST:
            return None
        body = found[1]
        kind = body[0] >> 5
        if kind in (_DOWNLOAD, _UPLOAD):
            self._begin(kind == _DOWNLOAD, body)
        elif kind == _ABORT:
            return self._abort(body)
        elif self._now is not None and self._now.started:
            now = self._now
            now.toggle = body[0] >> 4 & 1
            if kind == _DOWNLOAD_SEGMENT:
                now.segment, now.last = _segment(body), bool(body[0] & 1)
        return None

    def response(self, mailbox: bytes) -> CapturedSdo | SdoAbort | None:
        """Process data read by the MainDevice from a mailbox."""
        found = _service(mailbox)
        if found is None or found[0] != _RESPONSE or self._now is None:
            return None
        body, now = found[1], self._now
        kind = body[0] >> 5
        if kind == _ABORT:
            return self._abort(body)
        if kind in (_UPLOADED, _DOWNLOADED):
            if now.started or _place(body) != (now.index, now.subindex):
                return None
            if now.written is not (kind == _DOWNLOADED):
                return None
            return self._answered(now, body)
        if not now.started or now.toggle is None or now.toggle != body[0] >> 4 & 1:
            return None
        return self._continued(now, kind, body)

    def _begin(self, written: bool, body: bytes) -> None:
        index, subindex = _place(body)
        # Bit 4 is complete access (ETG.1000.6).
        now = _Transfer(index, subindex, written, bool(body[0] & 0x10))
        if written:
            _take_first(now, body)
        self._now = now

    def _answered(self, now: _Transfer, body: bytes) -> CapturedSdo | None:
        now.started = True
        if not now.written:
            _take_first(now, body)
        # Up to four bytes, or all in one mailbox: no segments follow.
        enough = now.size is not None and len(now.data) >= now.size
        return self._done(now) if enough else None

    def _continued(self, now: _Transfer, kind: int, body: bytes) -> CapturedSdo | None:
        # The same answer may be read from the mailbox again and must not count twice.
        now.toggle = None
        if now.written and kind == _DOWNLOADED_SEGMENT:
            now.data += now.segment
        elif not now.written and kind == _UPLOADED_SEGMENT:
            now.data += _segment(body)
            now.last = bool(body[0] & 1)
        else:
            return None
        if len(now.data) > _MAX_BYTES:
            self._now = None
            return None
        return self._done(now) if now.last else None

    def _done(self, now: _Transfer) -> CapturedSdo | None:
        self._now = None
        if now.size is not None and len(now.data) < now.size:
            return None
        return CapturedSdo(
            index=now.index,
            subindex=now.subindex,
            data=bytes(now.data[: now.size]),
            written=now.written,
            complete=now.complete,
        )

    def _abort(self, body: bytes) -> SdoAbort | None:
        now = self._now
        # An abort may state no object: index and subindex are then 0.
        if now is None or _place(body) not in ((now.index, now.subindex), (0, 0)):
            return None
        self._now = None
        return SdoAbort(
            index=now.index,
            subindex=now.subindex,
            written=now.written,
            code=int.from_bytes(body[4:8], "little"),
        )


def _take_first(now: _Transfer, body: bytes) -> None:
    """Take the data of a first message: up to four bytes in place of the size, or after it."""
    # Bit 1: data instead of the size; bit 0: size given; bits 2 and 3: unused bytes of the four.
    if body[0] & 2:
        unused = body[0] >> 2 & 3 if body[0] & 1 else 0
        now.data += body[4 : 8 - unused]
        now.size = 4 - unused
    else:
        now.size = int.from_bytes(body[4:8], "little") if body[0] & 1 else None
        now.data += body[8:]


def _segment(body: bytes) -> bytes:
    """Return the data of a segment; short data are padded to seven bytes."""
    data = body[1:]
    return data[: 7 - (body[0] >> 1 & 7)] if len(data) == 7 else data
