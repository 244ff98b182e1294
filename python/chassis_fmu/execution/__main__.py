"""`python -m chassis_fmu.execution`: runs by FMPy, or those in CSV files, for `chassis run`.

The request is JSON on the standard input. How the runs ended is in `status.json` beside their rows.
"""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec

from ..files import plan, results
from ..terminal import escaped
from . import batch


class Request(msgspec.Struct, frozen=True):
    """What `chassis run` asks for."""

    plan: msgspec.Raw
    """The plan, as `chassis plan --json` prints it."""
    runs: str
    """The folder of the rows."""
    csv: str | None = None
    """The folder of recorded runs, which are used instead of runs by FMPy."""
    temporary: str = ""
    """A folder for unpacked FMUs."""
    jobs: int = 1
    timeout: float = 60.0


def execute(request: Request) -> int:
    """Execute a request; returns the exit code."""
    scenario = plan.Plan.parse(bytes(request.plan).decode(), Path.cwd())
    runs = Path(request.runs)
    if request.csv is not None:
        # The folder of a scenario's results is as good as the folder of the files in it.
        given = Path(request.csv, "runs") if Path(request.csv, "runs").is_dir() else Path(request.csv)
        failures = batch.take(scenario, given, runs).failures
        if len(failures) == len(scenario.runs):
            first = next(iter(failures.values()))
            print(f"error: {escaped(f'{request.csv} has no results of {scenario.name}: {first}')}", file=sys.stderr)
            return 1
        return 0
    outcome = batch.execute(scenario, Path(request.temporary), runs, request.jobs, request.timeout)
    for name, warnings in outcome.warnings.items():
        print(f"warning: run {name}:", *map(escaped, warnings), sep="\n  ", file=sys.stderr)
    return 0


def main() -> int:
    """Execute the request on the standard input; returns the exit code."""
    try:
        return execute(msgspec.json.decode(sys.stdin.buffer.read(), type=Request))
    except (plan.PlanError, results.ResultsError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
