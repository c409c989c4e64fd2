"""The report of a run: one file of HTML that opens without a network."""

from psstereo.normals.views import SampleViews, views_of
from psstereo.report.page import Report, render_report

__all__ = ["Report", "SampleViews", "render_report", "views_of"]
