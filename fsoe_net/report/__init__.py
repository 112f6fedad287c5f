"""What a safety engineer hands in: the configuration as one report, and what changed in it."""

from fsoe_net.report.again import steps_again
from fsoe_net.report.budget import budget_document, budget_picture, budget_text
from fsoe_net.report.diff import Difference, compare
from fsoe_net.report.diff_read import (
    side_of_description,
    side_of_network,
    side_of_plan,
    side_of_scan,
)
from fsoe_net.report.diff_side import Side
from fsoe_net.report.diff_types import Change
from fsoe_net.report.document import Document
from fsoe_net.report.evidence import (
    Evidence,
    LiveEvidence,
    ask_live,
    longest_round_trips,
    measured_ms,
    read_evidence,
)
from fsoe_net.report.inputs import (
    Against,
    GivenPlan,
    GivenRecord,
    ReportInputs,
    TestStep,
    Tried,
)
from fsoe_net.report.make import make_document
from fsoe_net.report.protocol import protocol_page
from fsoe_net.report.protocol_steps import tried_of
from fsoe_net.report.sign_off import (
    Grounds,
    Reason,
    Refusal,
    SignedReport,
    read_signed_report,
    sign_off,
)
from fsoe_net.report.write import FORMATS, render_report
from fsoe_net.report.write_pdf import pdf_library, report_pdf

__all__ = [
    "FORMATS",
    "Against",
    "Change",
    "Difference",
    "Document",
    "Evidence",
    "GivenPlan",
    "GivenRecord",
    "Grounds",
    "LiveEvidence",
    "Reason",
    "Refusal",
    "ReportInputs",
    "Side",
    "SignedReport",
    "TestStep",
    "Tried",
    "ask_live",
    "budget_document",
    "budget_picture",
    "budget_text",
    "compare",
    "longest_round_trips",
    "make_document",
    "measured_ms",
    "pdf_library",
    "protocol_page",
    "read_evidence",
    "read_signed_report",
    "render_report",
    "report_pdf",
    "side_of_description",
    "side_of_network",
    "side_of_plan",
    "side_of_scan",
    "sign_off",
    "steps_again",
    "tried_of",
]
