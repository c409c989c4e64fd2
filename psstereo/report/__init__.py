"""The report of a run: one file of HTML that opens without a network."""

from psstereo.report.page import Report, render_report
from psstereo.report.views import SampleViews, views_of

__all__ = ["Report", "SampleViews", "render_report", "views_of"]
