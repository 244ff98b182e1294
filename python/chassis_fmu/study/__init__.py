"""Studies: many runs of a scenario with varying values, and their evaluation.

`file` reads a study, `factors` describes the varied values, `design` chooses the values of all samples, `job` combines
them with the scenario, `engines` and `cluster` execute the runs, `journal` stores their rows, `table` writes them as
tables, `statistics`, `charts` and `report` evaluate them, and `app` is the command.
"""
