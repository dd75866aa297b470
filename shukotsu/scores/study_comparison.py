"""The tables of a study's model comparisons, from its scores and joint errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shukotsu.scores.comparisons import compare_models
from shukotsu.scores.observations import ERROR_COLUMNS, METRICS, RECORDING_COLUMNS, SCORE_COLUMNS, ScoredStudy
from shukotsu.study.model import read_model
from shukotsu.study.results import Results
from shukotsu.study.study import Study
from shukotsu.tables.catalogue import (
    JOINT_ERRORS,
    MODEL_DIFFERENCES,
    MODEL_PAIRS,
    MODEL_VALUES,
    PROBLEMS,
    RECORDINGS,
    SKELETON_SCORES,
)
from shukotsu.tables.typed_table import Provenance, Table, columns_from_rows, read_table, write_table

if TYPE_CHECKING:
    import pandas as pd

_HAND = ["subject", "session", "hand"]


def compare_study(study: Study, results: Results) -> None:
    """Read a study's scores, errors and recordings, and write the three tables of comparisons beside them.

    Raises TableError where a table is damaged.
    """
    inputs = (SKELETON_SCORES, JOINT_ERRORS, RECORDINGS, PROBLEMS)
    comparison = compare_models(read_scores(study, results))
    paths = [results.study_table(table.name) for table in inputs]
    provenance = Provenance.of([*study.sheets.values(), *paths])
    for table, rows in (
        (MODEL_VALUES, comparison.values),
        (MODEL_PAIRS, comparison.pairs),
        (MODEL_DIFFERENCES, comparison.differences),
    ):
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)


def read_scores(study: Study, results: Results) -> ScoredStudy:
    """Read what a study's models are compared by."""
    problems = _read(results, PROBLEMS, [*_HAND, "severity"])
    suspect = problems.loc[problems["severity"] == "suspect", _HAND].drop_duplicates()
    metrics = {table: [m.name for m in METRICS if m.table == table.name]
               for table in (SKELETON_SCORES, JOINT_ERRORS)}  # fmt: skip
    return ScoredStudy(
        subjects=tuple(dict.fromkeys(recording.hand.subject for recording in study.recordings)),
        models={name: read_model(path.absolute()) for name, path in study.models.items()},
        layouts={hand: study.judged_layout(hand) for hand in study.hands},
        scores=_without(
            _read(results, SKELETON_SCORES, [*SCORE_COLUMNS, *metrics[SKELETON_SCORES]]), suspect
        ),
        errors=_without(_read(results, JOINT_ERRORS, [*ERROR_COLUMNS, *metrics[JOINT_ERRORS]]), suspect),
        recordings=_read(results, RECORDINGS, RECORDING_COLUMNS),
    )


def _read(results: Results, table: Table, columns: Sequence[str]) -> pd.DataFrame:
    frame: pd.DataFrame = read_table(results.study_table(table.name), table, list(columns)).to_pandas()
    return frame


def _without(rows: pd.DataFrame, suspect: pd.DataFrame) -> pd.DataFrame:
    """Leave out the rows of suspect hands."""
    of_suspect = rows.merge(suspect, how="left", on=_HAND, indicator=True)["_merge"] == "both"
    return rows[~of_suspect.to_numpy()]
