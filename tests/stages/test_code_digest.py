"""What makes a stage's results out of date: code, also in what it imports; not comments."""

from pathlib import Path

import pytest

from stages.code_digest import ROOT, code_digest, modules_of

STAGE = "import numpy\n\n\ndef work():\n    from kinematics.turning import turn\n\n    return turn(1)\n"
TURNING = '"""Turning."""\n\n\ndef turn(x):\n    """Turn it."""\n    return -x\n'


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in {
        "stages/spin/__init__.py": "",
        "stages/spin/__main__.py": STAGE,
        "stages/spin/page.css": "p {}",
        "stages/other.py": "x = 1\n",
        "kinematics/__init__.py": "",
        "kinematics/turning.py": TURNING,
        "kinematics/unused.py": "x = 1\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def digest_after(project: Path, name: str, text: str) -> str:
    code_digest.cache_clear()
    (project / name).write_text(text)
    return code_digest("spin", project)


def test_comments_and_docstrings_change_nothing(project: Path) -> None:
    before = code_digest("spin", project)
    commented = TURNING.replace("Turn it.", "Turn it round.").replace("return", "# why\n\n    return")
    assert digest_after(project, "kinematics/turning.py", commented) == before
    assert digest_after(project, "kinematics/unused.py", "x = 2\n") == before
    assert digest_after(project, "stages/other.py", "x = 2\n") == before


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("kinematics/turning.py", TURNING.replace("-x", "x")),
        ("stages/spin/__main__.py", STAGE.replace("turn(1)", "turn(2)")),
        ("stages/spin/page.css", "p {color: red}"),
        ("stages/spin/more.py", "x = 1\n"),
    ],
)
def test_code_changes_the_digest(project: Path, name: str, text: str) -> None:
    before = code_digest("spin", project)
    assert digest_after(project, name, text) != before


def test_stages_share_what_they_import_and_no_more() -> None:
    """solve_joints depends on the rotations and the poses, and on no other stage's mathematics."""
    names = {path.relative_to(ROOT).as_posix() for path in modules_of("stages.solve_joints")}
    assert {"stages/solve_joints/closed.py", "kinematics/rotations.py", "schemas/poses.py"} | {
        "schemas/json/model.schema.json"
    } <= names
    assert not any(name.startswith(("stages/project", "stages/evaluate", "stages/report")) for name in names)
