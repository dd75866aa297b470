"""The guide's examples are true: files in it are valid, links lead somewhere, commands parse."""

import re
import shlex
import subprocess
import sys
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


STAGES = sorted(path.parent.name for path in (REPOSITORY / "stages").glob("*/__main__.py"))


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_helps_with_an_example(stage: str) -> None:
    """--help ends with 0 and shows an example whose every option the stage knows."""
    command = [sys.executable, "-m", f"stages.{stage}", "--help"]
    shown = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout
    example = shlex.split(shown.split("example:")[1])
    assert example[:3] == ["python", "-m", f"stages.{stage}"]
    known = shown.split("example:")[0]
    assert all(word in known for word in example if word.startswith("--"))


@pytest.mark.parametrize("stage", STAGES)
def test_help_imports_nothing_heavy(stage: str) -> None:
    """Start-up costs nothing that the arguments do not need."""
    code = (
        "import sys, runpy\nsys.argv = ['stage', '--help']\n"
        f"try:\n    runpy.run_module('stages.{stage}', run_name='__main__')\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'pyarrow', 'jsonschema', 'jinja2', 'yaml', 'matplotlib'}\n"
        "heavy &= set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
