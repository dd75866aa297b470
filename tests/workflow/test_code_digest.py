"""What makes a job's results out of date: code, also in what it imports; not comments."""

import re
import shutil
from pathlib import Path

import pytest

from shukotsu.workflow.code_digest import ROOT, code_digest, files_of, forget

STAGE = """import numpy

from shukotsu.skeleton import turning
from shukotsu.schemas.files import read_config


def work():
    from shukotsu.skeleton.turning import turn

    return turn(1), turning.about(2), read_config("x", "layout")
"""
TURNING = """'''Turning.'''
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shukotsu.skeleton.unused import X

STEP = 1
FAST = 2


def turn(x: X):
    '''Turn it.'''
    return -x * STEP


def about(x):
    return [own(x) for own in (math.sin, half)]


def half(x):
    return x / 2


def leap(x):
    return FAST * x
"""
READERS = """READERS = {"csv": "shukotsu.formats.csv:read", "xdf": "shukotsu.formats.xdf"}
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in {
        "spin/__init__.py": "",
        "spin/__main__.py": STAGE,
        "spin/page.css": "p {}",
        "spin/templates/page.html": "<p>",
        "spin/more.py": "from shukotsu.spin.__main__ import work\n\nother = work\n",
        "readers.py": READERS,
        "formats/__init__.py": "",
        "formats/csv.py": "x = 1\n\n\ndef read():\n    return x\n\n\ndef other():\n    pass\n",
        "formats/xdf.py": "x = 1\n",
        "schemas/files.py": "KNOWN = {}\nKNOWN['x'] = 1\n\n\ndef read_config(path, kind):\n    return path\n",
        "schemas/json/layout.schema.json": "{}",
        "schemas/json/study.schema.json": "{}",
        "skeleton/__init__.py": "",
        "skeleton/turning.py": TURNING,
        "skeleton/unused.py": "X = 1\n",
    }.items():
        path = tmp_path / "shukotsu" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def digest(project: Path, module: str = "shukotsu.spin") -> str:
    forget()
    return code_digest(module, project)


def edit(project: Path, name: str, old: str, new: str) -> None:
    path = project / "shukotsu" / name
    text = path.read_text() if path.exists() else ""
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("skeleton/turning.py", "Turn it.", "Turn it round."),
        ("skeleton/turning.py", "    return -x", "    # why\n\n    return -x"),
        ("skeleton/turning.py", "FAST = 2", "FAST = 3"),
        ("skeleton/turning.py", "FAST * x", "FAST + x"),
        ("skeleton/unused.py", "1", "2"),
        ("schemas/json/study.schema.json", "{}", "[]"),
        ("spin/more.py", "other", "another"),
    ],
)
def test_what_a_command_does_not_name_changes_nothing(project: Path, name: str, old: str, new: str) -> None:
    before = digest(project)
    edit(project, name, old, new)
    assert digest(project) == before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("skeleton/turning.py", "-x * STEP", "x * STEP"),
        ("skeleton/turning.py", "STEP = 1", "STEP = 2"),
        ("skeleton/turning.py", "x / 2", "x / 3"),
        ("skeleton/__init__.py", "", "print(1)"),
        ("schemas/files.py", "['x'] = 1", "['x'] = 2"),
        ("schemas/json/layout.schema.json", "{}", "[]"),
        ("spin/__main__.py", "turn(1)", "turn(2)"),
        ("spin/__init__.py", "", "x = 1\n"),
        ("spin/page.css", "{}", "{color: red}"),
        ("spin/templates/page.html", "<p>", "<p>Hello"),
        ("spin/templates/new.html", "", "<p>"),
    ],
)
def test_code_that_is_named_and_data_beside_it_change_the_digest(
    project: Path, name: str, old: str, new: str
) -> None:
    before = digest(project)
    edit(project, name, old, new)
    assert digest(project) != before


def test_a_module_of_a_package_has_a_digest_of_its_own(project: Path) -> None:
    """A module beside a stage's command line is no part of it unless it is imported, and the reverse."""
    before = digest(project, "shukotsu.spin.more"), digest(project)
    edit(project, "spin/more.py", "import work", "import work as work")
    edit(project, "spin/more.py", "other = work", "other = [work]")
    assert digest(project, "shukotsu.spin.more") != before[0]
    assert digest(project) == before[1]


