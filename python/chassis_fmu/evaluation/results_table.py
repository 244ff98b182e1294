"""The table of metrics: values of all runs, statistics over the seeds, changes, the paper's numbers and the badges."""

from __future__ import annotations

import functools
import itertools
import statistics
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import msgspec

from ..files.plan import Cell, Check, Finding, Metric, Plan
from . import grading
from .grading import Status

# A baseline below this share of the largest value of its metric is negligible: changes from it have no percentage.
RESOLUTION = 0.005

# Metric, case, point, seed.
Values = Mapping[tuple[str, str, "str | None", "int | None"], float]


@dataclass(frozen=True)
class Statistic:
    """Mean over the seeds, and the sample standard deviation if there are several."""

    mean: float
    deviation: float | None
    count: int

    @staticmethod
    def of(values: Sequence[float]) -> Statistic | None:
        """Return the statistic of the values; None if there are none."""
        if not values:
            return None
        deviation = statistics.stdev(values) if len(values) > 1 else None
        return Statistic(statistics.fmean(values), deviation, len(values))


def change(value: float, baseline: float) -> float | None:
    """Return the change in percent of the magnitude of the baseline; None if the baseline is zero."""
    return None if baseline == 0.0 else 100.0 * (value - baseline) / abs(baseline)


@dataclass(frozen=True)
class Row:
    """One metric of one case at one point: our value and the paper's. Changes and differences are in percent.

    `origin` is "calibrated" (a parameter was fitted to the paper's value) or "predicted"; empty if the scenario does
    not specify it. `status` is the badge, None without a value from a paper. `negligible`: the baseline is negligible.
    """

    metric: Metric
    case: str
    point: str | None
    ours: Statistic | None
    change: Statistic | None
    paper: float | None
    paper_change: float | None
    origin: str = ""
    status: Status | None = None
    negligible: bool = False

    @property
    def difference(self) -> float | None:
        """Difference between our mean and the paper's value, in percent of the paper's value."""
        return None if self.ours is None or self.paper is None else change(self.ours.mean, self.paper)


class Verdict(msgspec.Struct, frozen=True):
    """Verdict on a requirement for a metric of a case at a point: badge, and text with the limits and the result."""

    status: Status
    text: str


def _key(cell: Cell) -> str:
    """Return the key of the paper's numbers: `case` or `case@point`."""
    return cell.case if cell.point is None else f"{cell.case}@{cell.point}"


