"""Scanning: which views to take (`plan`), and the arm's way to them (`tour`)."""