@pytest.mark.parametrize("name", ["csv", "xdf"])
def test_what_a_text_names_is_imported_later(project: Path, name: str) -> None:
    before = digest(project, "shukotsu.readers")
    edit(project, f"formats/{name}.py", "x = 1", "x = 2")
    assert digest(project, "shukotsu.readers") != before


def test_a_module_that_is_not_there_has_no_digest(project: Path) -> None:
    with pytest.raises(ModuleNotFoundError, match=r"shukotsu\.spun"):
        digest(project, "shukotsu.spun")


def names(module: str) -> set[str]:
    return {path.relative_to(ROOT / "shukotsu").as_posix() for path in files_of(module)}


REPORTS = {"report", "report.subject", "report.print_figures"}
STUDY = {"gather", "compare_models", "compare_movement"}
PLANTED = {
    "a threshold of the checks": (
        ("checks/timeline.py", "STUCK_S, STUCK_FRAMES = 0.25", "STUCK_S, STUCK_FRAMES = 0.5"),
        {"check_recordings"},
    ),
    "a language": (("stages/report/languages/eo.po", "", "x"), REPORTS),
    "an export format": (("stages/export/registry.py", "Format] = {", "Format] = {'x': None,"), {"export"}),
    "its name": (
        ("schemas/json/study.schema.json", '"bvh"', '"bvh", "x"'),
        STUDY | REPORTS - {"report.subject"},
    ),
    "a column of the recordings table": (
        ("schemas/catalogue.py", "RECORDINGS = Table(", "RECORDINGS = NEW or Table("),
        {"gather", "measure_movement", "measure_events", "compare_models", "export.tables"} | REPORTS,
    ),
    "a finding's sentence": (
        ("sentences/finding_sentences.py", "def what_of(", "WORSE = 1\n\n\ndef what_of("),
        set(),
    ),
    "a column of the whole hand's angles": (
        ("schemas/catalogue.py", "JOINT_ANGLES = Table(", "JOINT_ANGLES = NEW or Table("),
        {"fit_hand", "gather", "measure_movement", "measure_events", "export.tables"} | REPORTS,
    ),
}


def digests(root: Path) -> dict[str, str]:
    forget()
    modules = re.findall(r'code_digest\("([^"]+)"', (ROOT / "Snakefile").read_text())
    return {module.removeprefix("shukotsu.stages."): code_digest(module, root) for module in modules}


def test_a_change_reaches_the_commands_that_run_it_and_no_fit(tmp_path: Path) -> None:
    """What is planted, and all commands whose results it makes out of date."""
    ignored = shutil.ignore_patterns("data", "captions", "profiles", "config", "__pycache__")
    shutil.copytree(ROOT / "shukotsu", tmp_path / "shukotsu", ignore=ignored)
    before = digests(tmp_path)
    changed = {}
    for what, ((name, old, new), _) in PLANTED.items():
        path = tmp_path / "shukotsu" / name
        text = path.read_text("utf-8") if path.is_file() else ""
        assert old in text, what
        path.write_text(text.replace(old, new, 1), "utf-8")
        after = digests(tmp_path)
        changed[what] = {module for module in before if after[module] != before[module]}
        if text:
            path.write_text(text, "utf-8")
        else:
            path.unlink()
    assert changed == {what: modules for what, (_, modules) in PLANTED.items()}


def test_an_import_depends_on_every_reader_and_decoder_and_not_on_the_recorders_display() -> None:
    importing = names("shukotsu.stages.capture.import_recording")
    assert {
        f"stages/capture/formats/{name}.py" for name in ("tidy", "xdf", "c3d", "raw_capture")
    } <= importing
    assert {"trackers/liberty/binary_decoder.py", "trackers/viper/decoder.py"} <= importing
    assert not {"trackers/record/display.py", "trackers/emulate/server.py"} & importing


def test_every_rule_has_the_digest_of_the_command_that_it_runs() -> None:
    snakefile = (ROOT / "Snakefile").read_text()
    rules = re.findall(r'code_digest\("([^"]+)"\).*?\{run\} (\S+)', snakefile, re.DOTALL)
    assert len(rules) == snakefile.count("code_digest(")
    for module, command in rules:
        assert module == command
        assert code_digest(module)
