"""Links in the documentation, and code blocks in README and guide. Rust blocks are doctests of the package `guide`."""

from __future__ import annotations

import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("CHASSIS_FMU_DIR") or ROOT / "target" / "fmu")
GUIDE = ROOT / "docs" / "guide" / "src"
PAGES = sorted(
    path
    for path in ROOT.glob("**/*.md")
    if not {"target", ".venv", ".git", "results", "node_modules"} & set(path.relative_to(ROOT).parts)
)
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(path: Path, language: str) -> list[str]:
    return [text for tag, text in FENCE.findall(path.read_text(encoding="utf-8")) if tag == language]


def anchors(path: Path) -> set[str]:
    titles = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def broken_links(path: Path) -> list[str]:
    broken = []
    for link in LINK.findall(FENCE.sub("", path.read_text(encoding="utf-8"))):
        if re.match(r"\w+:", link):
            continue
        file, _, anchor = link.partition("#")
        target = path.parent / file if file else path
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    return broken


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path) -> None:
    assert not broken_links(path)


def test_broken_links_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A title\n[a](#a-title) [b](#b) [c](other.md) [d](https://example.org)\n", encoding="utf-8")
    assert broken_links(page) == ["#b", "other.md"]


def test_the_summary_lists_every_page() -> None:
    listed = set(LINK.findall((GUIDE / "SUMMARY.md").read_text(encoding="utf-8")))
    compiled = set(re.findall(r'"src/([\w-]+\.md)"', (GUIDE.parent / "lib.rs").read_text(encoding="utf-8")))
    assert listed == compiled == {path.name for path in GUIDE.glob("*.md")} - {"SUMMARY.md"}


@pytest.mark.parametrize("path", [*GUIDE.glob("*.md"), ROOT / "README.md"], ids=lambda path: path.name)
def test_every_block_has_a_language(path: Path) -> None:
    assert {tag for tag, _ in FENCE.findall(path.read_text(encoding="utf-8"))} <= {
        "rust",
        "sh",
        "toml",
        "python",
        "text",
        "yaml",
    }


def with_blocks(language: str) -> list[Path]:
    """Return the README and the guide's pages that have blocks in a language."""
    return [path for path in (ROOT / "README.md", *sorted(GUIDE.glob("*.md"))) if blocks(path, language)]


def name_of(path: Path) -> str:
    return path.name


# The words that start a command of this project, and the program whose help lists its options.
COMMANDS = {
    "chassis": ["chassis"],
    "cargo fmu": ["cargo-fmu"],
    "scripts/run": ["chassis", "run"],
    "scripts/study": ["chassis", "study"],
    "scripts/assess": ["chassis", "bench", "run"],
}
# Paths that exist in every clone; `mass.toml` is a file that a page tells the reader to write.
SHIPPED = re.compile(r"(crates|examples|modelDescription|python|scenarios|scripts|studies|web)/(?!mass\.toml)[\w./-]+")


@cache
def help_of(program: str, verbs: tuple[str, ...]) -> str:
    return subprocess.run([built(program), *verbs, "--help"], check=True, capture_output=True, text=True).stdout


def calls(text: str) -> Iterator[list[str]]:
    """Return the words of each command in a shell block, including commands that are arguments of other commands."""
    for line in text.replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars="&;|>")
        lexer.whitespace_split = True
        for is_separator, words in itertools.groupby(lexer, lambda word: set(word) <= set("&;|>")):
            command = list(words)
            if not is_separator:
                yield command
                yield from (call for word in command if " " in word and "scripts/" in word for call in calls(word))


@pytest.mark.parametrize("path", with_blocks("sh"), ids=name_of)
def test_shell_blocks_have_commands_and_options_that_exist(path: Path) -> None:
    for text in blocks(path, "sh"):
        subprocess.run(["bash", "-n", "-c", text], check=True)
        for call in calls(text):
            words = " ".join(call).removeprefix(".venv/bin/")
            prefix = next((prefix for prefix in COMMANDS if f"{words} ".startswith(f"{prefix} ")), None)
            if prefix is not None:
                rest = words.removeprefix(prefix).split()
                program, *verbs = COMMANDS[prefix]
                # Subcommands come before the first other argument.
                while rest and re.search(rf"^  {re.escape(rest[0])} ", help_of(program, tuple(verbs)), re.MULTILINE):
                    verbs.append(rest.pop(0))
                assert verbs, words
                for option in (word.partition("=")[0] for word in rest if re.match("--?[a-z]", word)):
                    assert re.search(rf"(?<![\w-]){option}(?![\w-])", help_of(program, tuple(verbs))), words
            for word in call:
                assert not SHIPPED.fullmatch(word) or (ROOT / word).exists(), words


