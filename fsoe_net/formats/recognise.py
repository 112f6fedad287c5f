"""Recognises the type of a file by content, and by its name only if the content is inconclusive."""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from xml.parsers import expat

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Related, Span
from fsoe_net.errors import InputError
from fsoe_net.formats.registry import Format, Signature, Yields, all_formats, function_of
from fsoe_net.formats.shared.files import Collector, open_file
from fsoe_net.formats.shared.source import Source
from fsoe_net.formats.shared.xml_text import plain_xml

_UNPACK = "unpack it, then name the files in it"
_AGAIN = "fetch the file itself; this is what came instead of it"
BUILDER_PROJECT = "which looks like a project of an ENI builder, not its ENI"

# Description, start of the file, next step.
_BEGINNINGS = (
    ("a ZIP archive", rb"PK\x03\x04|PK\x05\x06", _UNPACK),
    ("a file packed with gzip", rb"\x1f\x8b", "unpack it with `gunzip`"),
    ("a file packed with bzip2", rb"BZh[1-9]1AY", "unpack it with `bunzip2`"),
    ("a file packed with xz", rb"\xfd7zXZ\x00", "unpack it with `unxz`"),
    ("a 7-Zip archive", rb"7z\xbc\xaf\x27\x1c", _UNPACK),
    ("a RAR archive", rb"Rar!\x1a\x07", _UNPACK),
    ("a PDF document", rb"%PDF-", "give the file that it describes"),
    (
        "a compound document, as older editors save projects",
        rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "export the project as XML in its editor, and give that",
    ),
    (
        "a compiled plan",
        rb"FSNPLAN\x00",
        "name the network it was made from; `fsoe-net plan --show FILE` shows a plan",
    ),
    ("a program", rb"\x7fELF|MZ[\x00-\xff]\x00", "give a file of the bus instead"),
    ("a pointer of git-lfs, not the file", rb"version https://git-lfs", "run `git lfs pull`"),
    (
        "a web page (HTML)",
        rb"(?i)\s*(?:<!--[\s\S]{0,500}?-->\s*)?<(?:!doctype\s+html|html)\b",
        _AGAIN,
    ),
)
_ROOTS = {
    "EtherCATDiag": ("texts of ESI diagnosis messages, without a device", ""),
    "EtherCATMailbox": ("an export of start-up commands from TwinCAT", ""),
    "Network": ("a network of openethercat, a format of its own", ""),
    "TreeItem": ("a tree item of TwinCAT", ""),
    "sdf": ("an SDF file", "name the URDF or xacro it was made from"),
}
# Results of fsoe-net in JSON, which no reader of a network supports.
_RECORDING = Signature(
    words="a recording of a campaign", begins=rb'\{[^\n]{0,1000}"type"\s*:\s*"config"'
)
_RESULTS = (
    Signature(words="a report in JSON", begins=rb'\s*\{\s*"format"\s*:\s*"fsoe-net report"'),
    Signature(words="a result of a command in JSON", begins=rb'\s*\{\s*"tool"\s*:\s*"fsoe-net"'),
    Signature(words="a scan in JSON", begins=rb'\s*\{\s*"scan"\s*:'),
    _RECORDING,
)
# Expected documents: description, and the next step where another file is given.
_DOCUMENTS = {
    "acceptance": ("an acceptance record", "give the file of `fsoe-net acceptance record`"),
    "test-record": ("a test record", "give the file of `fsoe-net test-record`, as YAML"),
    "device": ("a device file", "give a file such as `fsoe_net/devices/el1904.yaml`"),
    "capture": (
        "a packet capture (pcap, pcapng)",
        "give a capture of tcpdump, tshark or Wireshark",
    ),
    "recording": (_RECORDING.words, "give a file of `fsoe-net campaign --save-dir DIR`"),
}
UNSUPPORTED = (
    *(Signature(words=w, begins=begins, next_step=step) for w, begins, step in _BEGINNINGS),
    *(Signature(words=w, root=root, next_step=step) for root, (w, step) in _ROOTS.items()),
)


_HEAD_BYTES = 65_536
_BEGINNING_BYTES = 1024
_BINARY_BYTES = 128
_MOST_ELEMENTS = 200
_XML_BEGIN = re.compile(rb"(\xef\xbb\xbf)?\s*<|\xff\xfe|\xfe\xff|\0<")


