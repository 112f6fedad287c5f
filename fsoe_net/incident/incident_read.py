"""Reads incident files: line by line, in bounded memory, up to the first error.

The head must be valid; an error in it is reported with its key. After it a file may be truncated
(full disk) or damaged: the preceding cycles are returned, and `IncidentReader.cut` gives the
reason.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

from fsoe_net.core.json_object import JsonObject
from fsoe_net.errors import IncidentError
from fsoe_net.incident.incident import CycleRecord, IncidentHead
from fsoe_net.incident.incident_head import head_of

_HEAD_BYTES = 64 << 20
_MOST_CYCLES = 4_000_000
_MOST_IMAGE_BYTES = 4 << 20
# An image is written in hexadecimal, two characters per byte.
_LINE_BYTES = 2 * _MOST_IMAGE_BYTES + 1024


class IncidentReader:
    """Reads one file; iterate it once for its cycles.

    Args:
        name: Name of the file, for messages.
        stream: Content of the file; must have no other reader.

    Attributes:
        head: First line.
        cut: Why the file ends early, with the line; empty if it is complete.
        cycles: Cycles yielded so far.

    Raises:
        IncidentError: The first line is not a valid head of an incident file.
    """

    def __init__(self, name: str, stream: BinaryIO) -> None:
        self._name = name
        self._stream = stream
        self.cut = ""
        self.cycles = 0
        line = stream.readline(_HEAD_BYTES + 1)
        # The head contains the plan; its length is limited before any of it is parsed.
        if len(line) > _HEAD_BYTES:
            raise IncidentError(f"longer than {_HEAD_BYTES >> 20} MiB", name, 1)
        if not line.strip():
            raise IncidentError("no head: the file is empty or begins with an empty line", name, 1)
        document = _object(line)
        if isinstance(document, str):
            reason = f"this is not an incident file: {document} in its first line"
            # A full disk truncates the head; a file of another tool is a different error.
            if line.startswith(b"{") and not line.endswith(b"\n"):
                reason = f"the head is cut off: {document}"
            raise IncidentError(reason, name, 1)
        self.head: IncidentHead = head_of(JsonObject(document, name, 1))

    def __iter__(self) -> Iterator[CycleRecord]:
        """Yield the cycles in file order; `cut` is valid after the last one."""
        image: bytes | None = None
        last = -1
        number = 1
        while True:
            number += 1
            line = self._stream.readline(_LINE_BYTES + 1)
            # A complete file ends with a separate line; without it, the writer did not finish.
            if not line:
                self._cut(
                    number, "the file ends without its last line; the disk may have been full"
                )
                return
            try:
                record = self._cycle(line, number, image)
            except IncidentError as exc:
                self._cut(number, exc.reason)
                return
            if record is None:
                return
            # Cycle numbers only increase: anything else is a damaged or joined file.
            if record.cycle <= last:
                self._cut(number, f"cycle {record.cycle} comes after cycle {last}")
                return
            # Reading of an endless file must stop.
            if self.cycles >= _MOST_CYCLES:
                self._cut(number, f"more than {_MOST_CYCLES} cycles")
                return
            last, image = record.cycle, record.image
            self.cycles += 1
            yield record

    def _cycle(self, line: bytes, number: int, image: bytes | None) -> CycleRecord | None:
        """Return the cycle of a line, or ``None`` for the last one."""
        if len(line) > _LINE_BYTES:
            raise IncidentError("the line is too long", self._name, number)
        row = _object(line)
        if isinstance(row, str):
            ends = "" if line.endswith(b"\n") else "cut off in the middle of a line: "
            raise IncidentError(ends + row, self._name, number)
        values = JsonObject(row, self._name, number)
        if "end" in row:
            # The number of cycles shows whether lines are missing in the middle.
            stated = values.whole("cycles", missing=self.cycles)
            if stated != self.cycles:
                self._cut(number, f"{stated} cycles were written, {self.cycles} are here")
            return None
        if "image" in row:
            image = self._image(values)
        wkc = values.numbers("wkc")
        if wkc and len(wkc) != 2:
            raise IncidentError("wkc is not [expected, actual]", self._name, number)
        return CycleRecord(
            cycle=values.whole("cycle"),
            now_ns=values.whole("t"),
            late_ns=values.whole("late", missing=0),
            work_ns=values.whole("work", missing=0),
            round_ns=values.whole("round", missing=0),
            lost=values.whole("lost", missing=0),
            old=values.whole("old", missing=0),
            foreign=values.whole("foreign", missing=0),
            wkc=(wkc[0], wkc[1]) if wkc else None,
            image=image,
        )

    def _image(self, values: JsonObject) -> bytes:
        text = values.text("image")
        try:
            image = bytes.fromhex(text)
        except ValueError as exc:
            raise values.bad("image", "is not hexadecimal") from exc
        if self.head.layout.image_bytes and len(image) != self.head.layout.image_bytes:
            raise values.bad(
                "image", f"has {len(image)} bytes, the layout has {self.head.layout.image_bytes}"
            )
        return image

    def _cut(self, line: int, reason: str) -> None:
        self.cut = f"{self._name}:{line}: {reason}"


def _object(line: bytes) -> Mapping[str, Any] | str:
    """Return the JSON object of a line, or the reason why there is none."""
    try:
        # NaN and infinity are not valid JSON, although Python reads them.
        found = json.loads(line.decode("utf-8"), parse_constant=_no_constant)
    except UnicodeDecodeError:
        return "no UTF-8"
    except RecursionError:
        return "nested too deep"
    except json.JSONDecodeError:
        return "no JSON"
    except ValueError as exc:
        return f"no JSON: {exc}"
    return found if isinstance(found, dict) else "no JSON object"


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")
