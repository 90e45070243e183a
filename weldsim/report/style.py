"""Colours that page and picture share."""

INK, SOFT, GRID = "#1c2733", "#66727f", "#e3e7eb"
GOOD, AMBER, BAD = "#1b7f4b", "#a85b00", "#b3261e"
SEAM, LIPS, WIRE, KNOWN, REGION, CENTRE = "#e4572e", "#0b1d2c", "#12355b", "#2ca58d", "#8338ec", "#9b2915"
LINES = {"plan": SEAM, "executed": "#1f77b4"}
WIDTHS = {"plan": 3.2, "executed": 1.3}
JOINTS = ("#12355b", "#1f77b4", "#2ca58d", "#f6ae2d", "#e4572e", "#8e5572")