@dataclass(frozen=True, slots=True)
class Recognised:
    """Type of a file: its format, ``None`` if no reader supports it, and the matching signature."""

    format: Format | None
    signature: Signature

    @property
    def words(self) -> str:
        """The description, with an article."""
        return self.signature.words

    @property
    def next_step(self) -> str:
        """The next step, if no reader supports it."""
        return self.signature.next_step

    @property
    def kind(self) -> str:
        """The kind of its format; empty if no reader supports it."""
        return "" if self.format is None else self.format.kind


@functools.cache
def _table() -> tuple[Recognised, ...]:
    """Return all ways to recognise a file; rows that need both a root and a text come first."""
    # The output of `ethercat xml` has the root of an ESI: its comment decides before the root.
    rows = [Recognised(f, s) for f in all_formats().values() for s in f.signatures]
    rows += [Recognised(None, s) for s in UNSUPPORTED]
    return tuple(sorted(rows, key=lambda r: not (r.signature.root and r.signature.text)))


def _of_root(root: str) -> list[Recognised]:
    return [row for row in _table() if root and row.signature.root == root]


def recognise(data: bytes) -> Recognised | None:
    """Return the type of these bytes, by content; ``None`` if unknown."""
    head = data[:_HEAD_BYTES]
    found = beginning(head)
    if found is None and _XML_BEGIN.match(head):
        found = _xml(head)
    return found or _text(head)


def beginning(data: bytes) -> Recognised | None:
    """Return the type of a file that its first bytes show."""
    head = data[:_BEGINNING_BYTES]
    for row in _table():
        sign = row.signature
        if not sign.begins or not re.match(sign.begins, head):
            continue
        if not sign.confirm or function_of(sign.confirm)(data[:_HEAD_BYTES]):
            return row
    return None


def words_of_root(root: str) -> str:
    """Return the type of XML with this root element; empty if unknown."""
    rows = _of_root(root)
    return rows[-1].words if rows else ""


def _xml(head: bytes) -> Recognised | None:
    elements = _first_elements(head)
    if not elements:
        return None
    root = elements[0][0]
    for row in _of_root(root):
        if re.search(row.signature.text, head):
            return row
    words = f"XML with the root <{root[:60]}>"
    if any(name == "Slave" and "PhysAddr" in given for name, given in elements):
        words = f"<{root}>, {BUILDER_PROJECT}"
    return Recognised(None, Signature(words=words, root=root))


class _Enough(Exception):
    """The root element is known."""


def _first_elements(head: bytes) -> list[tuple[str, dict[str, str]]]:
    """Return name and attributes of the root; if it is unknown, also of some elements in it."""
    elements: list[tuple[str, dict[str, str]]] = []

    def start(name: str, given: dict[str, str]) -> None:
        elements.append((name, given))
        if _of_root(elements[0][0]) or len(elements) >= _MOST_ELEMENTS:
            raise _Enough

    for encoding in (None, "iso-8859-1"):  # if the declared encoding is wrong
        if elements:
            break
        parser = expat.ParserCreate(encoding)
        parser.StartElementHandler = start
        with suppress(_Enough, expat.ExpatError, ValueError, LookupError):
            parser.Parse(plain_xml(head), False)
    return elements


def _text(head: bytes) -> Recognised | None:
    """Return the format whose mark comes first; each format counts with its first signature."""
    found: dict[str, tuple[int, Recognised]] = {}
    for row in _table():
        sign = row.signature
        if row.kind in found or not sign.text or sign.root:
            continue
        if match := re.search(sign.text, head, re.MULTILINE):
            found[row.kind] = (match.start(), row)
    return min(found.values(), key=lambda row: row[0])[1] if found else None


def head_of(path: str, out: Collector) -> bytes | None:
    """Return the part of a file that shows its type, or ``None`` with FSN101."""
    try:
        with open_file(path) as stream:
            return stream.read(_HEAD_BYTES)
    except InputError as exc:
        out.diagnostics += exc.diagnostics
        return None


