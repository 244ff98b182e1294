"""The command: `scripts/assess PLANT`, and `scripts/assess --page FOLDER` for the page of an assessment alone."""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from .. import libpython, shell
from ..scenario import ScenarioError, worker_program
from ..terminal import escaped
from . import report
from .assessment import AssessmentError, Folder

# What a call means that could not do its work; 1 is a limit that is not kept.
UNABLE = 2

HELP = """Drive a vehicle through the standard maneuvers of the test bench, without and with controllers, and write a
page with the results. All options are those of `chassis bench run`, which runs the maneuvers:"""


def _arguments(argv: Sequence[str]) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(
        prog=shell.program("scripts/assess"), description=HELP, add_help=False, allow_abbrev=False
    )
    parser.add_argument("-h", "--help", action="store_true")
    parser.add_argument("--out", type=Path, metavar="DIR")
    parser.add_argument("--page", type=Path, metavar="FOLDER")
    return parser.parse_known_args(argv)


def _plant(arguments: Sequence[str]) -> str | None:
    """Return the plant among arguments of `chassis bench run`: the first that is neither an option nor its value."""
    flags = {"--quick", "--adapt"}
    after_option = False
    for argument in arguments:
        if argument.startswith("-"):
            after_option = argument not in flags and "=" not in argument
        elif after_option:
            after_option = False
        else:
            return Path(argument).stem if argument.endswith(".fmu") else argument
    return None


def _assess(arguments: Sequence[str | Path]) -> int:
    """Run `chassis bench run`; its messages go to the terminal. Returns its exit code."""
    # FMUs made with Python use the Python that this is.
    environment = {"PYTHONHOME": sys.base_prefix, **os.environ}
    return subprocess.run([worker_program(), "bench", "run", *arguments], env=environment, check=False).returncode


def _page(folder: Folder, command: str) -> int:
    path = report.write(folder.read(), folder, report.Context(command, shell.versions()))
    print(path)
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code: 0 if all limits are kept, 1 if one is not, 2 if it could not run."""
    given = list(sys.argv[1:] if argv is None else argv)
    options, rest = _arguments(given)
    try:
        if options.help:
            print(f"{HELP}\n", flush=True)
            code = _assess(["--help"])
            print(
                "\n      --page <FOLDER>\n          Write only the page of an existing assessment, such as "
                "results/assess_EspCar"
            )
            return code
        if options.page is not None:
            if rest or options.out is not None:
                print("error: --page takes a folder and nothing else", file=sys.stderr)
                return UNABLE
            return _page(Folder(options.page), shlex.join(["scripts/assess", *given]))
        plant = _plant(rest)
        # Without a plant the command says what is missing.
        out = options.out or shell.ROOT / "results" / f"assess_{plant}"
        library = libpython.find()
        python: list[str | Path] = [] if library is None else ["--libpython", library]
        is_given = any(argument == "--fmus" or argument.startswith("--fmus=") for argument in rest)
        fmus: list[str | Path] = [] if is_given else ["--fmus", shell.ROOT / "target" / "fmu"]
        code = _assess([*rest, "--out", out, *fmus, *python])
        if code not in (0, 1):
            return UNABLE
        _page(Folder(out), shlex.join(["scripts/assess", *shell.from_root(given)]))
        return code
    except (AssessmentError, ScenarioError, OSError) as error:
        print(f"error: {escaped(error)}", file=sys.stderr)
        return UNABLE
    except KeyboardInterrupt:
        return 130
