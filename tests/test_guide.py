"""The guide's examples are true: files in it are valid, links lead somewhere, commands parse."""

import contextlib
import io
import re
import runpy
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from schemas.layout import read_layout
from schemas.model import read_model

REPOSITORY = Path(__file__).resolve().parent.parent
PAGES = [*sorted((REPOSITORY / "docs").glob("*.md")), *sorted(REPOSITORY.glob("*.md"))]


def first_yaml(page: str) -> str:
    found = re.search(r"```yaml\n(.*?)```", (REPOSITORY / "docs" / page).read_text("utf-8"), re.DOTALL)
    assert found
    return found.group(1)


def test_the_example_layout_is_one(tmp_path: Path) -> None:
    (tmp_path / "finger.yaml").write_text(first_yaml("layouts.md"))
    layout = read_layout(tmp_path / "finger.yaml")
    assert [joint.name for joint in layout.solvable] == ["index_mcp", "index_pip", "wrist"]


def test_the_example_model_is_one(tmp_path: Path) -> None:
    (tmp_path / "half-twist.yaml").write_text(first_yaml("models.md"))
    assert read_model(tmp_path / "half-twist.yaml").twist_factor == 0.5


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8")):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_of_the_project_are_where_the_guide_says(page: Path) -> None:
    rooms = (
        "schemas|checks|anatomy|skeleton|trackers|stages|workflow|benchmarks|config|tests|container|profiles"
    )
    named = re.findall(rf"`((?:{rooms})/[\w./-]+)`", page.read_text("utf-8"))
    there = [path for path in named if "NAME" in path or (REPOSITORY / path.rstrip(".")).exists()]
    assert sorted(set(named) - set(there)) == []


def commands(page: Path) -> list[tuple[str, ...]]:
    """Every `python -m` of this project on a page: module and arguments."""
    text = page.read_text("utf-8").replace("\\\n", " ")
    found = re.findall(r"python -m ((?:stages|benchmarks|schemas|workflow)\b[^`\n|;>#)]*)", text)
    return [tuple(argument.rstrip(".,:") for argument in shlex.split(command)) for command in found]


COMMANDS = sorted({command for page in PAGES for command in commands(page)})
WITH_SUBCOMMANDS = ("stages.capture", "benchmarks")


@cache
def help_of(*command: str) -> str:
    """What `--help` of a command prints, in this process: heavy packages are imported once."""
    module, *arguments = command
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patched, contextlib.redirect_stdout(printed):
        patched.setattr(sys, "argv", [module, *arguments, "--help"])
        with pytest.raises(SystemExit) as ended:
            runpy.run_module(module, run_name="__main__")
    assert ended.value.code == 0
    return printed.getvalue()


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_commands_of_the_guide_are_there_with_their_options(command: tuple[str, ...]) -> None:
    module, *arguments = command
    named = module in WITH_SUBCOMMANDS and arguments and re.fullmatch(r"[a-z_-]+", arguments[0])
    known = help_of(module, *arguments[: 1 if named and not arguments[0].startswith("-") else 0])
    options = [argument.partition("=")[0] for argument in arguments if argument.startswith("--")]
    assert [option for option in options if option not in known] == []


STAGES = sorted(path.parent.name for path in (REPOSITORY / "stages").glob("*/__main__.py"))
LIGHT_HELP = """
import runpy, sys
sys.argv = ["stage", "--help"]
try:
    runpy.run_module("stages.{}", run_name="__main__")
except SystemExit as ended:
    heavy = {{"numpy", "scipy", "pandas", "pyarrow", "jsonschema", "jinja2", "yaml", "matplotlib"}}
    heavy &= set(sys.modules)
    sys.exit(f"imported {{heavy}}" if heavy else ended.code)
"""


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_helps_with_an_example_and_imports_nothing_heavy(stage: str) -> None:
    """--help ends with 0, shows an example whose every option the stage knows, and starts quickly."""
    command = [sys.executable, "-c", LIGHT_HELP.format(stage)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    known, _, example = done.stdout.partition("example:")
    argv = shlex.split(example)
    assert argv[:3] == ["python", "-m", f"stages.{stage}"]
    assert all(option in known for option in argv if option.startswith("--"))
