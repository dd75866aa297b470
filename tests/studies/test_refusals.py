"""A study or a table that is wrong is refused: exit code 2, one sentence that says where, nothing written."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from collections.abc import Callable
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


def _assert_refused(code: int, stderr: str, words: list[str]) -> None:
    """One sentence with those words, exit code 2, no traceback."""
    assert code == 2, stderr
    (sentence,) = [line for line in stderr.splitlines() if line.startswith("error:")]
    for word in words:
        assert word in sentence
    assert "Traceback" not in stderr


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
    """Folder of every table of one hand, and of one that is cut off."""
    folder = tmp_path_factory.mktemp("hand")
    poses = import_recording(record(folder / "recording.csv"), folder / "poses.parquet")
    run_hand(poses, poses, "paper-fig4", folder)
    (folder / "damaged.parquet").write_bytes(poses.read_bytes()[:5_000])
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
INPUTS = [(stage, name) for stage, inputs in STAGES.items() for name in inputs]
Refused = Callable[[str, str, Path, list[str]], None]


def _words(stage: str, made: Path, out: Path, **replaced: Path) -> list[str]:
    """Words of a stage's command line, some of its inputs replaced."""
    inputs = {name: made / f"{file}.parquet" for name, file in STAGES[stage].items()} | replaced
    words = [word for name, path in inputs.items() for word in (f"--{name}", str(path))]
    words += [word for name in OUTPUTS[stage] for word in (f"--{name}", str(out / f"{name}.parquet"))]
    return ["--layout", "liberty16", "--model", "paper-fig4", *words]


def _table(stage: str, name: str) -> str:
    """Name of the table that a stage expects there."""
    file = STAGES[stage][name]
    return {"projected_joints": "joint_centres"}.get(file, file)


@pytest.fixture
def refused(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Run a stage with one input replaced; it must refuse it in those words and write nothing."""

    def check(stage: str, name: str, file: Path, words: list[str]) -> None:
        main = importlib.import_module(f"stages.{stage}.__main__").main
        code = main(_words(stage, made, tmp_path, **{name: file}))
        _assert_refused(code, capsys.readouterr().err, words)
        assert not list(tmp_path.iterdir())

    return check


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_works_alone_on_good_tables(made: Path, tmp_path: Path, stage: str) -> None:
    command = [sys.executable, "-m", f"stages.{stage}", *_words(stage, made, tmp_path)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert sorted(path.stem for path in tmp_path.iterdir()) == sorted(OUTPUTS[stage])


@pytest.mark.parametrize(("stage", "name"), INPUTS)
def test_another_table_is_refused(made: Path, refused: Refused, stage: str, name: str) -> None:
    wrong = "poses" if _table(stage, name) != "poses" else "joint_centres"
    words = [f"{wrong}.parquet", f"expected {_table(stage, name)}"]
    refused(stage, name, made / f"{wrong}.parquet", words)


@pytest.mark.parametrize(("stage", "name"), INPUTS)
def test_a_missing_table_is_refused(tmp_path: Path, refused: Refused, stage: str, name: str) -> None:
    words = ["nowhere.parquet", "no such file", _table(stage, name)]
    refused(stage, name, tmp_path / "nowhere.parquet", words)


@pytest.mark.parametrize(("stage", "name"), INPUTS)
def test_a_damaged_table_is_refused(made: Path, refused: Refused, stage: str, name: str) -> None:
    refused(stage, name, made / "damaged.parquet", ["damaged.parquet", "not a readable Parquet file"])
