"""Layers of the package: modules import only from their own layer and from those below."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "chassis_fmu"

# From bottom to top. A folder is one layer, and so is each module in the package's top folder.
LAYERS = (
    ("_native", "program", "terminal"),
    ("__main__",),
    ("files",),
    ("comparison", "execution", "evaluation", "scenario"),
    ("env", "linear", "report"),
    ("app", "assess", "tuning"),
    ("study",),
)


def imports(path: Path) -> set[str]:
    """Return the layers that a file imports, except its own."""
    folder = path.relative_to(PACKAGE).parts[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == len(folder) + 1:
            found |= {node.module.split(".")[0]} if node.module else {alias.name for alias in node.names}
    return found


def test_imports_lead_downward_only() -> None:
    places = {name: number for number, layer in enumerate(LAYERS) for name in layer}
    files = [path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py"]
    assert {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in files} == set(places) - {"_native"}
    for path in files:
        own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        for name in imports(path):
            assert places[name] < places[own], f"{path} imports {name}"
