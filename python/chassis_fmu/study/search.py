"""Searches for the extreme of a metric: Optuna proposes batches of samples, the engine tries them.

The batches have a fixed size and their results are told in the order of their numbers, so the search depends on the
study alone, not on engine or number of processes.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from ..scenario import Value
from .factors import Factor
from .file import SAMPLES, Search, Study, StudyError
from .job import Done, Job

Evaluate = Callable[[int, Sequence[dict[str, Value]]], list[list[Done]]]
"""Takes the number of the first sample and values of a batch, gives the rows of each."""


def _sampler(search: Search, seed: int) -> Any:
    import optuna

    known = [
        n for n in dir(optuna.samplers) if n.endswith("Sampler") and n not in ("BaseSampler", "PartialFixedSampler")
    ]
    if search.sampler not in known:
        raise StudyError(f"search: unknown sampler `{search.sampler}`, expected one of {', '.join(known)}")
    options = dict(search.options)
    if search.sampler != "BruteForceSampler" or "seed" not in options:
        options.setdefault("seed", seed)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return getattr(optuna.samplers, search.sampler)(**options)
    except (TypeError, ValueError, ImportError) as error:
        raise StudyError(f"search: {search.sampler} cannot be made with these options: {error}") from error


def _suggest(trial: Any, factor: Factor) -> Value:
    """Let Optuna choose a value of a factor."""
    levels = factor.levels
    if levels is not None:
        chosen: Value = trial.suggest_categorical(factor.name, levels)
        return chosen
    if factor.distribution in ("uniform", "log_uniform"):
        log = factor.distribution == "log_uniform"
        found: Value = trial.suggest_float(factor.name, factor.min, factor.max, log=log)
        return found
    # A search has no probabilities, but the limits of a distribution: its share is searched between its ends.
    return factor.value(trial.suggest_float(factor.name, 0.01, 0.99))


def run(study: Study, job: Job, evaluate: Evaluate) -> list[list[Any]]:
    """Search; returns the values of all samples, by factor. Raises StudyError if the sampler cannot do it."""
    import optuna

    search = study.search
    if search is None:
        raise AssertionError("the study is checked")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with warnings.catch_warnings():
        # Options of samplers that may change, in the words of Optuna.
        warnings.simplefilter("ignore")
        trials = optuna.create_study(direction=search.direction, sampler=_sampler(search, study.seed))
        count = study.runs or SAMPLES
        columns: list[list[Any]] = [[] for _ in study.vary]
        for first in range(0, count, search.batch):
            asked = [trials.ask() for _ in range(min(search.batch, count - first))]
            values = [{f.name: _suggest(trial, f) for f in study.vary} for trial in asked]
            for column, factor in zip(columns, study.vary, strict=True):
                column += [v[factor.name] for v in values]
            for trial, rows in zip(asked, evaluate(first, values), strict=True):
                found = objective(job, search, rows)
                if found is None:
                    trials.tell(trial, state=optuna.trial.TrialState.FAIL)
                else:
                    trials.tell(trial, found)
    return columns


def objective(job: Job, search: Search, rows: Sequence[Done]) -> float | None:
    """Return the metric of a sample, of the case named or the extreme of all cells; None if it has none."""
    index = [m.name for m in job.plan.metrics].index(search.metric)
    at = job.metrics.index(index)
    found = []
    for row in rows:
        if search.case is not None and job.cells[row.cell].case != search.case:
            continue
        number = row.numbers[at] if row.numbers else None
        if number is None or not math.isfinite(number):
            return None
        found.append(number)
    if not found:
        return None
    # Of an optimum the worst cell counts, of a worst case the extreme itself.
    is_worst_case = job.study.method == "worst_case"
    return max(found) if (search.direction == "maximize") == is_worst_case else min(found)
