"""Files that are often given and that nothing reads as they are: what they are, and what to do."""

from __future__ import annotations

from fsoe_net.formats.registry import Signature

_UNPACK = "unpack it, then name the files in it"
_AGAIN = "fetch the file itself; this is what came instead of it"
BUILDER_PROJECT = "which looks like a project of an ENI builder, not its ENI"

# What it is, how it begins, the next step.
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
UNSUPPORTED = (
    *(Signature(words=w, begins=begins, next_step=step) for w, begins, step in _BEGINNINGS),
    *(Signature(words=w, root=root, next_step=step) for root, (w, step) in _ROOTS.items()),
)