def find_format(source: Source, out: Collector, *, name: str = "<file>") -> Format | None:
    """Return the format of a file, by content and only then by suffix.

    Args:
        source: Path, or the bytes of the file.
        out: Takes FSN101 if the file cannot be read, FSN117 for an unknown file, with a list of the
            supported formats.
        name: Name shown when ``source`` is bytes.
    """
    if not isinstance(source, bytes):
        path = os.fspath(source)
        head = head_of(path, out)
        return None if head is None else find_format(head, out, name=path)
    found: Recognised | None = Recognised(None, Signature(words="an empty file"))
    if source[:_HEAD_BYTES].strip():
        found = _probably(source[:_HEAD_BYTES], name)
    if found is not None and found.format is not None:
        return found.format
    _refuse(found, name, out)
    return None


def _probably(head: bytes, path: str) -> Recognised | None:
    """Return the type of a file, by content and only then by suffix."""
    if found := recognise(head):
        return found
    guess = next(_guesses(head, path.lower()), None)
    if guess is None:
        return None
    return Recognised(guess, Signature(words=f"probably {guess.title}"))


def _guesses(head: bytes, path: str) -> Iterator[Format]:
    """Yield the possible formats of a file whose content does not identify one with certainty."""
    known = all_formats().values()
    yield from (f for f in known if any(re.search(g, head) for g in f.guesses))
    yield from (f for f in known if path.endswith(f.suffixes))
    if b"\0" in head[:_BINARY_BYTES]:
        yield from (f for f in known if f.is_binary)


def _refuse(found: Recognised | None, path: str, out: Collector) -> None:
    place = Span(path, 1, 1)
    if found is None:
        message = "unsupported file type"
    else:
        message = f"this is {found.words}, which is not read"
    if found is not None and found.next_step:
        out.add("FSN117", place, message, hint=found.next_step)
        return
    expected = [f"{f.kind}: expects {f.expects}" for f in all_formats().values()]
    out.add(
        "FSN117",
        place,
        message,
        hint="`fsoe-net convert --from` takes a format by name",
        related=tuple(Related(span=place, message=text) for text in expected),
    )


def refuse_known(data: bytes, place: Span, wanted: str, out: Collector) -> bool:
    """Identify a file that does not describe a network; ``False`` for an unknown file.

    Args:
        data: The file.
        place: Start of the file.
        wanted: The expected type, with its article.
        out: Takes FSN117, with the commands that accept such a file.
    """
    found = _probably(data[:_HEAD_BYTES], place.file)
    if found is None or (found.format is not None and found.format.yields is Yields.NETWORK):
        return False
    step = found.next_step or f"name {wanted}"
    if found.format is not None:
        step = f"`fsoe-net init {place.file}` proposes a network from it"
    out.add("FSN117", place, f"this is {found.words}, not {wanted}", hint=step)
    return True


def other_document(data: bytes, kind: str) -> tuple[str, str] | None:
    """Return what a file is instead of a document of fsoe-net, and the next step.

    Args:
        data: The file.
        kind: Expected document: ``acceptance``, ``capture``, ``device``, ``recording`` or
            ``test-record``.

    Returns:
        ``None`` if it may be this document, or is unknown.
    """
    head = data[:_HEAD_BYTES]
    found = next((s for s in _RESULTS if re.match(s.begins, head)), None) or recognise(head)
    words, step = _DOCUMENTS[kind]
    if found is None or found.words == words:
        return None
    return f"this is {found.words}, not {words}", step


def refuse_other(data: bytes, kind: str, file: str, out: Collector) -> bool:
    """Report FSN140 for a file that cannot be this YAML document of fsoe-net."""
    is_yaml = (found := recognise(data)) is not None and found.kind == "yaml"
    # `check_structure` distinguishes the YAML documents by their keys.
    other = None if is_yaml else other_document(data, kind)
    if other is not None:
        out.add("FSN140", Span(file, 1, 1), other[0], hint=other[1])
    return other is not None


def is_format(data: bytes, kind: str, shown: str, out: Collector) -> bool:
    """Return whether the bytes may be of a format; otherwise FSN140 names the actual one.

    Args:
        data: The file.
        kind: Expected kind of format.
        shown: Name of the file.
        out: Takes FSN140.
    """
    place = Span(shown, 1, 1)
    if not data.strip():
        out.add("FSN140", place, "the file is empty", hint="export it again")
        return False
    found = recognise(data)
    if found is None or found.kind == kind:
        return True
    title = all_formats()[kind].title
    out.add(
        "FSN140",
        place,
        f"this is {found.words}, not {title}",
        hint=found.next_step or f"read it as what it is, or give {title}",
    )
    return False
