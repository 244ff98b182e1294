"""Studies with `[[vary]]`.

`chassis study` passes a request as JSON on the standard input: `python -m chassis_fmu.study`.
"""

from __future__ import annotations

import sys
import traceback
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
from tqdm import tqdm

from ..files import results
from ..scenario import RunError, ScenarioError
from ..terminal import escaped
from . import design, execute, file, report, table
from .charts import History, Recorded
from .engines import Engine, Local, Nothing
from .execute import WHOLE, Folder, Shard
from .file import StudyError
from .job import Job
from .statistics import Numbers

# Exit code of a failed call; 1 means that a requirement is not met.
UNABLE = 2

# Without `[series]`, the page shows the signals of the WORST worst runs of each case and point, if executing them again
# takes at most CHEAP seconds.
WORST = 3
CHEAP = 10.0


class Request(msgspec.Struct, frozen=True):
    """A request from `chassis study`, whose help explains the options."""

    study: Path
    fmus: list[Path]
    out: Path
    command: str
    """The command that repeats the study."""
    jobs: int
    timeout: float
    runs: int | None = None
    dask: str | None = None
    """Address of the scheduler; empty for a scheduler on this machine."""
    shard: Shard | None = None
    merge: bool = False
    no_page: bool = False
    no_fail: bool = False
    resume: bool = False
    overwrite: bool = False
    report_only: bool = False


def _engine(request: Request, job: Job) -> tuple[Engine, str]:
    jobs = request.jobs
    if request.report_only or request.merge:
        return Nothing(job, jobs, request.timeout), "rows of earlier calls"
    if request.dask is None:
        return Local(job, jobs, request.timeout), f"local, {jobs} {'process' if jobs == 1 else 'processes'}"
    from .cluster import Dask

    where = f"at {request.dask}" if request.dask else "on this machine"
    return Dask(job, request.dask or None, jobs, request.timeout), f"Dask, scheduler {where}"


def _total(job: Job, shard: Shard) -> int:
    if job.study.is_adaptive:
        count = job.study.runs or file.SAMPLES
    else:
        numbers = range(len(design.shares(job.study)))
        count = len(numbers[shard.number - 1 :: shard.of])
    return count * len(job.cells)


def _chosen(job: Job, numbers: Numbers) -> list[tuple[int, int]]:
    """Return the samples and cells to record: as `[series]` requests, or the worst ones if they are fast."""
    series = job.study.series or file.Series(worst=WORST)
    metric = report.series_metric(numbers)
    found = []
    for cell in range(len(job.cells)):
        order = report.worst_first(numbers, metric, cell)
        chosen = order[: series.worst]
        rest = np.array(sorted(set(order) - set(chosen)), np.int64)
        drawn = np.random.default_rng(job.study.seed).permutation(rest)[: series.random]
        found += [(number, cell) for number in sorted({*chosen, *(int(n) for n in drawn)})]
    if job.study.series is None and sum(numbers.rows[key].seconds for key in found) > CHEAP:
        return []
    return found


def _series(job: Job, numbers: Numbers, folder: Path, engine: Engine) -> tuple[Recorded, list[str]]:
    """Record the chosen runs with an engine; writes them as Parquet files if the study has `[series]`."""
    target = folder / "series"
    for old in target.glob("*.parquet"):
        old.unlink()
    keys = _chosen(job, numbers)
    tasks = [(job.task(number, numbers.sample(number)), cell) for number, cell in keys]
    recorded: dict[tuple[int, int], History] = {}
    files = []
    for (number, cell), found in zip(keys, engine.record(tasks) if tasks else [], strict=True):
        run = job.cells[cell]
        if isinstance(found, str):
            raise StudyError(
                f"sample {number}, {run.case}: the first execution succeeded, but recording its signals failed: {found}"
            )
        times, columns = found
        recorded[number, cell] = found
        if job.study.series is None:
            continue
        point = "" if run.point is None else f"_{run.point}"
        path = target / f"{number}_{run.case}{point}.parquet"
        known = [(c, v) for c, v in zip(job.plan.columns, columns, strict=True) if v is not None]
        recording = results.Recording(times, {c.name: v for c, v in known})
        results.write_parquet(path, recording, {c.name: c.unit or "1" for c, _ in known})
        files.append(path.relative_to(folder).as_posix())
    return recorded, files


def _run(request: Request) -> int:
    job = Job(file.read(request.study, request.fmus, request.runs), request.study, request.fmus)
    for text in job.warnings():
        print(f"warning: {escaped(text)}", file=sys.stderr)
    folder = Folder(request.out / job.name)
    shard = request.shard or WHOLE
    if (request.merge or shard != WHOLE) and job.study.is_adaptive:
        raise StudyError(f"method {job.study.method} does not support shards: its samples depend on earlier runs")
    with folder.locked(WHOLE if request.merge else shard):
        return _write(request, job, folder, shard)


def _write(request: Request, job: Job, folder: Folder, shard: Shard) -> int:
    resume = request.resume or request.report_only
    if not request.merge:
        folder.prepare(shard, resume=resume, overwrite=request.overwrite)
    engine, name = _engine(request, job)
    with execute.closing(engine):
        if request.merge:
            result, name = execute.merge(job, folder), f"{len(folder.journals())} shards"
        else:
            with tqdm(total=_total(job, shard), unit="run", disable=None, smoothing=0.05) as bar:
                result = execute.run(job, folder, engine, shard, execute.Progress(bar), resume=resume)
        if shard != WHOLE:
            print(f"{folder.journal(shard)}\nwhen all shards are done, `{request.command} --merge` makes the tables")
            return 0
        results.write_table(folder.runs, table.runs(job, result.values, result.rows))
        results.write_table(folder.timing, table.timing(job, result.rows))
        numbers = Numbers(job, result.values, result.rows)
        page = folder.path / "index.html"
        if request.no_page:
            # Delete the page from the call that `--resume` continues.
            page.unlink(missing_ok=True)
        if job.study.series is not None or not request.no_page:
            recorded, files = _series(job, numbers, folder.path, engine)
        if not request.no_page:
            report.write(numbers, recorded, {"command": request.command, "engine": name, "files": files}, folder.path)
    print(escaped(report.console(numbers)))
    print(f"\n{folder.runs if request.no_page else page}")
    failed = [share for share in numbers.shares() if not share.holds]
    if not any(done.status == "ok" for done in result.rows.values()) and job.study.method != "worst_case":
        raise StudyError(f"all runs failed; {folder.runs if request.no_page else 'the page'} lists the errors")
    return 1 if failed and not request.no_fail else 0


def carry_out(request: Request) -> int:
    """Run a study; returns the exit code."""
    try:
        return _run(request)
    except (StudyError, ScenarioError, RunError, results.ResultsError, OSError, pa.ArrowException) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return UNABLE
    except KeyboardInterrupt:
        print("interrupted; --resume continues", file=sys.stderr)
        return 130
    except Exception:
        # A bug. Python's default exit code, 1, would mean that a requirement is not met.
        traceback.print_exc()
        print("error: this is a bug in chassis-fmu, please report it; existing rows are kept", file=sys.stderr)
        return UNABLE


def main() -> int:
    """Execute the request on the standard input; returns the exit code."""
    return carry_out(msgspec.json.decode(sys.stdin.buffer.read(), type=Request, dec_hook=lambda of, value: of(value)))
