"""The table of metrics, and the badges of its numbers and of the findings."""

import math

import pytest
from msgspec.structs import replace

from chassis_fmu.evaluation import results_table as numbers
from chassis_fmu.evaluation.grading import Status
from chassis_fmu.evaluation.results_table import Numbers, Statistic
from chassis_fmu.files.plan import Cell, Check, Expect, Finding, Plan, Point


def test_statistics() -> None:
    assert Statistic.of([]) is None
    assert Statistic.of([2.0]) == Statistic(2.0, None, 1)
    # The sample standard deviation of 1, 2, 3, 4 is sqrt(5/3).
    four = Statistic.of([1.0, 2.0, 3.0, 4.0])
    assert four is not None
    assert four.mean == 2.5
    assert four.deviation == pytest.approx(math.sqrt(5.0 / 3.0), rel=1e-15)


def test_change() -> None:
    assert numbers.change(3.0, 4.0) == -25.0
    assert numbers.change(-3.0, -4.0) == 25.0
    assert numbers.change(1.0, 0.0) is None


def values(scenario: Plan) -> dict[tuple[str, str, str | None, int | None], float]:
    assert scenario.seeds == (1, 2)
    return {
        ("roll_rms", "passive", None, 1): 4.0,
        ("roll_rms", "passive", None, 2): 8.0,
        ("roll_rms", "active", None, 1): 3.0,
        ("roll_rms", "active", None, 2): 7.0,
        ("count_final", "passive", None, 1): 3.0,
    }


def test_changes_are_paired_by_seed(scenario: Plan) -> None:
    passive, active, count_passive, count_active = Numbers(scenario, values(scenario)).table()
    assert passive.ours is not None
    assert (passive.ours.mean, passive.ours.count) == (6.0, 2)
    # The sample standard deviation of 4 and 8.
    assert passive.ours.deviation == pytest.approx(math.sqrt(8.0), rel=1e-15)
    assert passive.change is None
    assert passive.paper == 4.0
    assert passive.difference == 50.0
    # The changes of the seeds are -25 % and -12.5 %; the change of the means would be 5/6 - 1 = -16.7 %.
    assert active.change is not None
    assert active.change.mean == -18.75
    assert active.paper_change == -25.0
    assert count_passive.ours == Statistic(3.0, None, 1)
    assert count_active.ours is None
    assert count_active.change is None


def test_a_seed_without_its_baseline_has_no_change(scenario: Plan) -> None:
    some = values(scenario)
    del some["roll_rms", "passive", None, 2]
    active = Numbers(scenario, some).table()[1]
    assert active.ours is not None
    assert active.ours.count == 2
    assert active.change == Statistic(-25.0, None, 1)


def test_the_paper_is_looked_up_by_case_and_point(scenario: Plan) -> None:
    first = scenario.metrics[0]
    assert first.paper is not None
    paper = replace(first.paper, values={"passive@slow": 2.0, "active@slow": 1.0, "active@fast": 5.0})
    swept = replace(
        scenario,
        points=(Point("slow", "5 km/h", 5.0, None), Point("fast", "35 km/h", 35.0, None)),
        metrics=(replace(first, paper=paper),),
    )
    cells = Numbers(swept, {}).table()
    assert [(c.point, c.case, c.paper, c.paper_change) for c in cells] == [
        ("slow", "passive", 2.0, None),
        ("slow", "active", 1.0, -50.0),
        ("fast", "passive", None, None),
        ("fast", "active", 5.0, None),
    ]


def test_origins_are_those_the_scenario_says(scenario: Plan) -> None:
    first = scenario.metrics[0]
    assert first.paper is not None
    assert {c.origin for c in Numbers(scenario, {}).table()} == {""}
    paper = replace(first.paper, calibrated=("passive",))
    said = replace(scenario, metrics=(replace(first, paper=paper), scenario.metrics[1]))
    assert [c.origin for c in Numbers(said, {}).table()] == ["calibrated", "predicted", "", ""]


PASSIVE, ACTIVE = Cell(0, "passive", None), Cell(0, "active", None)
Key = tuple[str, str, str | None, int | None]


