"""A document as PDF: the HTML page printed to A4 by WeasyPrint (the extra ``pdf``)."""

from __future__ import annotations

import logging
import re
from base64 import b64encode
from typing import Any

from fsoe_net.diag.packages import missing_package
from fsoe_net.diag.pause import without_collector
from fsoe_net.document.model import Document
from fsoe_net.document.style import PICTURES, STYLE
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import EnvironmentFault

_OTHERWISE = "or write .html and print it to a PDF file in a browser"

# Header and footer are in the margins; a table around the page would be slow.
_PRINT = """
@page{margin:22mm 13mm 20mm 15mm;
@top-left{content:element(head);width:100%;vertical-align:bottom;padding-bottom:2mm}
@bottom-left{content:element(foot);width:87%;vertical-align:top;padding-top:1mm;margin-top:3mm;
border-top:1px solid #000}
@bottom-right{width:13%;vertical-align:top;padding-top:1mm;margin-top:3mm;
border-top:1px solid #000}}
.sheet,.sheet>tbody,.sheet>tbody>tr,.sheet>tbody>tr>td,.sheet>thead,.sheet>thead>tr,
.sheet>thead>tr>td,.sheet>tfoot,.sheet>tfoot>tr,.sheet>tfoot>tr>td{display:block}
.pagehead{position:running(head);margin:0}.pagefoot{position:running(foot);
margin:0;padding:0;border:0}img.logo{width:auto}
img{width:100%;height:auto;object-fit:contain;object-position:left top}
img.window{max-height:46px}figure img{max-height:225mm}.narrow{display:none}
"""


def pdf_library() -> Any:
    """Return WeasyPrint.

    Raises:
        EnvironmentFault: WeasyPrint or a system library that it needs is not installed.
    """
    try:
        import weasyprint
    except ImportError as exc:
        reason = missing_package("PDF", exc.name, "pdf")
        raise EnvironmentFault(f"{reason}, {_OTHERWISE}") from exc
    except OSError as exc:
        first = str(exc).partition("\n")[0]
        raise EnvironmentFault(
            f"PDF needs WeasyPrint, which misses a library of the system ({first}); install Pango "
            f"(Debian, Ubuntu: libpango-1.0-0 libpangoft2-1.0-0), {_OTHERWISE}"
        ) from exc
    return weasyprint


@without_collector
def document_pdf(document: Document) -> bytes:
    """Return the document as PDF without a date: equal input, library and fonts give equal bytes.

    Raises:
        InputError: WeasyPrint is not installed.
    """
    library = pdf_library()
    log = logging.getLogger("weasyprint")
    level = log.level
    log.setLevel(logging.CRITICAL)  # warnings about rules for screens and other browsers
    try:
        # A document needs nothing external: its pictures are in the page.
        inside = library.urls.URLFetcher(allowed_protocols=("data",))
        page = _for_print(document_html(document))
        return bytes(library.HTML(string=page, url_fetcher=inside).write_pdf())
    finally:
        log.setLevel(level)


def _for_print(page: str) -> str:
    """Return the page with its pictures as images, to which the rules of the page do not apply.

    Each picture therefore contains its own style. Inline pictures would take as long as the text.
    """
    colours = dict(re.findall(r"--([\w-]+):([^;}]+)", STYLE.partition("@media")[0]))
    light = re.sub(r"var\(--([\w-]+)[^)]*\)", lambda m: colours[m[1]], PICTURES)

    def as_image(match: re.Match[str]) -> str:
        svg = re.sub(r"var\(--([\w-]+)[^)]*\)", lambda m: colours[m[1]], match[0])
        head, _, rest = svg.partition(">")
        shown = "".join(re.findall(r' (?:class|style)="[^"]*"', head))
        space = "" if "xmlns=" in head else ' xmlns="http://www.w3.org/2000/svg"'
        picture = f"{head}{space}><style>{light}</style>{rest}"
        data = b64encode(picture.encode()).decode()
        return f'<img{shown} src="data:image/svg+xml;base64,{data}">'

    page = re.sub(r"<svg.*?</svg>", as_image, page, flags=re.S)
    return page.replace("</style></head>", f"{_PRINT}</style></head>", 1)