@pytest.mark.parametrize("path", with_blocks("toml"), ids=name_of)
def test_toml_blocks_are_understood(path: Path, tmp_path: Path) -> None:
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    file = tmp_path / "guide" / "file.toml"
    file.parent.mkdir()
    out = ["--out", str(tmp_path / "out")]

    def messages(program: str, *arguments: str | Path) -> str:
        done = subprocess.run([built(program), *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)
        return done.stderr if done.returncode else ""

    for text in blocks(path, "toml"):
        file.write_text(text, encoding="utf-8")
        if "[workspace." in text:
            (tmp_path / "Cargo.toml").write_text(f"[workspace]\n{text}", encoding="utf-8")
            assert "this workspace has no package" in messages("cargo-fmu", "pack", "--no-portable")
        elif "[signals]" in text:
            # The command reads the file, and reports its signals because this plant does not have them.
            assert "`delta`" in messages("chassis", "bench", "run", "EspCar", "--vehicle", file, "--fmus", FOLDER, *out)
        elif "method =" in text:
            # Execute only one of the runs.
            runs = text.partition("runs = ")[2].split()[0]
            assert not messages("chassis", "study", file, "--shard", f"1/{runs}", "--fmus", FOLDER, *out)
        else:
            # An incomplete scenario must contain only existing keys and words.
            found = messages("chassis", "plan", file, "--fmus", FOLDER)
            assert not re.search("unknown (key|word)|must be", found), found
            assert not ("[simulation]" in text and found), found


@pytest.mark.parametrize("path", with_blocks("python"), ids=name_of)
def test_python_blocks_compile(path: Path) -> None:
    for text in blocks(path, "python"):
        compile(text, path.name, "exec")


@pytest.mark.parametrize("path", with_blocks("yaml"), ids=name_of)
def test_yaml_blocks_are_lists_of_documents(path: Path) -> None:
    for text in blocks(path, "yaml"):
        assert all(document["kind"] for document in yaml.safe_load_all(text))


@pytest.mark.parametrize(("name", "number"), [("interfaces.md", 0), ("steady-states.md", -1), ("studies.md", -1)])
def test_the_python_of_a_page_runs(name: str, number: int) -> None:
    # The FMI 3.0 FMU also has both interfaces, and other tests have already packed it.
    code = blocks(GUIDE / name, "python")[number].replace("target/fmu/BouncingBall", "target/fmu3/BouncingBall")
    run_python(code, ROOT)


def test_the_importer_of_the_page_ends_a_step_at_the_bounce() -> None:
    output = run_python(blocks(GUIDE / "interfaces.md", "python")[1], ROOT)
    assert [output.strip()] == promised(GUIDE / "interfaces.md")


def test_the_steady_state_is_that_of_the_page() -> None:
    page = GUIDE / "steady-states.md"
    (command,), (shown,) = blocks(page, "sh"), blocks(page, "text")
    options = command.split()[4:-2]
    trim = [built("cargo-fmu"), "trim", str(FOLDER / "EspCar.fmu"), *options]
    output = subprocess.run(trim, check=True, capture_output=True, text=True).stdout
    printed = [line.split() for line in output.splitlines()]
    assert [line for line in shown.splitlines() if line.strip() != "…" and line.split() not in printed] == []


def run_python(code: str, folder: Path) -> str:
    return subprocess.run([sys.executable, "-c", code], cwd=folder, check=True, capture_output=True, text=True).stdout


def promised(path: Path) -> list[str]:
    return re.findall(r"^This prints `(.*?)`[.:]", path.read_text(encoding="utf-8"), re.MULTILINE)


def test_the_python_of_the_readme_prints_what_it_says() -> None:
    (code,) = blocks(ROOT / "README.md", "python")
    output = run_python(code.replace("target/fmu", str(FOLDER)), ROOT)
    assert [output.strip()] == promised(ROOT / "README.md")


def test_the_readme_counts_its_lines_as_the_benchmarks_do() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = blocks(ROOT / "README.md", "rust")
    # Lines are counted as in docs/benchmarks.md: without empty lines and comments.
    lines = [line for line in code.splitlines() if line.strip() and not line.strip().startswith("//")]
    assert re.findall(r"Export a model in (\d+) lines", text) == [str(len(lines))]


@cache
def built(name: str) -> str:
    """Build a command; returns its path."""
    subprocess.run(["cargo", "build", "--quiet", "--locked", "--package", name], cwd=ROOT, check=True)
    return str(Path(os.environ.get("CARGO_TARGET_DIR") or ROOT / "target").absolute() / "debug" / name)


def test_the_scenario_of_the_guide_runs(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(blocks(GUIDE / "scenarios.md", "toml")[0], encoding="utf-8")
    command = [built("chassis"), "run", str(scenario), "--no-page", "--fmus", str(FOLDER)]
    command += ["--out", str(tmp_path / "out")]
    subprocess.run(command, check=True, capture_output=True, text=True)
    assert list((tmp_path / "out").rglob("*.csv"))


@pytest.mark.ci
def test_the_first_model_is_created_tested_packed_and_simulated(tmp_path: Path) -> None:
    page = GUIDE / "first-model.md"
    install, create, pack, environment = blocks(page, "sh")
    # Instead of an installation, the test uses a link to the command of this build, and FMPy of this environment.
    assert install == "cargo install --locked --path crates/cargo-fmu\n"
    assert environment.splitlines()[-1] == ".venv/bin/pip install fmpy"
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "cargo-fmu").symlink_to(built("cargo-fmu"))
    script = "set -e\n" + create.replace("EXPORTER", str(ROOT)) + pack
    # The exporter is compiled once for all foreign packages (tests/tests/foreign.rs).
    variables = {
        **os.environ,
        "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}",
        "CARGO_TARGET_DIR": str(ROOT / "target" / "foreign"),
        "CARGO_NET_OFFLINE": "true",
        "CARGO_PROFILE_DEV_DEBUG": "none",
    }
    # The page expects the FMU in the package's target folder, but CARGO_TARGET_DIR points elsewhere.
    script = script.replace("cargo fmu pack", "cargo fmu pack --out target/fmu")
    script = script.replace("cargo fmu check MyOscillator", "cargo fmu check target/fmu/MyOscillator.fmu")
    result = subprocess.run(
        ["sh", "-c", script], cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "no error, no warning" in result.stdout
    model = tmp_path / "my-oscillator"
    # The page shows the model of the template without its comments.
    template = [line for line in (model / "src" / "lib.rs").read_text(encoding="utf-8").splitlines() if line.strip()]
    shown = [line for line in blocks(page, "rust")[0].splitlines() if line.strip()]
    assert [line for line in shown if line not in template] == []
    (code,) = blocks(page, "python")
    assert [run_python(code, model).strip()] == promised(page)
    shutil.rmtree(model)
