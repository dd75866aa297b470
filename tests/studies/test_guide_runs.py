"""The guide's code blocks run page by page in their order, and so does its notebook."""

import os
import re
import shutil
import sys
from pathlib import Path

import duckdb
import pytest
from browser import browser  # noqa: F401
from guide_pages import PAGES, REPOSITORY, Block, blocks
from program_files import printed_by
from studies.running import ALL_BUT_FIGURES, SHORT_FIT, record, shukotsu, warm_jobs, write_study

FRAMES = 400
MODELS = ["rigid", "paper-fig4", "whole-hand.yaml"]
LAB_FILES = {
    "recordings.tsv": "subject\thand\ttask\trole\tfile\nP01\tright\trom\tcalibration\tp01_rom.csv\n"
    "P01\tright\tscales\tevaluation\tp01_scales.csv\n",
    "participants.tsv": "subject\thand_length_mm\thand_breadth_mm\nP01\t185\t82\n",
}
TAKE_FILES = """if [ "$PWD" != "$START" ] && [ -f study.yaml ]; then
    cp -rf "$LAB"/* .
fi"""
"""Shell lines that copy recordings, sheets and models into a new study folder, as a reader would by hand.

The results of the study, run once by the commands of these pages, are copied with them.
"""

pytestmark = pytest.mark.slow

SHELLS = ("sh", "bash", "shell", "console")
RUN_NOTEBOOK = REPOSITORY / "tests" / "report_samples" / "run_notebook.py"


def write_lab_files(folder: Path) -> None:
    """Write the recordings and sheets that the guide assumes a reader to have."""
    for name, task in (("rom", "rom"), ("p01_rom", "rom"), ("p01_scales", "opposition")):
        record(folder / f"{name}.csv", subject="P01", task=task, frames=FRAMES)
    for name, text in LAB_FILES.items():
        (folder / name).write_text(text, "utf-8")


def run_blocks(page: Path) -> list[Block]:
    """Return the page's blocks that are not marked with a reason for not being run."""
    return [block for block in blocks(page, *SHELLS, "python") if not block.not_run]


RUN_PAGES = [page for page in PAGES if run_blocks(page) and not page.stem.endswith(".ja")]
SQL = [block for page in PAGES for block in blocks(page, "sql") if not block.not_run]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which every page begins, with a finished study; tests must not change it."""
    folder = tmp_path_factory.mktemp("guide")
    write_lab_files(folder)
    rows = []
    for task, role in (("rom", "calibration"), ("opposition", "both")):
        record(folder / "captures" / f"{task}.parquet", task=task, frames=FRAMES)
        rows.append(f"01\tright\t{task}\t{role}\tcaptures/{task}.parquet\t")
    (folder / "whole-hand.yaml").write_text(SHORT_FIT.replace("fitted", "whole-hand", 1), "utf-8")
    write_study(folder, "demo", rows, MODELS, exports="[glb]").run(*ALL_BUT_FIGURES)
    (folder / "config").mkdir()
    for name in ("demo.yaml", "demo.tsv", "whole-hand.yaml"):
        text = (folder / name).read_text("utf-8").replace("captures/", "../captures/")
        (folder / "config" / name).write_text(text, "utf-8")
    shutil.copy(folder / "demo.yaml", folder / "study.yaml")
    return folder


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new study's folder with recordings and results."""
    folder = tmp_path_factory.mktemp("lab") / "piano"
    shukotsu(folder.parent, "new", "piano").check_returncode()
    write_lab_files(folder)
    study = folder / "study.yaml"
    study.write_text(re.sub("(?m)^models: .*", "models: [rigid, paper-fig4]", study.read_text("utf-8")))
    shukotsu(folder, "run").check_returncode()
    return folder


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory, lab: Path) -> dict[str, str]:
    """Environment with the programs on PATH as after `source .venv/bin/activate`, opening no windows."""
    programs = tmp_path_factory.mktemp("programs")
    for name, words in {"shukotsu": "-P -m shukotsu", "python": ""}.items():
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {words} "$@"\n', "utf-8")
        (programs / name).chmod(0o755)
    path = f"{programs}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    return os.environ | {
        **warm_jobs(),
        "PATH": path,
        "PYTHONPATH": str(REPOSITORY),
        "BROWSER": "true",
        "MPLBACKEND": "agg",
        "LAB": str(lab),
    }


@pytest.mark.parametrize("page", RUN_PAGES, ids=lambda page: page.name)
def test_the_code_blocks_of_a_page_run(
    page: Path, finished: Path, lab: Path, environment: dict[str, str], tmp_path: Path
) -> None:
    folder = tmp_path / "reader"
    shutil.copytree(finished, folder, symlinks=True)
    if "results/piano" in page.read_text("utf-8"):  # the study that the page describes
        shutil.copytree(lab, folder, dirs_exist_ok=True)
    (folder / ".venv").symlink_to(Path(sys.prefix))
    for name, lines in scripts(page).items():
        (folder / name).write_text(lines, "utf-8")
        program = [sys.executable] if name.endswith(".py") else ["bash"]
        printed_by(*program, name, cwd=folder, env=environment | {"START": str(folder)})


def scripts(page: Path) -> dict[str, str]:
    """Return a page's scripts by file name: all its shell blocks as one, all its Python blocks as another."""
    shell = [
        f"{TAKE_FILES}\necho '--- {block}'\n{block.text}"
        for block in run_blocks(page)
        if block.language in SHELLS
    ]
    python = [block.text for block in run_blocks(page) if block.language == "python"]
    texts = {"blocks.sh": ["set -eu", *shell] if shell else [], "blocks.py": python}
    return {name: "\n".join(blocks) for name, blocks in texts.items() if blocks}


@pytest.mark.parametrize("block", SQL, ids=str)
def test_sql_queries_return_rows(block: Block, finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """DuckDB returns rows for every statement except those that search for failures."""
    monkeypatch.chdir(finished)
    answers = [duckdb.execute(statement).fetchall() for statement in duckdb.extract_statements(block.text)]
    assert answers.count([]) == block.text.count("'failed'")


def test_the_notebook_answers_its_question(
    finished: Path, environment: dict[str, str], tmp_path: Path
) -> None:
    picture = tmp_path / "picture.png"
    inline = environment | {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}
    printed = printed_by(sys.executable, RUN_NOTEBOOK, finished, picture, env=inline)
    assert "moved most of the joints to believe: " in printed
    assert picture.stat().st_size > 10_000
