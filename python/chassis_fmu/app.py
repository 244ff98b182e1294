"""Tables, figures and page of a scenario, which `chassis run` makes after its runs.

The request is JSON on the standard input: `python -m chassis_fmu.app`.
"""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path
from typing import Literal

import msgspec

from .evaluation.metrics import MetricError
from .evaluation.results_table import Numbers, Verdict
from .files import plan, results
from .files.plan import Plan
from .report import figures, index, lab, page, page_data, plots, tables, texts
from .terminal import escaped


class Request(msgspec.Struct, frozen=True):
    """A request from `chassis run`."""

    plan: msgspec.Raw
    """The plan, as `chassis plan --json` prints it."""
    folder: str
    """The results folder; recorded signals are in its subfolder `runs`."""
    engine: Literal["native", "fmpy", "csv"]
    command: str
    """The command that repeats the runs."""
    numbers: dict[str, tuple[float | None, ...]]
    """Values of the metrics, by the id of each complete run."""
    verdicts: tuple[Verdict, ...] = ()
    incomplete: dict[str, str] = {}
    """Reason for each incomplete run, by its id."""
    steps: dict[str, page.Steps] = {}
    """Steps of each run that chooses or repeats them, by its id."""
    parquet: bool = False
    inputs: str | None = None
    """Name of the file with input signals."""
    shortened: str | None = None
    """Options that shortened the runs, such as "--stop 2 --seeds 1"."""
    converge: bool = False
    """True if the error of the communication step is in converge.json."""


def _engine(request: Request) -> str:
    if request.engine == "fmpy":
        return f"fmpy {importlib.metadata.version('fmpy')}"
    return "native (chassis run)" if request.engine == "native" else "CSV files of earlier runs"


def _recordings(scenario: Plan, runs: Path, finished: set[str]) -> figures.Recordings:
    """Read the signals that the figures show, from the complete runs."""
    shown = figures.Recordings(scenario)
    for run in scenario.runs:
        if run.id in finished and scenario.figures:
            shown.add(run, results.read_csv(runs / f"{run.stem}.csv", sorted(shown.columns)))
    return shown


def report(scenario: Plan, request: Request) -> str:
    """Write tables, figures and page; returns the table and the findings for the terminal."""
    folder = Path(request.folder)
    runs = folder / "runs"
    values = {
        (metric.name, run.case, run.point, run.seed): value
        for run in scenario.runs
        for metric, value in zip(scenario.metrics, request.numbers.get(run.id, ()), strict=False)
        if value is not None
    }
    numbers = Numbers(scenario, values, set(request.numbers), request.verdicts)
    cells = numbers.table()
    results.write_text(folder / "table.csv", tables.machine(cells))
    results.write_text(folder / "table.md", tables.markdown(scenario, cells))
    recordings = _recordings(scenario, runs, set(request.numbers))
    panels = [(figure, figures.panels(scenario, figure, recordings, numbers)) for figure in scenario.figures]
    drawings = [
        plots.draw(scenario.cases, figure, found, is_swept=len(scenario.points) > 1)
        for figure, found in panels
        if found
    ]
    for drawing in drawings:
        drawing.write(folder / "figures")
    files = sorted(p for r in scenario.runs for p in runs.glob(f"{r.stem}.*") if r.id in request.numbers)
    context = page.Context(
        master=_engine(request),
        command=request.command,
        inputs=request.inputs,
        shortened=request.shortened,
        files=tuple(p.relative_to(folder).as_posix() for p in files),
        steps=request.steps,
        replays=tuple(lab.of_scenario(scenario, folder)),
        converge=msgspec.json.decode((folder / "converge.json").read_bytes()) if request.converge else None,
    )
    data = page_data.of_plan(scenario, panels)
    counts = page.counts(numbers)
    entry = index.Entry(scenario.title, scenario.reference, {s.value: n for s, n in counts.items()})
    index.write(folder, page.render(numbers, drawings, data, request.incomplete, context), entry)
    claims = [(numbers.finding(f).title, texts.fill(f.claim, numbers)) for f in scenario.findings]
    width = max((len(title) for title, _ in claims), default=0)
    lines = [f"{title.ljust(width)}  {text}" for title, text in claims]
    table = [tables.console(scenario, cells)] if cells else []
    return "\n".join([*table, *lines]).rstrip("\n")


def _convert(scenario: Plan, runs: Path, finished: set[str]) -> None:
    """Convert the CSV files of the complete runs to Parquet."""
    units = {column.name: column.unit or "" for column in scenario.columns if not column.is_binary}
    texts = [column.name for column in scenario.columns if column.is_binary]
    for run in scenario.runs:
        if run.id in finished:
            path = runs / f"{run.stem}.csv"
            recording = results.read_csv(path, list(units))
            binaries = results.read_binaries(path, texts, run.binary)
            results.write_parquet(runs / f"{run.stem}.parquet", recording, units, binaries)


def execute(request: Request) -> None:
    """Execute a request."""
    scenario = Plan.parse(bytes(request.plan).decode(), Path.cwd())
    runs = Path(request.folder) / "runs"
    for run in scenario.runs:
        # A Parquet file from an earlier call does not belong to these runs.
        (runs / f"{run.stem}.parquet").unlink(missing_ok=True)
    if request.parquet:
        _convert(scenario, runs, set(request.numbers))
    if text := report(scenario, request):
        print(escaped(text))
    if request.shortened:
        print(f"Run with {request.shortened}: the paper's numbers and the findings apply to the whole scenario.")


def main() -> int:
    """Execute the request on the standard input; returns the exit code."""
    try:
        execute(msgspec.json.decode(sys.stdin.buffer.read(), type=Request))
    except (plan.PlanError, MetricError, results.ResultsError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
