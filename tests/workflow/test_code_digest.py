"""What makes a job's results out of date: code, also in what it imports; not comments."""

import re
from pathlib import Path

import pytest

from stages.capture.__main__ import COMMANDS
from workflow.code_digest import ROOT, code_digest, files_of

STAGE = "import numpy\n\n\ndef work():\n    from skeleton.turning import turn\n\n    return turn(1)\n"
TURNING = '"""Turning."""\n\n\ndef turn(x):\n    """Turn it."""\n    return -x\n'
READERS = 'READERS = {"csv": "stages.formats.csv:read", "xdf": "stages.formats.xdf"}\n'


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in {
        "stages/spin/__init__.py": "",
        "stages/spin/__main__.py": STAGE,
        "stages/spin/page.css": "p {}",
        "stages/spin/templates/page.html": "<p>",
        "stages/spin/more.py": "from stages.spin.__main__ import work\n",
        "stages/readers.py": READERS,
        "stages/formats/__init__.py": "",
        "stages/formats/csv.py": "x = 1\n",
        "stages/formats/xdf.py": "x = 1\n",
        "skeleton/__init__.py": "",
        "skeleton/turning.py": TURNING,
        "skeleton/unused.py": "x = 1\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def digest(project: Path, module: str = "stages.spin") -> str:
    code_digest.cache_clear()
    return code_digest(module, project)


def test_comments_docstrings_and_what_is_not_imported_change_nothing(project: Path) -> None:
    before = digest(project)
    commented = TURNING.replace("Turn it.", "Turn it round.").replace("return", "# why\n\n    return")
    for name, text in {
        "skeleton/turning.py": commented,
        "skeleton/unused.py": "x = 2\n",
        "stages/spin/more.py": "x = 1\n",
    }.items():
        (project / name).write_text(text)
        assert digest(project) == before, name


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("skeleton/turning.py", TURNING.replace("-x", "x")),
        ("stages/spin/__main__.py", STAGE.replace("turn(1)", "turn(2)")),
        ("stages/spin/__init__.py", "x = 1\n"),
        ("stages/spin/page.css", "p {color: red}"),
        ("stages/spin/templates/page.html", "<p>Hello"),
        ("stages/spin/templates/new.html", "<p>"),
    ],
)
def test_code_and_data_beside_it_change_the_digest(project: Path, name: str, text: str) -> None:
    before = digest(project)
    (project / name).write_text(text)
    assert digest(project) != before


def test_a_module_of_a_package_has_a_digest_of_its_own(project: Path) -> None:
    """A module beside a stage's command line is no part of it unless it is imported, and the reverse."""
    before = digest(project, "stages.spin.more"), digest(project)
    (project / "stages/spin/more.py").write_text("from stages.spin.__main__ import work as x\n")
    assert digest(project, "stages.spin.more") != before[0]
    assert digest(project) == before[1]


@pytest.mark.parametrize("name", ["csv", "xdf"])
def test_a_module_named_in_a_text_is_imported_later(project: Path, name: str) -> None:
    before = digest(project, "stages.readers")
    (project / f"stages/formats/{name}.py").write_text("x = 2\n")
    assert digest(project, "stages.readers") != before


def test_a_module_that_is_not_there_has_no_digest(project: Path) -> None:
    with pytest.raises(ModuleNotFoundError, match=r"stages\.spun"):
        digest(project, "stages.spun")


def names(module: str) -> set[str]:
    return {path.relative_to(ROOT).as_posix() for path in files_of(module)}


def test_stages_share_what_they_import_and_no_more() -> None:
    """solve_joints depends on the rotations and the poses, and on no other stage's mathematics."""
    solving = names("stages.solve_joints")
    assert {"stages/solve_joints/closed.py", "skeleton/rotations.py", "schemas/poses.py"} <= solving
    assert "schemas/json/model.schema.json" in solving
    others = ("stages/project", "stages/evaluate", "stages/report", "trackers")
    assert not any(name.startswith(others) for name in solving)


def test_an_import_depends_on_every_reader_and_decoder_and_not_on_the_recorders_display() -> None:
    importing = names("stages.capture.import_recording")
    assert {
        f"stages/capture/formats/{name}.py" for name in ("tidy", "xdf", "c3d", "raw_capture")
    } <= importing
    assert {"trackers/liberty/binary_decoder.py", "trackers/viper/decoder.py"} <= importing
    assert not {"trackers/record/display.py", "trackers/emulate/server.py"} & importing


def test_an_export_depends_on_every_writer() -> None:
    written = {
        f"stages/export/{name}.py" for name in ("bvh", "glb", "usd", "opensim", "c3d_file", "tidy_csv")
    }
    assert written <= names("stages.export")


def test_every_rule_has_the_digest_of_the_command_that_it_runs() -> None:
    """stages.capture hands over to a module for each of its commands."""
    snakefile = (ROOT / "Snakefile").read_text()
    rules = re.findall(r'code_digest\("([^"]+)"\).*?\{run\} (\S+) (\S+)', snakefile, re.DOTALL)
    assert len(rules) == snakefile.count("code_digest(")
    for module, command, first in rules:
        own = COMMANDS[first][0] if command == "stages.capture" else command
        assert module == own
        assert code_digest(module)
