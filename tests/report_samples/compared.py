"""Models compared as the stage compares them, of rows that a test changed or made up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pandas as pd

from shukotsu.report.study_results import Row, StudyResults
from shukotsu.scores.comparisons import ComparedModels, compare_models
from shukotsu.scores.observations import ScoredStudy
from shukotsu.tables.catalogue import JOINT_ERRORS, RECORDINGS, SKELETON_SCORES
from shukotsu.tables.typed_table import Table


def scored_study(results: StudyResults) -> ScoredStudy:
    """What the stage reads of these results."""
    return ScoredStudy(
        subjects=tuple(results.subjects),
        models=results.models,
        layouts=results.layouts,
        scores=_frame(SKELETON_SCORES, results.counted(results.scores)),
        errors=_frame(JOINT_ERRORS, results.counted(results.joint_errors)),
        recordings=_frame(RECORDINGS, results.recording_rows),
    )


def compared(results: StudyResults) -> StudyResults:
    return with_comparisons(results, compare_models(scored_study(results)))


def with_comparisons(results: StudyResults, models: ComparedModels) -> StudyResults:
    """The results with these comparisons, every column as the tables have it."""
    empty = dict.fromkeys(("interval_95_low", "interval_95_high", "effect_size", "p"))
    differences = [empty | row for row in models.differences]
    return replace(results, model_values=models.values, model_differences=differences)


def _frame(table: Table, rows: Sequence[Row]) -> pd.DataFrame:
    return pd.DataFrame.from_records(rows, columns=[column.name for column in table.columns])
