"""The forms of a report, by the ending of its file."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from fsoe_net.document.model import Document
from fsoe_net.document.write_html import report_html
from fsoe_net.document.write_markdown import report_markdown
from fsoe_net.report.compose import compose_report
from fsoe_net.report.inputs import ReportInputs
from fsoe_net.report.report_json import report_json

__all__ = ["FORMATS", "render_report"]

FORMATS: Mapping[str, Callable[[Document], str]] = {
    "html": report_html,
    "md": report_markdown,
    "json": report_json,
}
"""Writers of text by the ending of the file, without its dot; PDF is no text."""


def render_report(inputs: ReportInputs, form: str = "html") -> str:
    """Return the report in one of `FORMATS`. The same input gives the same text.

    Raises:
        KeyError: There is no such form.
    """
    return FORMATS[form](compose_report(inputs))
