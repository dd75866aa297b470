"""The study's tables are those of its hands, all of them, whether their bytes are copied or their rows."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest
from report_samples.hand_tables import write_hand_tables
from report_samples.made_study import make_study

from schemas import joined_tables
from schemas.catalogue import JOINT_CENTRES, TABLES
from schemas.results import FIT_TABLES, HAND_TABLES, SCORE_TABLES, Results
from schemas.study import Hand, Study, read_study
from schemas.tables import Provenance, read_table, rows_of, write_failure
from stages.gather.study_tables import gather_study

GATHERED = (*HAND_TABLES, *FIT_TABLES, *SCORE_TABLES)


@pytest.fixture
def study(tmp_path: Path) -> tuple[Study, Results]:
    """A study whose hands have their tables; that of the metacarpals is empty."""
    file, folder = make_study(tmp_path, n_frames=40, models=("paper-fig4", "whole-hand"))
    write_hand_tables(read_study(file), Results(folder))
    return read_study(file), Results(folder)


def _rows(results: Results, name: str) -> list[str]:
    return sorted(map(repr, rows_of(read_table(results.study_table(name), TABLES[name]))))


@pytest.mark.parametrize("copied", [False, True])
def test_every_row_of_every_hand(
    study: tuple[Study, Results], monkeypatch: pytest.MonkeyPatch, copied: bool
) -> None:
    if copied:
        monkeypatch.setattr(joined_tables, "COPIED_FROM_BYTES", 1)
    before = {name: _rows(study[1], name) for name in GATHERED if study[1].study_table(name).is_file()}
    gather_study(*study)
    for name, rows in before.items():
        assert _rows(study[1], name) == rows, name
    tips = pq.ParquetFile(study[1].study_table("tips"))
    assert (tips.num_row_groups > 1) == copied


def test_a_hand_that_failed_is_named_and_the_others_are_there(study: tuple[Study, Results]) -> None:
    path = study[1].hand_table("paper-fig4", Hand("S01", "left"), "joint_centres")
    write_failure(path, JOINT_CENTRES, "no frame was valid", Provenance())
    gather_study(*study)
    joints = list(rows_of(read_table(study[1].study_table("joint_centres"), JOINT_CENTRES)))
    assert joints
    assert not [
        row for row in joints if (row["subject"], row["hand"], row["model"]) == ("S01", "left", "paper-fig4")
    ]
    problems = list(rows_of(read_table(study[1].study_table("problems"), TABLES["problems"])))
    told = [(row["where"], row["stage"]) for row in problems if "no frame was valid" in row["message"]]
    assert told == [("subject S01, left hand, model paper-fig4", "estimate_metacarpals")]
