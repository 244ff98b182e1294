"""The command line: plan, runs, tables, figures, page."""

from __future__ import annotations

import argparse
import dataclasses
import importlib.metadata
import os
import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from . import batch, figures, index, junit, lab, metrics, page, page_data, plan, plots, results, shell, tables, texts
from .numbers import Numbers, Values, Verdict
from .plan import Metric, Plan, Run
from .results import Recording
from .scenario import ScenarioError
from .terminal import escaped
from .verdict import Status


class AppError(Exception):
    """A failure with a message for the user and an exit code."""

    def __init__(self, message: str, code: int = 1) -> None:
        super().__init__(message)
        self.code = code


def arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog=shell.program("scripts/run"),
        description="Run a scenario with the FMUs of this repository and report the results beside the paper's.",
    )
    parser.add_argument(
        "scenario",
        type=Path,
        nargs="?",
        default=shell.ROOT / "scenarios/rescue_vehicle_step_steer.toml",
        metavar="SCENARIO",
        help="scenario file (scenarios/*.toml; default: the step steer of the rescue vehicle)",
    )
    parser.add_argument(
        "--jobs", type=shell.positive, metavar="N", help="number of processes (default: number of processors)"
    )
    shell.add_timeout(parser)
    shell.add_out(parser)
    parser.add_argument(
        "--inputs", type=Path, metavar="CSV", help="CSV file with signals that replace the outputs of components"
    )
    parser.add_argument(
        "--after-end",
        choices=("error", "hold"),
        help="action if a signal from --inputs ends before the run does (default: error)",
    )
    parser.add_argument("--stop", type=float, metavar="T", help="override the scenario's stop time, in seconds")
    parser.add_argument("--seeds", type=shell.positive, metavar="N", help="use only the first N seeds")
    parser.add_argument(
        "--order",
        choices=("sequential", "jacobi"),
        help="override the scenario's order of the components within a step",
    )
    shell.add_fmus(parser)
    parser.add_argument("--no-fail", action="store_true", help="exit with 0 even if a requirement is not met")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="also write the verdicts to this file, as JUnit XML")
    parser.add_argument("--parquet", action="store_true", help="also write the recorded signals as Parquet files")
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--native", action="store_true", help="execute the runs with `chassis run`, not with FMPy")
    source.add_argument(
        "--from-csv", type=Path, metavar="DIR", help="make tables and page from the CSV files in DIR, without runs"
    )
    return parser.parse_args(argv)


def _options(options: argparse.Namespace) -> list[str]:
    """Return the arguments that `chassis plan` and `chassis run` share."""
    out = [str(options.scenario.resolve())]
    if options.inputs is not None:
        out += ["--inputs", str(options.inputs.resolve())]
    if options.after_end is not None:
        out += ["--after-end", options.after_end]
    for folder in options.fmus or ():
        out += ["--fmus", str(folder.resolve())]
    return shell.from_root([*out, *shell.set_options(options, ("stop", "seeds", "order"))])


def _of_baseline(scenario: Plan, run: Run, runs: Path, failures: dict[str, str]) -> Recording | None:
    """Return what metrics need of the run of the baseline, at the same point with the same seed; None without one."""
    names = {scenario.columns[c].name for m in scenario.metrics if m.from_baseline for c in m.columns}
    name = next(c.baseline for c in scenario.cases if c.name == run.case)
    if not names or name is None:
        return None
    baseline = scenario.run(name, run.point, run.seed)
    return None if baseline.id in failures else results.read_csv(runs / f"{baseline.stem}.csv", sorted(names))


def _value(metric: Metric, scenario: Plan, recording: Recording, baseline: Recording | None) -> float | None:
    if metric.window is not None and metric.window[0] >= scenario.simulation.stop:
        # The run was cut short.
        return None
    return metrics.of_recording(metric, scenario, recording, baseline)


def _collect(scenario: Plan, runs: Path, failures: dict[str, str]) -> tuple[Values, figures.Recordings]:
    """Compute the metrics of all runs, and keep what the figures show of them."""
    values: dict[tuple[str, str, str | None, int | None], float] = {}
    shown = figures.Recordings(scenario)
    measured = {scenario.columns[c].name for m in scenario.metrics for c in metrics.columns_of(m)}
    for run in scenario.runs:
        if run.id in failures:
            continue
        recording = results.read_csv(runs / f"{run.stem}.csv", sorted(measured | shown.columns))
        baseline = _of_baseline(scenario, run, runs, failures)
        found: dict[str, float] = {}
        for metric in scenario.metrics:
            if metric.value is None:
                value = _value(metric, scenario, recording, baseline)
            else:
                value = metrics.of_metrics(metric, scenario, found)
            if value is not None:
                found[metric.name] = value
        values |= {(name, run.case, run.point, run.seed): value for name, value in found.items()}
        shown.add(run, recording)
    return values, shown


@dataclasses.dataclass(frozen=True)
class Report:
    """What was written: table, findings and requirements for the terminal, and the numbers."""

    text: str
    numbers: Numbers

    @property
    def failed(self) -> list[Verdict]:
        """Return the requirements that are not met."""
        return [item for item in self.numbers.requirements() if item.status is Status.FAILED]


def _aligned(rows: Sequence[tuple[str, str]]) -> str:
    """Return badges with texts beside them."""
    width = max((len(title) for title, _ in rows), default=0)
    return "\n".join(f"{title.ljust(width)}  {text}" for title, text in rows)