def seeded(plan: Plan, passive: list[float], active: list[float]) -> Numbers:
    """Return the numbers of a plan with as many seeds as values of the first metric."""
    run = plan.runs[0]
    seeds = tuple(range(len(passive)))
    runs = tuple(replace(run, id=f"{c.name}#{s}", case=c.name, seed=s) for c in plan.cases for s in seeds)
    of: dict[Key, float] = {("roll_rms", "passive", None, s): v for s, v in enumerate(passive)}
    of |= {("roll_rms", "active", None, s): v for s, v in enumerate(active)}
    return Numbers(replace(plan, seeds=seeds, runs=runs), of)


@pytest.mark.parametrize(
    ("active", "status"),
    [
        # The paper's change is -25 % (4 to 3). A change of -31.25 % to -18.75 % is within 25 % of it, a change of -30 %
        # to -20 % within five percentage points.
        ([2.76, 2.76, 2.76], Status.REPRODUCED),
        ([3.24, 3.24, 3.24], Status.REPRODUCED),
        ([2.7, 2.7, 2.7], Status.PARTLY),
        ([3.3, 3.3, 3.3], Status.PARTLY),
        ([4.0, 4.0, 4.0], Status.NOT_REPRODUCED),
        ([5.0, 5.0, 5.0], Status.NOT_REPRODUCED),
        # The differences have the mean -1 and the standard deviation 1. With a half width of 4.303/sqrt(3) = 2.48, the
        # interval contains zero.
        ([2.0, 3.0, 4.0], Status.PARTLY),
        # With a standard deviation of 0.1, the half width is 0.248.
        ([2.9, 3.0, 3.1], Status.REPRODUCED),
    ],
)
def test_a_change_has_a_badge_by_sign_size_and_scatter(scenario: Plan, active: list[float], status: Status) -> None:
    assert seeded(scenario, [4.0, 4.0, 4.0], active).status_of(ACTIVE) is status


def test_values_of_the_paper_have_badges_of_their_own(scenario: Plan) -> None:
    near = seeded(scenario, [4.19, 4.19], [3.0, 3.0])
    assert near.status_of(PASSIVE) is Status.REPRODUCED
    assert seeded(scenario, [4.21, 4.21], [3.0, 3.0]).status_of(PASSIVE) is Status.NOT_REPRODUCED
    assert near.status_of(Cell(1, "passive", None)) is None
    assert near.status(Check(ACTIVE, None, "paper_value", None)) is Status.REPRODUCED


def test_what_was_fitted_is_calibrated_and_never_reproduced(scenario: Plan) -> None:
    first = scenario.metrics[0]
    assert first.paper is not None

    def calibrated(keys: tuple[str, ...], changes: dict[str, float]) -> Numbers:
        assert first.paper is not None
        paper = replace(first.paper, calibrated=keys, changes=changes)
        said = replace(scenario, metrics=(replace(first, paper=paper), scenario.metrics[1]))
        return seeded(said, [4.0, 4.0], [3.0, 3.0])

    fitted = calibrated(("passive",), {})
    assert fitted.status_of(PASSIVE) is Status.CALIBRATED
    # The change from a fitted value to a value that is not fitted is a prediction.
    assert fitted.status_of(ACTIVE) is Status.REPRODUCED
    assert calibrated(("active",), {}).status_of(ACTIVE) is Status.CALIBRATED
    printed = {"active/passive": -77.0}
    assert calibrated((), printed).status_of(ACTIVE) is Status.PARTLY
    assert calibrated(("active/passive",), printed).status_of(ACTIVE) is Status.CALIBRATED


@pytest.mark.parametrize(
    ("expect", "level", "active", "status"),
    [
        ("lower", None, [3.0, 3.1, 2.9], Status.REPRODUCED),
        ("lower", None, [2.0, 3.0, 4.0], Status.PARTLY),
        # A change of -0.008 % with an interval that contains zero is no effect.
        ("lower", None, [3.999, 4.0, 4.0], Status.NOT_REPRODUCED),
        ("higher", None, [3.0, 3.1, 2.9], Status.NOT_REPRODUCED),
        ("unchanged", None, [4.19, 4.1, 4.2], Status.REPRODUCED),
        ("unchanged", None, [4.3, 4.3, 4.3], Status.NOT_REPRODUCED),
        ("below", 3.5, [3.0, 3.1, 2.9], Status.REPRODUCED),
        ("above", 3.5, [3.0, 3.1, 2.9], Status.NOT_REPRODUCED),
        ("above", 2.5, [2.0, 3.0, 4.0], Status.PARTLY),
        ("never", None, [3.0, 3.1, 2.9], Status.NOT_REPRODUCED),
        ("never", None, [], Status.REPRODUCED),
        ("lower", None, [], Status.NOT_REPRODUCED),
    ],
)
def test_claims_without_a_number(
    scenario: Plan, expect: Expect, level: float | None, active: list[float], status: Status
) -> None:
    against = None if expect in ("below", "above", "never") else PASSIVE
    check = Check(ACTIVE, against, expect, level)
    assert seeded(scenario, [4.0, 4.0, 4.0], active).status(check) is status


