"""The title block of a report in a network file: read as written, a wrong logo at its place."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image

from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.network import NetworkConfig

HEAD = "version: 1\nsubdevices: []\nnets: []\n"
MIB = 1024 * 1024


def picture(form: str, size: tuple[int, int] = (60, 20), **more: object) -> bytes:
    """Return a picture as another library writes it."""
    stream = io.BytesIO()
    Image.new("RGB", size, "navy").save(stream, form, **more)
    return stream.getvalue()


def load(folder: Path, report: str) -> tuple[NetworkConfig, list[Diagnostic]]:
    path = folder / "network.yaml"
    path.write_text(f"{HEAD}report: {report}\n", "utf-8")
    loaded = load_network([path])
    assert loaded.network is not None
    return loaded.network, [d for d in loaded.diagnostics if d.code != "FSN125"]


def test_the_facts_are_texts_as_written(tmp_path: Path):
    network, found = load(
        tmp_path, "{number: 0815, revision: B, date: 2026-11-21, customer: 'Möbel & Söhne'}"
    )
    facts = network.report
    assert (facts.number, facts.revision, facts.date) == ("0815", "B", "2026-11-21")
    assert (facts.customer, facts.logo, found) == ("Möbel & Söhne", None, [])


@pytest.mark.parametrize(
    ("form", "more", "media"),
    [
        ("PNG", {}, "image/png"),
        ("JPEG", {}, "image/jpeg"),
        ("JPEG", {"progressive": True}, "image/jpeg"),
        ("JPEG", {"comment": b"\xff\xc0" * 20}, "image/jpeg"),
    ],
)
def test_a_logo_is_read_and_is_a_source_of_the_network(
    tmp_path: Path, form: str, more: dict[str, object], media: str
):
    data = picture(form, **more)
    (tmp_path / "logo").write_bytes(data)
    network, found = load(tmp_path, "{logo: logo}")
    assert found == []
    assert network.report.logo is not None
    assert (network.report.logo.media, network.report.logo.data) == (media, data)
    assert str(tmp_path / "logo") in [s.path for s in network.sources]


WRONG = {
    "text": b"<svg onload='alert(1)'/>",
    "gif": picture("GIF"),
    "empty": b"",
    "only the signature of PNG": picture("PNG")[:8],
    "PNG without IHDR": picture("PNG").replace(b"IHDR", b"IDAT"),
    "only the start of JPEG": picture("JPEG")[:4],
    "JPEG that ends in a segment": picture("JPEG")[:165],
    "JPEG with segments of length 0": b"\xff\xd8" + b"\xff\xe0\x00\x00" * 1000,
    "wide PNG": picture("PNG", (4001, 1)),
    "high JPEG": picture("JPEG", (1, 4001)),
    "PNG of no width": picture("PNG").replace(b"IHDR\0\0\0\x3c", b"IHDR\0\0\0\0"),
    "large": picture("PNG") + bytes(MIB),
}


@pytest.mark.parametrize("data", WRONG.values(), ids=WRONG)
def test_a_wrong_logo_is_a_warning_at_its_name(tmp_path: Path, data: bytes):
    (tmp_path / "logo.png").write_bytes(data)
    network, found = load(tmp_path, "{number: 1, logo: logo.png}")
    assert network.report.logo is None
    assert network.report.number == "1"
    (one,) = found
    assert (one.code, one.level, one.span.line, one.span.column) == (
        "FSN169",
        Severity.WARNING,
        4,
        27,
    )
    assert one.hint


@pytest.mark.parametrize(
    "path", ["none.png", "../logo.png", "sub/../../logo.png", "link", "away/logo.png", "/dev/zero",
             "{}/logo.png", "sub"
    ]
)  # fmt: skip
def test_a_logo_outside_of_the_folder_or_that_is_no_file_is_not_read(tmp_path: Path, path: str):
    folder = tmp_path / "project"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "logo.png").write_bytes(picture("PNG"))
    (folder / "link").symlink_to(tmp_path / "logo.png")
    (folder / "away").symlink_to(tmp_path)
    network, found = load(folder, f'{{logo: "{path.format(tmp_path)}"}}')
    assert network.report.logo is None
    assert [(d.code, d.span.line) for d in found] == [("FSN169", 4)]


def test_an_unknown_key_names_the_right_one(tmp_path: Path):
    _, (one,) = load(tmp_path, "{customers: ACME}")
    assert (one.code, one.level) == ("FSN109", Severity.ERROR)
    assert "customer" in one.hint
