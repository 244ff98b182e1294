"""Draw model.png for the models from their packed FMUs: `docs/draw_models.py [NAMES]`, see `--help`."""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Sequence
from pathlib import Path

from fmpy.fmi1 import FMICallException

from chassis_fmu.files import results
from model_pictures import pictures

ROOT = Path(__file__).resolve().parents[1]


def packages() -> dict[str, Path]:
    found = sorted(p.parents[1] for top in pictures.ACCENTS for p in (ROOT / top).glob("*/src/lib.rs"))
    return {"".join(word.capitalize() for word in p.name.split("-")): p for p in found}


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="draw_models.py",
        description="Draw model.png for each model from its packed FMU, into the folder of the model; commit the file.",
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="FMU or package (default: all)")
    parser.add_argument(
        "--fmus",
        type=Path,
        default=ROOT / "target" / "fmu",
        metavar="DIR",
        help="folder with the FMUs (default: target/fmu)",
    )
    options = parser.parse_args(argv)
    models = packages()
    by_package = {path.name: name for name, path in models.items()}
    errors = 0
    for wanted in options.names or list(models):
        name = by_package.get(wanted, wanted)
        fmu = options.fmus / f"{name}.fmu"
        try:
            if name not in models:
                near = difflib.get_close_matches(name, [*models, *by_package], n=1, cutoff=0.0)
                hint = f"; did you mean {near[0]}?" if near else ""
                raise FileNotFoundError(f"no model with this name in {' or '.join(pictures.ACCENTS)}{hint}")
            if not fmu.exists():
                raise FileNotFoundError(f"{fmu} does not exist; run `cargo fmu pack {name}` first")
            picture = pictures.draw(pictures.read(fmu, models[name].parent.name))
            target = models[name] / "model.png"
            with results.replacing(target) as temporary:
                temporary.write_bytes(picture)
            print(f"{target.relative_to(ROOT)} ({len(picture) / 1000:.0f} kB)")
        except (OSError, LookupError, FMICallException) as error:
            errors += 1
            print(f"error: {wanted}: {error}", file=sys.stderr)
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