def report(scenario: Plan, folder: Path, failures: dict[str, str], context: page.Context) -> Report:
    """Write tables, figures and page of whole runs; `failures` says why the others are not."""
    values, recordings = _collect(scenario, folder / "runs", failures)
    finished = {r.id for r in scenario.runs} - set(failures)
    numbers = Numbers(scenario, values, finished)
    cells = numbers.table()
    results.write_text(folder / "table.csv", tables.machine(cells))
    results.write_text(folder / "table.md", tables.markdown(scenario, cells))
    panels = [(figure, figures.panels(scenario, figure, recordings, numbers)) for figure in scenario.figures]
    drawings = [plots.draw(scenario, figure, found) for figure, found in panels if found]
    for drawing in drawings:
        drawing.write(folder / "figures")
    files = sorted(p for r in scenario.runs for p in (folder / "runs").glob(f"{r.stem}.*") if r.id not in failures)
    context = dataclasses.replace(
        context,
        files=tuple(p.relative_to(folder).as_posix() for p in files),
        replays=tuple(lab.of_scenario(scenario, folder)),
    )
    data = page_data.of_plan(scenario, panels)
    results.write_text(folder / "index.html", page.render(numbers, drawings, data, failures, context))
    counts = page.counts(numbers)
    index.note(folder, index.Entry(scenario.title, scenario.reference, {s.value: n for s, n in counts.items()}))
    index.write(folder.parent)
    claims = [(numbers.finding(f).title, texts.fill(f.claim, numbers)) for f in scenario.findings]
    verdicts = [(item.status.title, texts.requirement(item, numbers)) for item in numbers.requirements()]
    parts = (
        tables.console(scenario, cells) if cells else "",
        _aligned(claims) + "\n" if claims else "",
        f"Requirements\n{_aligned(verdicts)}\n" if verdicts else "",
    )
    return Report("\n".join(part for part in parts if part).rstrip("\n"), numbers)


def _run(options: argparse.Namespace) -> int:
    shared = _options(options)
    code, text = shell.chassis(["plan", "--json", *shared], capture=True)
    if code != 0:
        # The command has printed the reason.
        raise AppError("", code)
    scenario = plan.parse(text, shell.ROOT)
    folder = options.out.resolve() / scenario.name
    runs = folder / "runs"
    runs.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=runs):
        # A folder that cannot be written to is an error before the runs.
        pass
    for run in scenario.runs:
        # What an earlier call left with this option is not of these runs.
        (runs / f"{run.stem}.parquet").unlink(missing_ok=True)
    repeat = ["scripts/run", *shared]
    if options.from_csv is not None:
        master = "CSV files of earlier runs"
        given = options.from_csv.resolve()
        # The folder of a scenario's results is as good as the folder of the files in it.
        outcome = batch.take(scenario, given / "runs" if (given / "runs").is_dir() else given, runs)
        if len(outcome.failures) == len(scenario.runs):
            first = next(iter(outcome.failures.values()))
            raise AppError(f"{options.from_csv} has no results of {scenario.name}: {first}", 1)
    elif options.native:
        master = "native (chassis run)"
        repeat.append("--native")
        out = ["--out", str(options.out.resolve())]
        jobs = [] if options.jobs is None else ["--jobs", str(options.jobs)]
        arguments = [*shared, *out, *jobs, *shell.workers(options)]
        code, _ = shell.chassis(["run", "--no-warnings", "--no-verdicts", *arguments])
        # The runs that are whole are reported.
        outcome = batch.take(scenario, runs, runs)
        if code != 0 and not outcome.failures:
            raise AppError("", code)
    else:
        master = f"fmpy {importlib.metadata.version('fmpy')}"
        outcome = batch.execute(scenario, runs, options.jobs or _processors(), options.timeout)
        for name, warnings in outcome.warnings.items():
            print(f"warning: run {name}:", *map(escaped, warnings), sep="\n  ", file=sys.stderr)
    failures = outcome.failures
    left_out = failures | outcome.ended
    if options.parquet:
        batch.convert(scenario, runs, left_out)
        repeat.append("--parquet")
    if len(failures) == len(scenario.runs) and code != 0:
        # The page of an earlier run, if there is one, is better than one without numbers. A report of tests is not.
        if options.junit is not None:
            results.write_text(options.junit, junit.document(Numbers(scenario, {}, ()), failures))
        raise AppError("all runs failed, see above; no page was made", code)
    cut = [f"--{name} {getattr(options, name):g}" for name in ("stop", "seeds") if getattr(options, name) is not None]
    context = page.Context(
        master=master,
        command=shlex.join(repeat),
        inputs=None if options.inputs is None else options.inputs.name,
        shortened=" ".join(cut) or None,
        versions=shell.versions(),
    )
    made = report(scenario, folder, left_out, context)
    print(escaped(made.text))
    if options.junit is not None:
        results.write_text(options.junit, junit.document(made.numbers, failures))
    if cut:
        print(f"Run with {' '.join(cut)}: the paper's numbers and the findings are about the whole scenario.\n")
    for name, end in outcome.ended.items():
        print(f"note: run {name}: {escaped(end)}\n", file=sys.stderr)
    for name, error in failures.items():
        print(f"error: run {name}: {escaped(error)}\n", file=sys.stderr)
    if failures:
        print(f"{len(failures)} of {len(scenario.runs)} runs failed", file=sys.stderr)
    failed = made.failed
    if failed:
        of = len(made.numbers.requirements())
        print(f"{len(failed)} of {of} requirements not met", file=sys.stderr)
    print(f"\n{folder / 'index.html'}")
    return 1 if failures or (failed and not options.no_fail) else 0


def _processors() -> int:
    """Return how many processors this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    try:
        return _run(arguments(argv))
    except AppError as error:
        if str(error):
            print(f"error: {escaped(error)}", file=sys.stderr)
        return error.code
    except (plan.PlanError, ScenarioError, metrics.MetricError, results.ResultsError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
