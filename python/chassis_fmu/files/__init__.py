"""Files of scenarios and runs: plans, recordings, descriptions of FMUs."""
