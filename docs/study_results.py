"""Run the studies of the library's controllers, and write docs/study_results.md.

`.venv/bin/python docs/study_results.py`, after `scripts/build`; continues an interrupted call. All runs took half an
hour on two cores, with other processes running.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tqdm import tqdm

from chassis_fmu import scenario
from chassis_fmu.program import ROOT
from chassis_fmu.report import tables
from chassis_fmu.study import design, execute, file, report, statistics
from chassis_fmu.study.engines import Nothing
from chassis_fmu.study.execute import WHOLE, Folder
from chassis_fmu.study.job import Job
from chassis_fmu.study.statistics import Distribution, Numbers, Share

ROBUST = ("robust_esp_car", "robust_heavy_vehicle", "robust_rescue_vehicle", "robust_hydro_pneumatic")
SENSITIVITY = "sensitivity_rescue_roll"

HEAD = """# Results of the studies

Do the controllers also help vehicles other than those in the papers? `studies/robust_*.toml` vary mass, tires, speed
and road of each system, with unchanged controllers. `docs/study_results.py` runs these studies and writes this page.

*Runs that meet it* is the share of the samples that meet a requirement, with its 95 % interval (Wilson). A change is
relative to the baseline of the case in the same sample.
"""

COLUMNS = "| Requirement | Case | Runs that meet it | 95 % interval | Required | Met | Change, 5 % / 50 % / 95 % |"


def numbers(name: str, out: Path) -> Numbers:
    """Execute the runs of a study that are not finished, and read its rows."""
    path = ROOT / "studies" / f"{name}.toml"
    command = [sys.executable, "-m", "chassis_fmu", "study", str(path), "--out", str(out), "--resume", "--no-fail"]
    if subprocess.run(command, check=False).returncode != 0:
        raise SystemExit(f"error: the study {path} could not run, see above")
    folders = [scenario.default_folder()]
    job = Job(file.read(path, folders), path, folders)
    engine = Nothing(job, 1, 60.0)
    done = execute.run(job, Folder(out / name), engine, WHOLE, execute.Progress(tqdm(disable=True)), resume=True)
    return Numbers(job, done.values, done.rows)


def limits(share: Share, of: Numbers) -> str:
    return f"{of.job.plan.metrics[share.limits.metric].title}: {report.limits_text(of, share)}"


def change(share: Share, of: Numbers) -> str:
    """Format percentiles of the change that a requirement limits."""
    if not share.limits.of_change:
        return "–"
    cell = next(i for i, r in enumerate(of.job.cells) if (r.case, r.point) == (share.case, share.point))
    found = Distribution.of(of.changes(share.limits, cell))
    if found is None:
        return "–"
    p = found.percentiles
    return " / ".join(f"{v:+.1f} %".replace("-", "−") for v in (p[0], p[2], p[4]))


def robust(name: str, of: Numbers) -> Iterator[str]:
    study, job = of.job.study, of.job
    yield f"## {study.title}\n"
    varied = "; ".join(f"{f.name}: {f.text(tables.pretty_unit(job.unit(f)))}" for f in study.vary)
    failed = sum(done.status != "ok" for done in of.rows.values())
    yield f"`studies/{name}.toml`, {of.count} samples, {len(of.rows)} runs, of which {failed} failed.\n"
    yield f"Varied: {varied}.\n"
    found = of.shares()
    met = sum(share.holds for share in found)
    answer = "Yes." if met == len(found) else "No." if met == 0 else "In part."
    yield f"**{answer}** Requirements met by enough runs: {met} of {len(found)}.\n"
    yield COLUMNS
    yield "|---|---|---|---|---|---|---|"
    for share in found:
        low, high = share.interval
        case = next(c.title for c in job.plan.cases if c.name == share.case)
        point = next((p.title for p in job.plan.points if p.name == share.point), None)
        cells = (
            limits(share, of),
            case if point is None else f"{case}, {point}",
            report.percent(share.share),
            f"{report.percent(low)} to {report.percent(high)}",
            report.percent(share.limits.share),
            "yes" if share.holds else "no",
            change(share, of),
        )
        yield f"| {' | '.join(cells)} |"
    yield ""


def sensitivity(name: str, of: Numbers) -> Iterator[str]:
    study = of.job.study
    shares = design.shares(study)
    yield f"## {study.title}\n"
    yield f"`studies/{name}.toml`, {len(of.rows)} runs: Sobol indices with 95 % intervals.\n"
    for index in of.job.metrics:
        for cell in range(len(of.job.cells)):
            found = statistics.sensitivities(study, shares, of.of(index, cell))
            yield f"| {of.job.plan.metrics[index].title} | First order | Interval | Total | Interval |"
            yield "|---|---|---|---|---|"
            for effect in found.effects:
                ends = (effect.interval or (0.0, 0.0), effect.total_interval or (0.0, 0.0))
                first, total = (f"{low:.2f} to {high:.2f}" for low, high in ends)
                row = f"| {effect.factor} | {effect.value:.2f} | {first} | {effect.total or 0.0:.2f} | {total} |"
                yield row.replace("-0", "−0")
            if found.left_out:
                yield f"\n{found.left_out} of {found.groups} groups of samples are omitted, because a run failed."
            yield ""


def main() -> None:
    parser = argparse.ArgumentParser(prog="docs/study_results.py", description=(__doc__ or "").splitlines()[0])
    out = ROOT / "target" / "study_results"
    parser.add_argument(
        "--out", type=Path, default=out, metavar="DIR", help="folder for results (default: %(default)s)"
    )
    options = parser.parse_args()
    lines = [HEAD]
    for name in ROBUST:
        lines += robust(name, numbers(name, options.out))
    lines += sensitivity(SENSITIVITY, numbers(SENSITIVITY, options.out))
    (ROOT / "docs" / "study_results.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
