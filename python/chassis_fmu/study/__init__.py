"""Studies: a scenario with values that vary, many runs of it, and what they tell.

`file` reads a study, `factors` are what varies, `design` chooses the values of all samples, `job` puts both together
with the scenario, `engines` and `cluster` execute it, `journal` keeps every row, `table` makes tables of them,
`statistics`, `charts` and `report` say what they mean, `app` is the command.
"""
