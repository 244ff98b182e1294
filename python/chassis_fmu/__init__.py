"""Runs the scenarios of this repository with fmpy and reports the results beside the papers' numbers."""
