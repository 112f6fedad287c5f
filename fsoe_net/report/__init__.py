"""What a safety engineer hands in: the configuration as one page."""

from fsoe_net.report.page import render_report, short_code

__all__ = ["render_report", "short_code"]
