"""A document as PDF: the same page as HTML, printed to A4 by WeasyPrint (the extra ``pdf``)."""

from __future__ import annotations

import logging
import re
from typing import Any, NoReturn

from fsoe_net.diag.pause import without_collector
from fsoe_net.document.model import Document
from fsoe_net.document.style import PICTURES, STYLE
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import InputError

__all__ = ["document_pdf", "pdf_library"]

_OTHERWISE = "or write .html and print it to a PDF file in a browser"

# Head and foot go into the margins instead of a table around the page, which would be slow.
_PRINT = """
@page{margin:22mm 13mm 20mm 15mm;
@top-left{content:element(head);width:100%;vertical-align:bottom;padding-bottom:2mm}
@bottom-left{content:element(foot);width:82%;vertical-align:top;padding-top:1mm;margin-top:3mm;
border-top:1px solid #000}
@bottom-right{width:18%;vertical-align:top;padding-top:1mm;margin-top:3mm;
border-top:1px solid #000}}
.sheet,.sheet>tbody,.sheet>tbody>tr,.sheet>tbody>tr>td,.sheet>thead,.sheet>thead>tr,
.sheet>thead>tr>td,.sheet>tfoot,.sheet>tfoot>tr,.sheet>tfoot>tr>td{display:block}
.pagehead{position:running(head);margin:0}.pagefoot{position:running(foot);
margin:0;padding:0;border:0}
"""


def pdf_library() -> Any:
    """Return WeasyPrint.

    Raises:
        InputError: It, or a library of the system that it needs, is not installed.
    """
    try:
        import weasyprint
    except ImportError as exc:
        raise InputError(
            "PDF needs WeasyPrint, which is not installed; install it with "
            f"pip install 'fsoe-net[pdf]', {_OTHERWISE}"
        ) from exc
    except OSError as exc:
        first = str(exc).partition("\n")[0]
        raise InputError(
            f"PDF needs WeasyPrint, which misses a library of the system ({first}); install Pango "
            f"(Debian, Ubuntu: libpango-1.0-0 libpangoft2-1.0-0), {_OTHERWISE}"
        ) from exc
    return weasyprint


@without_collector
def document_pdf(document: Document) -> bytes:
    """Return the document as PDF, without a date: same input, library and fonts, same bytes.

    Raises:
        InputError: WeasyPrint is not installed.
    """
    library = pdf_library()
    log = logging.getLogger("weasyprint")
    level = log.level
    log.setLevel(logging.CRITICAL)  # of rules for screens and other browsers
    try:
        page = library.HTML(
            string=_for_print(document_html(document)), url_fetcher=_nothing_outside
        )
        return bytes(page.write_pdf())
    finally:
        log.setLevel(level)


def _nothing_outside(url: str, *_: object, **__: object) -> NoReturn:
    raise ValueError(f"a document needs nothing from outside, not even {url}")


def _for_print(page: str) -> str:
    """Return the page with its pictures styled in themselves: they see no rules of the page."""
    colours = dict(re.findall(r"--([\w-]+):([^;}]+)", STYLE.partition("@media")[0]))
    light = re.sub(r"var\(--([\w-]+)[^)]*\)", lambda m: colours[m[1]], PICTURES)

    def styled(match: re.Match[str]) -> str:
        svg = re.sub(r"var\(--([\w-]+)[^)]*\)", lambda m: colours[m[1]], match[0])
        return re.sub(r"^<svg[^>]*>", lambda m: f"{m[0]}<style>{light}</style>", svg)

    page = re.sub(r"<svg.*?</svg>", styled, page, flags=re.S)
    return page.replace("</style></head>", f"{_PRINT}</style></head>", 1)
