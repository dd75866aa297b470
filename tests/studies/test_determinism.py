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


def test_every_result_is_the_same_to_the_byte(tmp_path: Path) -> None:
    """On one core, and on two in a folder of another name, deeper down, where libraries are told to take two
    threads each; no result says where it was made, logs may.
    """
    on_one_core, on_two_cores = _study(tmp_path / "one"), _study(tmp_path / "other place" / "of the study")
    on_one_core.run(cores=1)
    with pytest.MonkeyPatch.context() as patch:
        for name in command_line.ONE_THREAD:
            patch.setenv(name, "2")
        on_two_cores.run(cores=2)
    results = on_one_core.results.folder
    digests = hashes(results)
    assert {"report.html", "sub-01/tips.parquet", "problems.parquet"} <= set(digests)
    assert digests == hashes(on_two_cores.results.folder)
    folder = str(on_one_core.folder).encode()
    assert not [name for name in digests if folder in (results / name).read_bytes()]
