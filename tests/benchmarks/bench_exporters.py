"""Compare FMUs of the same models from this and other exporters: `scripts/bench exporters`, see `--help`.

`examples/other-exporters` contains the sources for the other exporters and the program that measures the FMUs. An FMU
that cannot be built or measured is listed with the reason.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from fmpy.validation import validate_fmu

from chassis_fmu.program import ROOT, python_library

SOURCES = ROOT / "examples" / "other-exporters"
BUILD = ROOT / "target" / "bench" / "exporters"
MODELS = {"QuarterCar": "quarter-car", "BouncingBall": "bouncing-ball"}
"""Models, and the names of their packages."""


class ProgramError(Exception):
    """A program failed; the message contains the reason."""


class Fmu(NamedTuple):
    """An FMU, and the source files that an author of the model writes."""

    exporter: str
    fmi: int
    model: str
    path: Path
    sources: Sequence[Path]
    preload: Path | None = None
    """Library that the process needs to load the FMU."""


class Row(NamedTuple):
    """Measurements of an FMU."""

    fmu: Fmu
    step: float
    """Time of a communication step, ns."""
    function: float
    """Time of a step of the same model as a Rust function, ns."""
    start: float
    """Time to instantiate and initialize, µs."""
    error: float
    """Largest error of an output, relative to its peak."""
    fmpy: Sequence[str]
    """Messages of FMPy's validation."""
    check: Sequence[str]
    """Findings of `cargo fmu check`."""


def execute(command: Sequence[str | Path], folder: Path = ROOT, **variables: Path) -> subprocess.CompletedProcess[str]:
    words = [str(word) for word in command]
    environment = os.environ | {name: str(value) for name, value in variables.items()}
    try:
        return subprocess.run(
            words, cwd=folder, env=environment, capture_output=True, encoding="utf-8", errors="replace", check=False
        )
    except OSError as error:
        raise ProgramError(f"{words[0]}: {error.strerror}") from error


