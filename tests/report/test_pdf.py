"""The report as PDF through an extra, and what is said where it is missing."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
import zlib
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import pytest
from cli.tool import fsn
from report.made import TIMED, inputs_of
from weekly import first

from fsoe_net.document.write_html import document_html
from fsoe_net.document.write_pdf import _for_print, document_pdf, pdf_library
from fsoe_net.errors import EnvironmentFault
from fsoe_net.report.compose import compose_report
from fsoe_net.report.formats import render_report

try:
    pdf_library()
except EnvironmentFault as missing:
    LACKING = str(missing)
else:
    LACKING = ""
assert not LACKING or "pdf" not in os.environ.get("FSN_REQUIRE", "").split(","), LACKING
needs_library = pytest.mark.skipif(bool(LACKING), reason=LACKING)
of_library = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def test_without_the_extra_the_message_names_it_and_the_way_by_a_browser(monkeypatch):
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    with pytest.raises(EnvironmentFault, match=r"pip install 'weasyprint>=70'.*\.html.*browser"):
        pdf_library()


def test_without_pango_the_message_names_it(monkeypatch, tmp_path: Path):
    (tmp_path / "weasyprint.py").write_text("raise OSError('cannot load library pango')\n", "utf-8")
    monkeypatch.delitem(sys.modules, "weasyprint", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(EnvironmentFault, match=r"cannot load library pango.*libpango.*browser"):
        pdf_library()


def test_the_command_is_reported_before_it_reads_anything(monkeypatch, tmp_path: Path):
    (tmp_path / "weasyprint.py").write_text("raise ImportError(name='weasyprint')\n", "utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    out = tmp_path / "r.pdf"
    # A fresh interpreter: the other one has its modules, and WeasyPrint where it is installed.
    call = [sys.executable, "-m", "fsoe_net.cli", "report", "no_such.yaml", "-o", str(out)]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "pip install 'weasyprint>=70', or write .html" in done.stderr
    assert "no_such" not in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()


def test_for_print_each_picture_has_its_own_rules_and_plain_colours():
    page = _for_print(render_report(inputs_of(TIMED), "html"))
    assert "<svg" not in page
    pictures = re.findall(r'<img[^>]* src="data:image/svg\+xml;base64,([^"]*)">', page)
    assert len(pictures) > 5
    for svg in (b64decode(data).decode() for data in pictures):
        assert svg.startswith("<svg")
        assert svg.count(' xmlns="http://www.w3.org/2000/svg"') == 1
        assert "var(" not in svg
        assert ".box{fill:#fff" in svg
    assert "position:running(head)" in page


@pytest.mark.uncounted
@needs_library
@of_library
def test_the_same_report_gives_the_same_bytes_with_head_and_number_on_each_page(tmp_path: Path):
    inputs = inputs_of(TIMED)
    level = logging.getLogger("weasyprint").level
    pdf = document_pdf(compose_report(inputs))
    assert logging.getLogger("weasyprint").level == level
    assert pdf == document_pdf(compose_report(inputs))
    assert pdf.startswith(b"%PDF-")
    for word in (b"/CreationDate", b"/ModDate"):
        assert word not in pdf
    boxes = re.findall(rb"/MediaBox \[([^\]]*)\]", _plain(pdf))
    assert len(boxes) >= 6
    assert {tuple(round(float(n)) for n in b.split()) for b in boxes} == {(0, 0, 595, 842)}


@pytest.mark.uncounted
@needs_library
@of_library
@pytest.mark.parametrize("place", ["@top-left", "@bottom-left"])
@pytest.mark.parametrize("long", first(1, ["W" * 200, "a name with very many words " * 9, ""]))
def test_head_and_foot_of_a_page_are_one_line(place: str, long: str):
    document = compose_report(inputs_of(TIMED))
    document = replace(document, title=document.title + long, foot=document.foot + long)
    seal = document.seal.split()
    for sheet in pdf_library().HTML(string=_for_print(document_html(document))).render().pages:
        texts = [
            part
            for box in sheet._page_box.children
            if getattr(box, "at_keyword", "") == place
            for part in box.descendants()
            if getattr(part, "text", "").strip()
        ]
        assert len({round(t.position_y + t.baseline) for t in texts}) == 1
        # A long title never pushes the fingerprint or the limits of the report off the page.
        whole = " ".join(t.text for t in texts)
        if place == "@top-left":
            assert whole.split()[-4:] == seal
        else:
            assert "black channel configuration, evidence and no certificate" in whole


@needs_library
@of_library
def test_the_command_writes_it(tmp_path: Path):
    out = tmp_path / "r.pdf"
    done = fsn("report", str(TIMED), "-o", str(out))
    assert (done.returncode, done.stderr) == (0, "")
    assert out.read_bytes().startswith(b"%PDF-")


def _plain(pdf: bytes) -> bytes:
    """Return the file with its compressed streams unpacked behind it."""
    found = [pdf]
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", pdf, flags=re.S):
        try:
            found.append(zlib.decompressobj().decompress(stream))
        except zlib.error:
            continue
    return b"".join(found)