def test_a_change_may_be_larger_than_another(scenario: Plan) -> None:
    points = (Point("slow", "5 km/h", 5.0, None), Point("fast", "35 km/h", 35.0, None))
    run = scenario.runs[0]
    runs = tuple(replace(run, case=c.name, point=p.name) for c in scenario.cases for p in points)
    values: dict[Key, float] = {
        ("roll_rms", "passive", "slow", 1): 4.0,
        ("roll_rms", "active", "slow", 1): 3.0,
        ("roll_rms", "passive", "fast", 1): 10.0,
        ("roll_rms", "active", "fast", 1): 7.0,
    }
    of = Numbers(replace(scenario, points=points, runs=runs, seeds=(1,)), values)
    slow, fast = Cell(0, "active", "slow"), Cell(0, "active", "fast")
    # The changes are -30 % and -25 %.
    assert of.status(Check(fast, slow, "falls_more", None)) is Status.REPRODUCED
    assert of.status(Check(slow, fast, "falls_more", None)) is Status.NOT_REPRODUCED


def test_no_percent_is_taken_of_next_to_nothing(scenario: Plan) -> None:
    # 0.1 is less than 0.5 % of 30, the largest value of the metric.
    of = seeded(scenario, [0.1, 0.1], [30.0, 30.0])
    assert of.is_negligible(PASSIVE)
    assert of.change(ACTIVE, PASSIVE) is None
    passive, active = of.table()[:2]
    assert (passive.negligible, active.negligible) == (False, True)
    # The sign of the change is still known, but not its size in percent.
    assert of.status(Check(ACTIVE, PASSIVE, "higher", None)) is Status.REPRODUCED
    assert of.status(Check(ACTIVE, PASSIVE, "unchanged", None)) is Status.NOT_REPRODUCED
    assert not seeded(scenario, [0.2, 0.2], [30.0, 30.0]).is_negligible(PASSIVE)


def test_a_finding_has_the_badge_of_its_worst_check(scenario: Plan) -> None:
    of = seeded(scenario, [4.0, 4.0], [3.0, 3.0])
    good = Check(ACTIVE, PASSIVE, "lower", None)
    bad = Check(ACTIVE, PASSIVE, "higher", None)
    assert of.finding(Finding((), (), own=False, checks=(good, good))) is Status.REPRODUCED
    assert of.finding(Finding((), (), own=False, checks=(good, bad))) is Status.NOT_REPRODUCED
    assert of.finding(Finding((), (), own=True, checks=(good,))) is Status.OWN_RESULT
    assert of.finding(Finding((), (), own=True, checks=(good, bad))) is Status.REFUTED
    # After a failed run, a check is not evaluated, even one that expects a missing value.
    failed = Numbers(of.plan, {}, finished=set())
    assert failed.finding(Finding((), (), own=False, checks=(good,))) is Status.OPEN
    assert failed.finding(Finding((), (), own=True, checks=(Check(ACTIVE, None, "never", None),))) is Status.OPEN


def test_a_run_that_was_cut_short_decides_only_on_what_it_covers(scenario: Plan) -> None:
    values = seeded(scenario, [4.0, 4.0], [3.0, 3.0])
    stop = scenario.simulation.stop
    check = Check(ACTIVE, PASSIVE, "lower", None)
    for window, decided in [
        (None, False),
        ((0.0, stop), True),
        ((0.0, 2.0 * stop), False),
        ((stop, 2.0 * stop), False),
    ]:
        changed = tuple(replace(m, window=window) for m in values.plan.metrics)
        plan = replace(values.plan, metrics=changed)
        cut = Numbers(replace(plan, is_cut=True), values._values)
        assert cut.status(check) is (Status.REPRODUCED if decided else Status.OPEN), window
        whole = Numbers(plan, values._values)
        assert whole.status(check) is Status.REPRODUCED, window
