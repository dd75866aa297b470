"""Results that Snakemake has forgotten, that were copied or damaged: contents decide, and no times."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from studies.running import StudyRun, hashes, record, write_study

pytestmark = pytest.mark.slow

CUT = ("report.html", "sub-01/plan.json", "sub-01/findings.parquet", "sub-01/exports/{}.bvh")


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """A small study, run."""
    folder = tmp_path_factory.mktemp("memory") / "base"
    record(folder / "rom.csv")
    record(folder / "other.csv", frames=320)
    rows = ["01\tright\trom\tboth\trom.csv"]
    study = write_study(folder, "small", rows, ["rigid"], exports="[bvh]")
    study.run()
    return study


def copied(base: StudyRun, folder: Path, *, times: bool = False, memory: bool = False) -> StudyRun:
    """A copy of the study, with or without the times of its files and Snakemake's memory."""
    leave = None if memory else shutil.ignore_patterns(".snakemake")
    copy = shutil.copy2 if times else shutil.copyfile
    shutil.copytree(base.folder, folder, ignore=leave, copy_function=copy)
    return StudyRun(folder / base.file.name, folder)


def rules(study: StudyRun) -> set[str]:
    return {job.rule for job in study.planned()}


@pytest.mark.parametrize("memory", [True, False])
def test_a_copy_makes_nothing_again(base: StudyRun, tmp_path: Path, memory: bool) -> None:
    """Also in a folder at another depth."""
    study = copied(base, tmp_path / "deeper" / "copy", memory=memory)
    assert study.planned() == set()
    assert "Nothing to be done" in study.run()


def test_what_changed_is_made_anew_where_the_memory_is_gone(base: StudyRun, tmp_path: Path) -> None:
    study = copied(base, tmp_path / "copy", times=True)
    sheet = study.folder / "small.tsv"
    text = sheet.read_text("utf-8")
    sheet.write_text(text.replace("both", "calibration"), "utf-8")
    assert "solve_joints" in rules(study)
    assert "capture" not in rules(study)
    sheet.write_text(text.replace("rom.csv", "other.csv"), "utf-8")
    assert "capture" in rules(study)
    sheet.write_text(text, "utf-8")
    assert study.planned() == set()
    (study.folder / "other.csv").rename(study.folder / "rom.csv")
    assert {"capture", "solve_joints", "report"} <= rules(study)


def test_what_no_run_left_so_is_made_anew(base: StudyRun, tmp_path: Path) -> None:
    """Cut short with its time kept, or of unknown origin: to the same bytes, and nothing is left to do."""
    study = copied(base, tmp_path / "copy", times=True, memory=True)
    before = hashes(study.results.folder)
    files = [study.results.folder / name.format("sub-01_hand-right_task-rom_model-rigid") for name in CUT]
    for file in files:
        state = file.stat()
        os.truncate(file, state.st_size // 2)
        os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert {"check_recordings", "export", "gather", "report"} <= rules(study)
    assert study.planned("results/small/sub-01/right/rom/poses.parquet") == set(), "and no other target"
    assert "note: not as a run left them, and made anew: " in study.run()
    assert hashes(study.results.folder) == before
    assert study.planned() == set()
    (study.results.folder / "logs" / "made_from.json").unlink()
    assert study.planned() == set()
    shutil.rmtree(study.folder / ".snakemake")
    assert {"capture", "solve_joints", "report"} <= rules(study), "nothing says what they were made from"
