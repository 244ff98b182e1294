"""Searches for the extreme of a metric: Optuna proposes batches of samples, the engine executes them.

The batches have a fixed size, and Optuna gets their results in the order of the sample numbers, so a search depends
only on the study, not on engine or number of processes.
"""

from __future__ import annotations

import contextlib
import difflib
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ..scenario import Value
from .factors import Factor
from .file import SAMPLES, Search, Study, StudyError, needed
from .job import Done, Job

Evaluate = Callable[[int, Sequence[dict[str, Value]]], list[list[Done]]]
"""Takes the number of the first sample and the values of a batch; returns the rows of each sample."""


# Optuna samplers that can propose batches, and the packages that they need in addition to Optuna.
SAMPLERS: dict[str, tuple[str, ...]] = {
    "TPESampler": (),
    "CmaEsSampler": ("cmaes",),
    "GPSampler": ("torch", "scipy"),
    "NSGAIISampler": (),
    "NSGAIIISampler": (),
    "QMCSampler": ("scipy",),
    "RandomSampler": (),
}

# Samplers that try all combinations; a sweep replaces them.
EXHAUSTIVE = ("BruteForceSampler", "GridSampler")


def _sampler(search: Search, seed: int) -> Any:
    """Make the sampler; raises StudyError if its name or options are invalid."""
    import optuna

    name = search.sampler
    if name in EXHAUSTIVE:
        raise StudyError(f'search: {name} tries all combinations of values; method = "sweep" does that')
    if name not in SAMPLERS:
        known = {sampler.lower(): sampler for sampler in SAMPLERS}
        close = difflib.get_close_matches(name.lower(), known, 1)
        hint = f"; did you mean `{known[close[0]]}`?" if close else ""
        raise StudyError(f"search: unknown sampler `{name}`, expected one of {', '.join(SAMPLERS)}{hint}")
    needed(f"search: {name}", *SAMPLERS[name], otherwise=", or choose another sampler")
    with _explained(f"{name} cannot be made with the options {dict(search.options)}"):
        return getattr(optuna.samplers, name)(**{"seed": seed, **search.options})


@contextlib.contextmanager
def _explained(what: str) -> Iterator[None]:
    """Raise StudyError for any exception from Optuna or a sampler, because they do not document their exceptions."""
    try:
        with warnings.catch_warnings():
            # Hides Optuna's warnings about experimental options.
            warnings.simplefilter("ignore")
            yield
    except Exception as error:
        kind = type(error).__name__
        raise StudyError(f"search: {what}: {kind}: {error}") from error


def _suggest(trial: Any, factor: Factor) -> Value:
    levels = factor.levels
    if levels is not None:
        chosen: Value = trial.suggest_categorical(factor.name, levels)
        return chosen
    if factor.distribution in ("uniform", "log_uniform"):
        log = factor.distribution == "log_uniform"
        found: Value = trial.suggest_float(factor.name, factor.min, factor.max, log=log)
        return found
    # A search uses only the limits of a distribution: it proposes shares within them.
    return factor.value(trial.suggest_float(factor.name, *factor.reach))


def run(study: Study, job: Job, evaluate: Evaluate) -> list[list[Any]]:
    """Search; returns the values of all samples, by factor. Raises StudyError if the sampler fails."""
    needed(f"method {study.method} with [search]", "optuna")
    import optuna

    search = study.search
    if search is None:
        raise AssertionError("the study is checked")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = _sampler(search, study.seed)
    trials = optuna.create_study(direction=search.direction, sampler=sampler)
    count = study.runs or SAMPLES
    columns: list[list[Any]] = [[] for _ in study.vary]
    for first in range(0, count, search.batch):
        with _explained(f"{search.sampler} cannot propose samples"):
            asked = [trials.ask() for _ in range(min(search.batch, count - first))]
            values = [{f.name: _suggest(trial, f) for f in study.vary} for trial in asked]
        for column, factor in zip(columns, study.vary, strict=True):
            column += [v[factor.name] for v in values]
        done = evaluate(first, values)
        with _explained(f"{search.sampler} cannot use the results"):
            for trial, rows in zip(asked, done, strict=True):
                found = objective(job, search, rows)
                if found is None:
                    trials.tell(trial, state=optuna.trial.TrialState.FAIL)
                else:
                    trials.tell(trial, found)
    return columns


def objective(job: Job, search: Search, rows: Sequence[Done]) -> float | None:
    """Return the metric of a sample in the chosen case, or its extreme over all cells; None if it has no value.

    In a worst-case search, a failed run is the worst case: its metric is infinite in the direction of the search.
    """
    is_worst_case = job.study.method == "worst_case"
    index = [m.name for m in job.plan.metrics].index(search.metric)
    at = job.metrics.index(index)
    chosen = [row for row in rows if search.case is None or job.cells[row.cell].case == search.case]
    if is_worst_case and any(row.status != "ok" for row in chosen):
        return math.inf if search.direction == "maximize" else -math.inf
    numbers = [row.numbers[at] if row.numbers else None for row in chosen]
    found = [number for number in numbers if number is not None and math.isfinite(number)]
    if not found or len(found) < len(numbers):
        return None
    # An optimization uses the worst cell, a worst-case search the most extreme cell.
    return max(found) if (search.direction == "maximize") == is_worst_case else min(found)
