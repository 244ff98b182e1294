"""Numbers of runs: metrics, the table of results, and its badges."""
