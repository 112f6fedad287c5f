"""The formats of a report, by the suffix of its file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping

from fsoe_net.document.write_html import document_html
from fsoe_net.document.write_json import item_json, part_json, section_json
from fsoe_net.document.write_markdown import document_markdown
from fsoe_net.report.compose import compose_report
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.model import ReportDocument


def _json(d: ReportDocument) -> str:
    """Return the report as JSON text (``schemas/report.schema.json``)."""
    document = {
        "format": "fsoe-net report",
        "version": 1,
        "tool": {"name": "fsoe-net", "version": d.version},
        "project": d.title,
        "network": d.network,
        "fingerprint": {"short": d.seal, "whole": d.whole} if d.whole else None,
        "verdict": item_json(d.verdict),
        "of_machine": d.of_machine,
        "lead": [part_json(p) for p in (d.title_block, *d.lead) if p is not None],
        "blocks": [section_json(n, s) for n, s in enumerate(d.sections, 1)],
        "findings": [f.to_json() for f in d.findings],
        "points": [{"kind": p.kind.value, "block": title, "text": p.text} for title, p in d.points],
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


FORMATS: Mapping[str, Callable[[ReportDocument], str]] = {
    "html": document_html,
    "md": document_markdown,
    "json": _json,
}
"""Text writers by the suffix of the file, without its dot; PDF is not text."""


def render_report(inputs: ReportInputs, form: str = "html") -> str:
    """Return the report in one of `FORMATS`. The same input gives the same text.

    Raises:
        KeyError: Unknown format.
    """
    return FORMATS[form](compose_report(inputs))
