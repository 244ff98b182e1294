"""Metrics of runs, the table of results, and its badges."""