class Numbers:
    """Values of the metrics in all runs of a scenario, and the numbers from the paper.

    `finished` contains the ids of the complete runs; None if all are. `verdicts` are the verdicts on the requirements.
    """

    def __init__(
        self,
        plan: Plan,
        values: Values,
        finished: Collection[str] | None = None,
        verdicts: Sequence[Verdict] = (),
    ) -> None:
        self.plan = plan
        self.verdicts = verdicts
        self._values = values
        runs = [r for r in plan.runs if finished is None or r.id in finished]
        self._finished = {(r.case, r.point) for r in runs}

    def metric(self, cell: Cell) -> Metric:
        """Return the definition of a cell's metric."""
        return self.plan.metrics[cell.metric]

    def by_seed(self, cell: Cell) -> dict[int | None, float]:
        """Return the values of a cell by seed, without seeds that have no value."""
        name = self.metric(cell).name
        keys = ((seed, (name, cell.case, cell.point, seed)) for seed in self.plan.seed_values)
        return {seed: self._values[key] for seed, key in keys if key in self._values}

    def statistic(self, cell: Cell) -> Statistic | None:
        """Return the statistic over the seeds; None without a value."""
        return Statistic.of(list(self.by_seed(cell).values()))

    def pairs(self, cell: Cell, against: Cell) -> list[tuple[float, float]]:
        """Return pairs of values of two cells, for the seeds with which both have a value."""
        ours, theirs = self.by_seed(cell), self.by_seed(against)
        return [(value, theirs[seed]) for seed, value in ours.items() if seed in theirs]

    @functools.cached_property
    def _scales(self) -> dict[str, float]:
        """The largest magnitude of each metric."""
        scales: dict[str, float] = {}
        for (name, *_), value in self._values.items():
            scales[name] = max(scales.get(name, 0.0), abs(value))
        return scales

    def is_negligible(self, cell: Cell) -> bool:
        """Return whether a value is negligible compared with the largest one of its metric."""
        found = self.statistic(cell)
        return found is not None and abs(found.mean) < RESOLUTION * self._scales[self.metric(cell).name]

    def change(self, cell: Cell, against: Cell) -> Statistic | None:
        """Return the statistic of the change in percent, computed seed by seed, which cancels common scatter.

        None without common seeds, or if the value of `against` is negligible.
        """
        return Statistic.of(list(self._percents(cell, against).values()))

    def changes(self, cell: Cell) -> dict[int | None, float]:
        """Return the change from the baseline in percent, by seed; empty if the baseline is negligible."""
        against = self.baseline(cell)
        return {} if against is None else self._percents(cell, against)

    def _percents(self, cell: Cell, against: Cell) -> dict[int | None, float]:
        """Return the change in percent, by seed; empty if the value of `against` is negligible."""
        ours, theirs = self.by_seed(cell), {} if self.is_negligible(against) else self.by_seed(against)
        percents = {seed: change(value, theirs[seed]) for seed, value in ours.items() if seed in theirs}
        return {seed: percent for seed, percent in percents.items() if percent is not None}

    def baseline(self, cell: Cell) -> Cell | None:
        """Return the cell of the baseline of a cell's case."""
        case = next(c for c in self.plan.cases if c.name == cell.case)
        return None if case.baseline is None else Cell(cell.metric, case.baseline, cell.point)

    def paper_value(self, cell: Cell) -> float | None:
        """Return the paper's value."""
        paper = self.metric(cell).paper
        return None if paper is None else paper.values.get(_key(cell))

    def paper_change(self, cell: Cell, against: Cell) -> float | None:
        """Return the paper's change in percent, printed or computed from its values."""
        paper = self.metric(cell).paper
        if paper is None or cell.metric != against.metric:
            return None
        printed = paper.changes.get(f"{_key(cell)}/{_key(against)}")
        if printed is not None:
            return printed
        value, base = self.paper_value(cell), self.paper_value(against)
        return None if value is None or base is None else change(value, base)

    def is_calibrated(self, cell: Cell, against: Cell | None = None) -> bool:
        """Return whether a parameter was fitted to the paper's number."""
        paper = self.metric(cell).paper
        fitted = (paper.calibrated if paper else None) or ()
        return _key(cell) in fitted or (against is not None and f"{_key(cell)}/{_key(against)}" in fitted)

    def _origin(self, cell: Cell) -> str:
        """Return `Row.origin`."""
        paper = self.metric(cell).paper
        if paper is None or paper.calibrated is None or _key(cell) not in paper.values:
            return ""
        return "calibrated" if self.is_calibrated(cell) else "predicted"

    def status_of(self, cell: Cell) -> Status | None:
        """Return the badge for a number from the paper: for its change if there is one, otherwise for its value."""
        against = self.baseline(cell)
        if against is not None and self.paper_change(cell, against) is not None:
            return self.status(Check(cell, against, "paper_change", None))
        if self.paper_value(cell) is not None:
            return self.status(Check(cell, None, "paper_value", None))
        return None

    def _is_cut_off(self, metric: Metric) -> bool:
        """Return whether the runs were shortened to end before the metric's window does."""
        if metric.uses:
            return any(self._is_cut_off(self.plan.metrics[index]) for index in metric.uses)
        window = metric.window
        return self.plan.is_cut and (window is None or window[1] > self.plan.simulation.stop)

    def status(self, check: Check) -> Status:
        """Return the badge of one check."""
        cell, against = check.cell, check.against
        for of in (cell,) if against is None else (cell, against):
            if (of.case, of.point) not in self._finished or self._is_cut_off(self.metric(of)):
                return Status.OPEN
        ours = self.statistic(cell)
        if check.expect == "never":
            return Status.REPRODUCED if ours is None else Status.NOT_REPRODUCED
        if ours is None:
            return Status.NOT_REPRODUCED
        if check.expect == "paper_value":
            paper = self.paper_value(cell)
            if paper is None:
                return Status.OPEN
            return Status.CALIBRATED if self.is_calibrated(cell) else grading.of_value(ours.mean, paper)
        if check.expect in ("below", "above"):
            level = check.level or 0.0
            difference = grading.paired((value, level) for value in self.by_seed(cell).values())
            return grading.of_sign(difference, 1 if check.expect == "above" else -1)
        if check.expect == "falls_more" and against is not None:
            mine, other = self.changes(cell), self.changes(against)
            both = [(percent, other[seed]) for seed, percent in mine.items() if seed in other]
            if not both or sum(mine.values()) >= 0.0:
                return Status.NOT_REPRODUCED
            return grading.of_sign(grading.paired(both), -1)
        pairs = [] if against is None else self.pairs(cell, against)
        if against is None or not pairs:
            return Status.NOT_REPRODUCED
        difference = grading.paired(pairs)
        found = self.change(cell, against)
        percent = None if found is None else found.mean
        if check.expect in ("lower", "higher"):
            return grading.of_sign(difference, 1 if check.expect == "higher" else -1, percent)
        if check.expect == "unchanged":
            if percent is None:
                # A change from a negligible value has no percentage. "Unchanged" then means that the new value is
                # negligible, too.
                return Status.REPRODUCED if self.is_negligible(cell) else Status.NOT_REPRODUCED
            return grading.of_no_change(difference, percent)
        paper = self.paper_change(cell, against)
        if paper is None:
            return Status.OPEN
        if self.is_calibrated(cell, against):
            return Status.CALIBRATED
        return grading.of_change(difference, percent, paper)

    def finding(self, finding: Finding) -> Status:
        """Return the badge of a finding from its worst check; a claim that is not from a paper holds or does not."""
        status = grading.worst(self.status(check) for check in finding.checks)
        if not finding.own or status is Status.OPEN:
            return status
        return Status.OWN_RESULT if status is Status.REPRODUCED else Status.REFUTED

    def table(self) -> list[Row]:
        """Return the rows of all metrics, ordered by metric, point, case."""
        places = itertools.product(range(len(self.plan.metrics)), self.plan.point_names, self.plan.case_titles)
        return [self._row(Cell(index, case, point)) for index, point, case in places]

    def _row(self, cell: Cell) -> Row:
        against = self.baseline(cell)
        return Row(
            metric=self.metric(cell),
            case=cell.case,
            point=cell.point,
            ours=self.statistic(cell),
            change=None if against is None else self.change(cell, against),
            paper=self.paper_value(cell),
            paper_change=None if against is None else self.paper_change(cell, against),
            origin=self._origin(cell),
            status=self.status_of(cell),
            negligible=against is not None and self.is_negligible(against),
        )
