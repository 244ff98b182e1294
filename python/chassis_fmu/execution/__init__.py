"""Runs of plans by FMPy, in workers of `chassis run`."""
