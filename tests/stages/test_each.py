"""Many units of a stage in one process: the tables of one by one, and made only when they must be."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest

from schemas.tables import read_metadata
from stages import each
from stages.capture.__main__ import main as capture
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate
from stages.solve_joints.__main__ import main as solve_joints
from stages.units import pack

MODELS = ("paper-fig3", "rigid")


class Study:
    """One recording's poses, and a job that solves them under two models."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.poses, self.made = folder / "poses.parquet", folder / "made.json"
        self.folder, self._patch = folder, monkeypatch
        self.record(300)

    def record(self, frames: int) -> None:
        """Record the motion anew; its poses."""
        recording = self.folder / "rom.parquet"
        write_recording(recording, simulate("01", "right", "rom", 3, Realism.full(), frames))
        words = ["--layout=liberty16", "--subject=01", "--hand=right", "--task=rom", f"--out={self.poses}"]
        assert capture(["import", f"--in={recording}", *words]) == 0

    def units(self) -> list[list[str]]:
        """Command lines of the two."""
        common = ["--record-failure", "--layout=liberty16", "--poses", str(self.poses)]
        return [[*common, f"--model={model}", f"--out={self.folder / model}.parquet"] for model in MODELS]

    def run(self, code: str = "1", units: list[list[str]] | None = None) -> int:
        """Do the job; give its exit code."""
        self._patch.setattr(sys, "stdin", io.StringIO(pack(self.units() if units is None else units)))
        return each.main(["solve_joints", f"--code={code}", f"--made={self.made}"])

    def times(self) -> list[int]:
        """When each table was written."""
        return [(self.folder / f"{model}.parquet").stat().st_mtime_ns for model in MODELS]


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Study:
    made = Study(tmp_path, monkeypatch)
    assert made.run() == 0
    return made


def test_tables_are_those_of_a_process_each(study: Study, tmp_path: Path) -> None:
    for model, words in zip(MODELS, study.units(), strict=True):
        alone = tmp_path / "alone.parquet"
        assert solve_joints([*words[:-1], f"--out={alone}"]) == 0
        together = read_metadata(tmp_path / f"{model}.parquet")
        assert together.pop("unit")
        assert together == read_metadata(alone)


def test_what_was_made_is_listed(study: Study) -> None:
    listed = json.loads(study.made.read_text())
    assert [unit["files"] for unit in listed] == [[f"{study.folder}/{model}.parquet"] for model in MODELS]
    assert len({unit["unit"] for unit in listed}) == len(MODELS)


def test_nothing_is_made_twice(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    before, listed = study.times(), study.made.read_bytes()
    study.made.unlink()
    assert study.run() == 0
    assert study.times() == before
    assert study.made.read_bytes() == listed
    assert "0 made, 2 up to date" in capsys.readouterr().err


def test_an_input_of_other_bytes_makes_them_again(study: Study) -> None:
    before = study.times()
    study.record(280)
    assert study.run() == 0
    assert all(now > then for now, then in zip(study.times(), before, strict=True))


def test_an_input_rewritten_with_the_same_bytes_does_not(study: Study) -> None:
    before = study.times()
    study.record(300)
    assert study.run() == 0
    assert study.times() == before


def test_other_code_makes_them_again(study: Study) -> None:
    before = study.times()
    assert study.run(code="2") == 0
    assert all(now > then for now, then in zip(study.times(), before, strict=True))


def test_other_words_make_that_unit_again(study: Study) -> None:
    before = study.times()
    units = study.units()
    units[0].insert(1, "--hand-length-mm=190")
    assert study.run(units=units) == 0
    after = study.times()
    assert after[0] > before[0]
    assert after[1] == before[1]


def test_a_table_that_is_gone_is_made_again(study: Study) -> None:
    before = study.times()
    (study.folder / f"{MODELS[0]}.parquet").unlink()
    assert study.run() == 0
    after = study.times()
    assert after[0] > before[0]
    assert after[1] == before[1]


def test_told_so_everything_is_made_again(study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    before = study.times()
    monkeypatch.setenv(each.ANEW, "1")
    assert study.run() == 0
    assert all(now > then for now, then in zip(study.times(), before, strict=True))


def test_a_failure_is_tried_again_and_costs_no_other_unit(study: Study) -> None:
    units = study.units()
    units[0][-2] = "--model=paper-fig5"
    assert study.run(units=units) == 0
    assert "paper-fig5" in read_metadata(study.folder / f"{MODELS[0]}.parquet")["failure"]
    before = study.times()
    assert study.run(units=units) == 0
    after = study.times()
    assert after[0] > before[0]
    assert after[1] == before[1]


def test_an_output_that_cannot_be_written_is_2_and_lists_nothing(study: Study) -> None:
    units = study.units()
    (study.folder / "file").write_text("")
    units[0][-1] = f"--out={study.folder}/file/x.parquet"
    study.made.unlink()
    assert study.run(units=units) == 2
    assert not study.made.exists()


def test_what_a_killed_job_left_is_removed_though_its_tables_are_up_to_date(study: Study) -> None:
    left = study.folder / ".rigid.parquet.4194305.tmp"
    left.write_text("half")
    before = study.times()
    assert study.run() == 0
    assert study.times() == before
    assert not left.exists()