def reason(output: str) -> str:
    """Return the first line that contains `error` or `fatal`, otherwise the last line."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if re.search(r"\b(error|fatal)\b", line, re.IGNORECASE)]
    return next(iter(errors or lines[-1:]), "no output")


def run(command: Sequence[str | Path], folder: Path = ROOT, **variables: Path) -> str:
    """Run a command and return its standard output; raise ProgramError if it fails."""
    done = execute(command, folder, **variables)
    if done.returncode != 0:
        raise ProgramError(f"{Path(command[0]).name}: {reason(done.stderr or done.stdout)}")
    return done.stdout


def pack_ours(_tools: Path) -> Iterator[Fmu]:
    for fmi in (2, 3):
        folder = BUILD / "ours" / f"fmi{fmi}"
        run(["cargo", "fmu", "pack", *MODELS, "--fmi", str(fmi), "--no-portable", "--out", folder])
        for model, package in MODELS.items():
            source = ROOT / "examples" / package / "src" / "lib.rs"
            yield Fmu("this project", fmi, model, folder / f"{model}.fmu", [source])


def pack_fmi_export(tools: Path) -> Iterator[Fmu]:
    """Pack with cargo-fmi, which is installed if it is missing."""
    program = tools / "bin" / "cargo-fmi"
    if not program.exists():
        run(["cargo", "install", "--quiet", "cargo-fmi", "--version", "0.3.0", "--root", tools])
    folder = BUILD / "fmi-export"
    shutil.copytree(SOURCES / "fmi-export", folder, dirs_exist_ok=True)
    for model, package in MODELS.items():
        arguments = ["--package", package, "bundle", "--release"]
        run([program, "fmi", *arguments], folder, CARGO_TARGET_DIR=folder / "target")
        fmu = folder / "target" / "fmu" / f"{package.replace('-', '_')}.fmu"
        yield Fmu("fmi-export 0.3.0", 3, model, fmu, [folder / package / "src" / "lib.rs"])


def run_cmake(name: str, dependency: str, checkout: Path) -> Path:
    """Build a folder of `SOURCES` with CMake, which downloads the dependency if there is no checkout."""
    folder = BUILD / name
    # Also passed if it is empty: CMake would otherwise use the path of an earlier call.
    local = f"-DFETCHCONTENT_SOURCE_DIR_{dependency}={checkout if checkout.is_dir() else ''}"
    run(["cmake", "-S", SOURCES / name, "-B", folder, "-DCMAKE_BUILD_TYPE=Release", local])
    run(["cmake", "--build", folder])
    return folder


def pack_fmu4cpp(tools: Path) -> Iterator[Fmu]:
    folder = run_cmake("fmu4cpp", "FMU4CPP", tools / "fmu4cpp") / "models"
    for fmi in (2, 3):
        for model, package in MODELS.items():
            source = SOURCES / "fmu4cpp" / f"{package.replace('-', '_')}.cpp"
            yield Fmu("fmu4cpp 0.5.0", fmi, model, folder / f"fmi{fmi}" / model / f"{model}.fmu", [source])


def pack_reference_fmus(tools: Path) -> Iterator[Fmu]:
    """Pack with the framework of the Reference FMUs, which contains the bouncing ball."""
    checkout = tools / "Reference-FMUs"
    folder = run_cmake("reference-fmus", "REFERENCE_FMUS", checkout)
    theirs = checkout if checkout.is_dir() else folder / "_deps" / "reference_fmus-src"
    for fmi in (2, 3):
        for model, parent in (("QuarterCar", SOURCES / "reference-fmus"), ("BouncingBall", theirs)):
            sources = [parent / model / name for name in ("config.h", "model.c", f"FMI{fmi}.xml")]
            yield Fmu("Reference-FMUs 0.0.41", fmi, model, folder / f"fmi{fmi}" / f"{model}.fmu", sources)


def pack_pythonfmu(_tools: Path) -> Iterator[Fmu]:
    library = python_library()
    if library is None:
        raise ProgramError("the FMU needs a shared library of Python, but this Python has none")
    source = ROOT / "python" / "tests" / "python_quarter_car.py"
    BUILD.mkdir(parents=True, exist_ok=True)
    run([sys.executable, "-m", "pythonfmu", "build", "-f", source, "-d", BUILD])
    yield Fmu("PythonFMU 0.7.0", 2, "QuarterCar", BUILD / "PythonQuarterCar.fmu", [source], library)


EXPORTERS: dict[str, Callable[[Path], Iterator[Fmu]]] = {
    "ours": pack_ours,
    "fmi-export": pack_fmi_export,
    "fmu4cpp": pack_fmu4cpp,
    "reference-fmus": pack_reference_fmus,
    "pythonfmu": pack_pythonfmu,
}

COMMENTS = {
    ".rs": r"//[^\n]*",
    ".c": r"//[^\n]*|/\*.*?\*/",
    ".h": r"//[^\n]*|/\*.*?\*/",
    ".cpp": r"//[^\n]*|/\*.*?\*/",
    ".py": r'^\s*#[^\n]*|^\s*""".*?"""',
    ".xml": r"<!--.*?-->",
}


def lines_of_code(text: str, suffix: str) -> int:
    """Return the number of lines that are neither empty nor comments nor documentation."""
    code = re.sub(COMMENTS[suffix], "", text, flags=re.DOTALL | re.MULTILINE)
    return sum(bool(line.strip()) for line in code.splitlines())


def lines_in(sources: Iterable[Path]) -> int:
    return sum(lines_of_code(path.read_text(encoding="utf-8"), path.suffix) for path in sources)


def reference_fmus(checkout: Path) -> str:
    """Return the table of the lines of each Reference FMU for FMI 3.0 that `examples/reference-fmus` rebuilds."""
    lines = ["| model | this project | Reference-FMUs | ratio |", "|---|---|---|---|"]
    for source in sorted((ROOT / "examples" / "reference-fmus").glob("*/src/lib.rs")):
        model = "".join(word.capitalize() for word in source.parents[1].name.split("-"))
        ours = lines_in([source])
        theirs = lines_in(checkout / model / name for name in ("config.h", "model.c", "FMI3.xml"))
        lines.append(f"| {model} | {ours} | {theirs} | {theirs / ours:.1f} |")
    return "\n".join(lines)


def findings(report: str) -> list[str]:
    """Return the errors and warnings in a report of `cargo fmu check`."""
    return [line.strip() for line in report.splitlines() if line.strip().startswith(("error: ", "warning: "))]


def checked(fmu: Fmu) -> list[str]:
    command: list[str | Path] = ["cargo", "fmu", "check", fmu.path]
    done = execute(command if fmu.preload is None else [*command, "--libpython", fmu.preload])
    if done.returncode != 0 and not findings(done.stdout):
        raise ProgramError(f"cargo fmu check: {reason(done.stderr)}")
    return findings(done.stdout)


def measured(fmu: Fmu) -> Row:
    command = [ROOT / "target" / "release" / "other-exporters", fmu.path]
    table = run(command) if fmu.preload is None else run(command, LD_PRELOAD=fmu.preload)
    step, function, start, error = (float(word) for word in table.splitlines()[1].split()[:4])
    return Row(fmu, step, function, start, error, validate_fmu(str(fmu.path)), checked(fmu))


def table(rows: Iterable[Row]) -> str:
    head = "exporter | FMI | FMPy | check | error | step, ns | function, ns | ratio | start, µs | FMU, bytes | lines"
    lines = [f"| {head} |", "|---" * (head.count("|") + 1) + "|"]
    for row in rows:
        errors = sum(finding.startswith("error") for finding in row.check)
        cells = (
            row.fmu.exporter,
            f"{row.fmu.fmi}.0",
            str(len(row.fmpy)),
            f"{errors} + {len(row.check) - errors}",
            f"{row.error:.1e}",
            f"{row.step:,.1f}",
            f"{row.function:.1f}",
            f"{row.step / row.function:.2f}",
            f"{row.start:,.0f}",
            f"{row.fmu.path.stat().st_size:,}",
            str(lines_in(row.fmu.sources)),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="scripts/bench exporters", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--tools",
        type=Path,
        default=ROOT / "target" / "tools",
        metavar="DIR",
        help="folder with checkouts named fmu4cpp and Reference-FMUs, which CMake downloads otherwise; "
        "cargo-fmi is installed into its subfolder bin (default: target/tools)",
    )
    parser.add_argument("--only", nargs="+", choices=EXPORTERS, default=list(EXPORTERS), help="measure only these")
    parser.add_argument("--lines", action="store_true", help="only count the lines of the Reference FMUs in --tools")
    options = parser.parse_args()
    if options.lines:
        print(reference_fmus(options.tools / "Reference-FMUs"))
        return
    manifest = SOURCES / "Cargo.toml"
    run(["cargo", "build", "--release", "--locked", "--manifest-path", manifest, "--target-dir", ROOT / "target"])
    rows: list[Row] = []
    missing: list[str] = []
    for name in options.only:
        try:
            for fmu in EXPORTERS[name](options.tools.resolve()):
                print(f"{fmu.exporter}, FMI {fmu.fmi}.0, {fmu.model}", file=sys.stderr)
                try:
                    rows.append(measured(fmu))
                except ProgramError as error:
                    missing.append(f"{fmu.exporter}, FMI {fmu.fmi}.0, {fmu.model}: {error}")
        except ProgramError as error:
            missing.append(f"{name}: {error}")
    for model in MODELS:
        print(f"\n{model}\n\n{table(row for row in rows if row.fmu.model == model)}")
    for row in rows:
        for message in [f"FMPy: {text}" for text in row.fmpy] + [f"check: {text}" for text in row.check]:
            print(f"\n{row.fmu.exporter}, FMI {row.fmu.fmi}.0, {row.fmu.model}: {message}")
    for text in missing:
        print(f"\nnot measured: {text}")


if __name__ == "__main__":
    main()
