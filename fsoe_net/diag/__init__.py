"""Diagnostics: what is wrong in a user's file, as data with a place and a mend."""

from fsoe_net.diag.catalogue import CATALOGUE, CodeInfo, code_info, nearest_code
from fsoe_net.diag.diagnostic import (
    Diagnostic,
    Edit,
    FindingList,
    Fix,
    Related,
    Severity,
    Span,
    sort_diagnostics,
)
from fsoe_net.diag.pause import without_collector
from fsoe_net.diag.printable import first_control, printable
from fsoe_net.diag.words import counted, summary

__all__ = [
    "CATALOGUE",
    "CodeInfo",
    "Diagnostic",
    "Edit",
    "FindingList",
    "Fix",
    "Related",
    "Severity",
    "Span",
    "code_info",
    "counted",
    "first_control",
    "nearest_code",
    "printable",
    "sort_diagnostics",
    "summary",
    "without_collector",
]
