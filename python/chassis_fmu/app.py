"""Tables, figures and page of a scenario. `chassis run` calls this module after its runs, or for runs in FMPy.

`chassis run` passes a request as JSON on the standard input: `python -m chassis_fmu.app`.
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import msgspec

from . import shell
from .evaluation import metrics
from .evaluation.grading import Status
from .evaluation.results_table import Numbers, Values, Verdict
from .execution import batch
from .files import plan, results
from .files.plan import Metric, Plan, Run
from .files.results import Recording
from .report import figures, index, junit, lab, page, page_data, plots, tables, texts
from .terminal import escaped


class Request(msgspec.Struct, frozen=True):
    """What `chassis run` asks for."""

    plan: msgspec.Raw
    """The plan, as `chassis plan --json` prints it."""
    folder: Path
    """The folder of the results; the runs of the native master are in its folder `runs`."""
    engine: Literal["native", "fmpy", "csv"]
    command: str
    """The command that repeats the runs."""
    csv: Path | None = None
    """With the engine `csv`: the folder of the recorded runs."""
    jobs: int = 1
    timeout: float = 60.0
    parquet: bool = False
    junit: Path | None = None
    no_fail: bool = False
    inputs: str | None = None
    """Name of the file of signals."""
    shortened: str | None = None
    """What the runs were cut to, such as "--stop 2 --seeds 1"."""


class AppError(Exception):
    """A failure with a message for the user."""


def _of_baseline(scenario: Plan, run: Run, runs: Path, failures: dict[str, str]) -> Recording | None:
    """Return the signals that metrics need from the baseline's run at the same point with the same seed, or None."""
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
    """Compute the metrics of all runs, and keep the data of the figures."""
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
    """Table, findings and requirements for the terminal, and their numbers."""

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
    """Write tables, figures and page of the complete runs; `failures` has the messages of the others."""
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


def _outcome(request: Request, scenario: Plan) -> tuple[str, batch.Outcome]:
    """Execute the runs, or read existing ones; returns the name of their master, too."""
    runs = request.folder / "runs"
    if request.csv is not None:
        # The folder of a scenario's results is as good as the folder of the files in it.
        given = request.csv / "runs" if (request.csv / "runs").is_dir() else request.csv
        outcome = batch.take(scenario, given, runs)
        if len(outcome.failures) == len(scenario.runs):
            first = next(iter(outcome.failures.values()))
            raise AppError(f"{request.csv} has no results of {scenario.name}: {first}")
        return "CSV files of earlier runs", outcome
    if request.engine == "native":
        return "native (chassis run)", batch.take(scenario, runs, runs)
    outcome = batch.execute(scenario, runs, request.jobs, request.timeout)
    for name, warnings in outcome.warnings.items():
        print(f"warning: run {name}:", *map(escaped, warnings), sep="\n  ", file=sys.stderr)
    return f"fmpy {importlib.metadata.version('fmpy')}", outcome


def execute(request: Request) -> int:
    """Execute a request; returns the exit code."""
    scenario = plan.parse(bytes(request.plan).decode(), Path.cwd())
    folder = request.folder
    runs = folder / "runs"
    runs.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=runs):
        # A folder that cannot be written to is an error before the runs.
        pass
    for run in scenario.runs:
        # What an earlier call left with this option is not of these runs.
        (runs / f"{run.stem}.parquet").unlink(missing_ok=True)
    master, outcome = _outcome(request, scenario)
    failures = outcome.failures
    left_out = failures | outcome.ended
    if request.parquet:
        batch.convert(scenario, runs, left_out)
    if len(failures) == len(scenario.runs) and request.engine == "native":
        # The page of an earlier run, if there is one, is better than one without numbers. A report of tests is not.
        if request.junit is not None:
            results.write_text(request.junit, junit.document(Numbers(scenario, {}, ()), failures))
        _print_failures(scenario, failures)
        raise AppError("all runs failed, see above; no page was made")
    context = page.Context(
        master=master,
        command=request.command,
        inputs=request.inputs,
        shortened=request.shortened,
        versions=shell.versions(),
    )
    made = report(scenario, folder, left_out, context)
    print(escaped(made.text))
    if request.junit is not None:
        results.write_text(request.junit, junit.document(made.numbers, failures))
    if request.shortened:
        print(f"Run with {request.shortened}: the paper's numbers and the findings are about the whole scenario.\n")
    for name, end in outcome.ended.items():
        print(f"note: run {name}: {escaped(end)}\n", file=sys.stderr)
    _print_failures(scenario, failures)
    failed = made.failed
    if failed:
        of = len(made.numbers.requirements())
        print(f"{len(failed)} of {of} requirements not met", file=sys.stderr)
    print(f"\n{folder / 'index.html'}")
    return 1 if failures or (failed and not request.no_fail) else 0


def _print_failures(scenario: Plan, failures: dict[str, str]) -> None:
    for name, error in failures.items():
        print(f"error: run {name}: {escaped(error)}\n", file=sys.stderr)
    if failures:
        print(f"{len(failures)} of {len(scenario.runs)} runs failed", file=sys.stderr)


def main() -> int:
    """Execute the request on the standard input; returns the exit code."""
    try:
        return execute(msgspec.json.decode(sys.stdin.buffer.read(), type=Request, dec_hook=_path))
    except (AppError, plan.PlanError, metrics.MetricError, results.ResultsError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


def _path(kind: type, value: object) -> object:
    return Path(str(value)) if kind is Path else value


if __name__ == "__main__":
    sys.exit(main())
