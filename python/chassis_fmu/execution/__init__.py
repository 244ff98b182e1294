"""Runs of plans by FMPy, each in a process of its own."""
