"""A study that is wrong is refused in one sentence, nothing written; a stage works alone on good tables."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from pipeline import import_recording, run_hand
from studies.running import REPOSITORY, record, snakemake, write_study

pytestmark = pytest.mark.slow

ROW = "01\tright\trom\tboth\trom.parquet"

BAD_LINES = {
    "a typo in a key": ("modles: [paper-fig4]", ["study.yaml", "'modles'", "did you mean 'models'"]),
    "a key given twice": ("models: [rigid]\nmodels: [rigid]", ["study.yaml", "'models' is given twice"]),
    "a missing sheet": ("recordings: nowhere.tsv", ["nowhere.tsv", "no such file"]),
}
"""What the tests of the schemas refuse in all its forms reaches whoever runs Snakemake."""


def _assert_study_refused(folder: Path, words: list[str], *more: str) -> None:
    """One sentence of Snakemake's with those words, no traceback."""
    done = _snakemake(folder, *more)
    assert done.returncode == 1
    (sentence,) = re.findall(r"^WorkflowError in file .*\n(.*)\n", done.stderr + done.stdout, re.MULTILINE)
    for word in words:
        assert word in sentence
    assert "Traceback" not in done.stderr + done.stdout
    assert not (folder / "results").exists()


def _snakemake(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return snakemake(folder, "--directory", str(folder), "--configfile", str(folder / "study.yaml"), *words)


@pytest.mark.parametrize("what", BAD_LINES)
def test_a_bad_study_file_is_refused(tmp_path: Path, what: str) -> None:
    line, words = BAD_LINES[what]
    study = write_study(tmp_path, "study", [ROW], ["paper-fig4"])
    key = line.split(":")[0]
    others = [old for old in study.file.read_text().splitlines() if not old.startswith(f"{key}:")]
    study.file.write_text("\n".join([*others, line]) + "\n")
    _assert_study_refused(tmp_path, words)


def test_a_study_file_that_is_no_yaml_is_refused(tmp_path: Path) -> None:
    """By Snakemake, which reads it before the Snakefile does; hence with its own words and exit code."""
    (tmp_path / "study.yaml").write_text("models: [rigid\n")
    done = _snakemake(tmp_path)
    assert done.returncode == 1
    assert "not valid JSON or YAML" in done.stderr
    assert not (tmp_path / "results").exists()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of every table of one hand."""
    folder = tmp_path_factory.mktemp("hand")
    poses = import_recording(record(folder / "recording.csv"), folder / "poses.parquet")
    run_hand(poses, poses, "paper-fig4", folder)
    return folder


STAGES = {
    "solve_joints": {"poses": "poses"},
    "project_planes": {"joints": "joint_solutions"},
    "estimate_metacarpals": {"joints": "projected_joints", "calibration": "poses", "poses": "poses"},
    "evaluate_tips": {
        "poses": "poses",
        "calibration": "poses",
        "joints": "joint_centres",
        "bones": "bone_lengths",
        "metacarpals": "metacarpals",
    },
}
OUTPUTS = {
    "solve_joints": ["out"],
    "project_planes": ["out"],
    "estimate_metacarpals": ["out", "out-joints", "out-bones"],
    "evaluate_tips": ["out", "out-errors"],
}


def _words(stage: str, made: Path, out: Path) -> list[str]:
    """Words of a stage's command line."""
    words = [w for name, file in STAGES[stage].items() for w in (f"--{name}", str(made / f"{file}.parquet"))]
    words += [word for name in OUTPUTS[stage] for word in (f"--{name}", str(out / f"{name}.parquet"))]
    return ["--layout", "liberty16", "--model", "paper-fig4", *words]


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_works_alone_on_good_tables(made: Path, tmp_path: Path, stage: str) -> None:
    command = [sys.executable, "-m", f"stages.{stage}", *_words(stage, made, tmp_path)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert sorted(path.stem for path in tmp_path.iterdir()) == sorted(OUTPUTS[stage])
