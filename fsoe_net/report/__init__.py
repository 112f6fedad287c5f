"""What a safety engineer hands in: the configuration as one page, and what changed in it."""

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
from fsoe_net.report.page import render_report
from fsoe_net.report.protocol import protocol_page

__all__ = [
    "Change",
    "Difference",
    "Side",
    "budget_document",
    "budget_picture",
    "budget_text",
    "compare",
    "protocol_page",
    "render_report",
    "side_of_description",
    "side_of_network",
    "side_of_plan",
    "side_of_scan",
]
