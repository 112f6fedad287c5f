"""What all pages share: one self-contained HTML file, no script, prints well."""

from __future__ import annotations

from collections.abc import Iterable

from fsoe_net.document.markup import escape

__all__ = ["html_page", "table"]

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2328;max-width:1060px;margin:2em auto;
padding:0 1em}
h1{margin-bottom:.1em}h2{margin-top:2em;border-bottom:1px solid #d0d7de;padding-bottom:.2em}
table{border-collapse:collapse;width:100%;margin:.6em 0}th,td{text-align:left;padding:.3em .6em;
border-bottom:1px solid #d0d7de;vertical-align:top}th{background:#f6f8fa}code{font-size:.92em}
.code{font:bold 1.15em ui-monospace,monospace;letter-spacing:.06em}.muted{color:#57606a}
.note{border-left:4px solid #57606a;padding:.2em 1em;background:#f6f8fa}
.error{color:#b00020;font-weight:600}.warning{color:#9a6700;font-weight:600}.info{color:#57606a}
.pass{color:#1a7f37;font-weight:600}.fail{color:#b00020;font-weight:600}
svg{width:100%;height:auto;font-family:inherit}svg.bytes{max-width:640px}
.box{fill:#fff;stroke:#57606a;stroke-width:1.5}.box.main{fill:#ddf4ff;stroke:#0969da}
.box.sub{fill:#fff8c5;stroke:#9a6700}.bus{stroke:#8c959f;stroke-width:5}
.arc{fill:none;stroke-width:2.5}.name{font-size:15px;font-weight:600}
.small{font-size:11.5px;fill:#424a53}
.label{font-size:12px;font-weight:600;paint-order:stroke;stroke:#fff;stroke-width:4px}
.tiny{font-size:9px;fill:#57606a}.sm{fill:#eaeef2;stroke:#8c959f}.tick{stroke:#fff;stroke-width:.8}
.sign td{height:2.2em}
code{overflow-wrap:anywhere}
@media screen and (max-width:700px){body{margin:.6em auto}table{display:block;overflow-x:auto}
figure,p:has(>svg){overflow-x:auto}}
@media print{@page{size:A4;margin:13mm 13mm 15mm;@bottom-right{content:"page " counter(page) " of "
counter(pages);font:8.5pt sans-serif}}
body{max-width:none;margin:0;padding:0;font-size:9.3pt;-webkit-print-color-adjust:exact;
print-color-adjust:exact}
h2,h3{break-after:avoid}tr,figure,.note{break-inside:avoid}a{color:inherit}}
"""


def html_page(title: str, body: Iterable[str], *, style: str = "") -> str:
    """Return a page.

    Args:
        title: Its title, as plain text.
        body: Its parts, as HTML.
        style: Further rules of this page.
    """
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}'
        f'</title><meta name="viewport" content="width=device-width"><style>{_STYLE}{style}</style>'
        f"</head><body>\n{chr(10).join(body)}\n</body></html>\n"
    )


def table(head: Iterable[str], rows: Iterable[Iterable[str]], cls: str = "") -> str:
    """Return a table. Cells are HTML; callers escape what is not theirs."""
    top = "".join(f"<th>{h}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return f'<table class="{cls}"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>'
