"""The same study gives the same bytes, wherever it is run and on however many cores."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies.running import StudyRun, hashes, record, write_study

from shukotsu import command_line

pytestmark = pytest.mark.slow

ROWS = [
    "01\tright\trom\tcalibration\trom.parquet",
    "01\tright\topposition\tevaluation\topposition.csv",
    "01\tleft\trom\tboth\tnowhere.csv",
]


def _study(folder: Path) -> StudyRun:
    folder.mkdir(parents=True)
    record(folder / "rom.parquet")
    record(folder / "opposition.csv", task="opposition")
    return write_study(folder, "same", ROWS, ["paper-fig3-rest", "paper-fig4"])


@pytest.fixture(scope="module")
def on_one_core(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    study = _study(tmp_path_factory.mktemp("one") / "study")
    study.run(cores=1)
    return study


@pytest.fixture(scope="module")
def on_two_cores(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """The same in a folder of another name, deeper down; libraries are told to take two threads each."""
    study = _study(tmp_path_factory.mktemp("two") / "other place" / "of the same study")
    with pytest.MonkeyPatch.context() as patch:
        for name in command_line.ONE_THREAD:
            patch.setenv(name, "2")
        study.run(cores=2)
    return study


def test_every_result_is_the_same_to_the_byte(on_one_core: StudyRun, on_two_cores: StudyRun) -> None:
    """Tables, the report and whatever else is under results; logs may say where they were."""
    found = hashes(on_one_core.results.folder)
    assert {"report.html", "sub-01/tips.parquet", "problems.parquet"} <= set(found)
    assert found == hashes(on_two_cores.results.folder)


def test_no_result_says_where_it_was_made(on_one_core: StudyRun) -> None:
    folder = str(on_one_core.folder).encode()
    results = on_one_core.results.folder
    assert not [name for name in hashes(results) if folder in (results / name).read_bytes()]
