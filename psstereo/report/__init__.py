"""The report of a run: one file of HTML that opens without a network."""

from psstereo.normals.views import SampleViews, lamp_directions, views_of, views_under_lamps
from psstereo.report.page import Map, Report, render_report

__all__ = ["Map", "Report", "SampleViews", "lamp_directions", "render_report", "views_of", "views_under_lamps"]
