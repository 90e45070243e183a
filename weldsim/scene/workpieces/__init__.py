"""Workpieces: solids with their true seams."""
