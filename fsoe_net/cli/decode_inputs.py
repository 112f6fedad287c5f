"""The inputs of ``fsoe-net decode``: hex and captures."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

import click

from fsoe_net.capture.decode import CaptureDecoder, DecodedFrame
from fsoe_net.capture.hexframes import follow_frames, parse_frames
from fsoe_net.capture.names import Naming
from fsoe_net.cli.decode_output import Output
from fsoe_net.cli.terminal import echo
from fsoe_net.core.scan import Sighting
from fsoe_net.errors import InputError
from fsoe_net.formats.capture.packets import buffered
from fsoe_net.fsoe.observed import ConnectionState, CrcVerdict, FrameDirection
from fsoe_net.fsoe.pdu import safe_data_of


def is_file(name: str) -> bool:
    """Whether an argument names a file; long hex is not a valid file name."""
    try:
        return bool(name.strip()) and Path(name).exists()
    except (OSError, ValueError):
        return False


def standard_input() -> io.BufferedReader:
    """Return standard input as bytes.

    Raises:
        click.UsageError: Standard input is closed.
    """
    if sys.stdin is None or sys.stdin.closed:
        raise click.UsageError("no INPUT, and standard input is closed")
    if sys.stdin.isatty():
        echo("hex of FSoE frames, end with Ctrl-D:", err=True)
    stream = sys.stdin.buffer
    return stream if isinstance(stream, io.BufferedReader) else buffered(stream)


def decode_hex(texts: Iterable[tuple[str, str]], naming: Naming, out: Output) -> None:
    """Decode frames in hex, each with its place in the input."""
    out.begin("hex")
    number = 0
    for number, seen in enumerate(follow_frames(parse_frames(texts)), start=1):  # noqa: B007
        out.row(
            DecodedFrame(
                packet=0,
                time_ms=None,
                names=naming.find(seen.pdu.connection_id, seen.lengths),
                number=0,
                direction=FrameDirection(seen.direction),
                frame=seen.frame.data,
                verdict=seen.verdict,
                state=seen.state,
                sequence=seen.sequence,
                note=seen.note,
            )
        )
    if number == 0:
        out.damaged("no frame was given; a frame is written as 2a0000c42d0000")
    out.end_of_frames()


def hex_lines(stream: io.BufferedReader) -> Iterator[tuple[str, str]]:
    """Yield each line with its place."""
    for number, line in enumerate(stream, start=1):
        yield f"stdin:{number}", line.decode("utf-8-sig" if number == 1 else "utf-8", "replace")


class _Said:
    """The last content of each direction, to omit repetitions."""

    def __init__(self) -> None:
        self._last: dict[tuple[int, int], tuple[int, bytes, CrcVerdict, ConnectionState]] = {}

    def is_news(self, s: Sighting) -> bool:
        news = s.frame[0], safe_data_of(s.frame), s.verdict, s.state
        key = s.connection, s.direction
        if self._last.get(key) == news:
            return False
        self._last[key] = news
        return True


def decode_capture(
    name: str,
    stream: BinaryIO,
    naming: Naming,
    out: Output,
    *,
    changes: bool,
    summary: bool,
) -> None:
    """Decode the FSoE frames of a capture."""
    decoder = CaptureDecoder(name, stream, naming)
    said = _Said()
    out.begin(name)
    try:
        for s in decoder.sightings():
            # Counted for all frames, even if only changes are shown.
            out.wrong += s.verdict is CrcVerdict.WRONG
            if not summary and (not changes or said.is_news(s)):
                out.row(decoder.frame_of(s))
    # The readable beginning of a damaged capture is still useful.
    except InputError as exc:
        out.damaged(str(exc))
    out.end_of_frames()
    connections = decoder.connections()
    ways = [(c.to_sub, c.to_main) for c, *_ in connections]
    # A direction without a checked frame proves nothing.
    out.unchecked |= not ways or any(not sum(d.right + d.wrong for d in way) for way in ways)
    out.found(connections, decoder.counts(), decoder.facts)
