"""The tables of a study's comparisons, from its tables of movement and its recordings' levels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.schemas.catalogue import PROBLEMS
from shukotsu.schemas.movement_tables import (
    CURVE_DIFFERENCES,
    MODEL_DEPENDENCE,
    MOVEMENT_CURVES,
    MOVEMENT_DIFFERENCES,
    MOVEMENT_RELIABILITY,
    QUESTIONS,
)
from shukotsu.schemas.quantities import QUANTITIES, Quantity
from shukotsu.schemas.questions import Question
from shukotsu.schemas.results import Results
from shukotsu.schemas.tables import Provenance, columns_from_rows, write_table, write_table_in_parts
from shukotsu.stages.compare_movement import curves_of_levels
from shukotsu.stages.compare_movement.asked_questions import question_rows
from shukotsu.stages.compare_movement.level_differences import difference_rows, judge
from shukotsu.stages.compare_movement.model_agreement import dependence_rows
from shukotsu.stages.compare_movement.movement_values import (
    RECORDING,
    Recorded,
    numbers_of,
    read_frame,
    recorded,
)
from shukotsu.stages.compare_movement.repeatability import reliability_rows

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]
TABLES = {quantity.table.name: quantity.table for quantity in QUANTITIES}


@dataclass(frozen=True)
class Questions:
    """What a study asks. model : of questions that name none. first_asked : by a question's digest, when it
    was first run and whether there were results of movement. columns : all factors and covariates.
    """

    asked: Sequence[Question] = ()
    model: str = ""
    first_asked: Mapping[str, tuple[str, bool]] = field(default_factory=dict)

    @property
    def columns(self) -> list[str]:
        """Columns of the sheets that they speak of."""
        return [name for question in self.asked for name in question.factors]


def compare_study(
    levels: Sequence[Mapping[str, str]],
    factors: Sequence[str],
    results: Results,
    sheets: Sequence[Path] = (),
    questions: Questions | None = None,
) -> None:
    """Read the study's tables of movement and write the tables of comparisons beside them.

    levels : as `schemas.factors.factor_levels` gives them. factors : those that are compared pair by pair.
    sheets : where they are from, for the tables' metadata. Raises TableError where a table is damaged.
    """
    questions = questions or Questions()
    columns = ["subject", "session", "hand", "severity"]
    problems = read_frame(results.study_table(PROBLEMS.name), PROBLEMS, columns)
    everything = recorded(levels, factors, problems, questions.columns)
    inputs = [results.study_table(name) for name in (PROBLEMS.name, *TABLES, MOVEMENT_CURVES.name)]
    provenance = Provenance.of([*sheets, *inputs], factors=list(factors))
    differences: list[Row] = []
    reliabilities: list[Row] = []
    outcomes: dict[str, pd.DataFrame] = {}
    for quantity, numbers in _numbers(results, everything):
        outcomes |= {
            own.name: _of_question(numbers, own, questions.model)[[*RECORDING, "value", "unit"]]
            for own in questions.asked
            if own.outcome == quantity
        }
        differences += difference_rows(quantity, numbers, everything)
        reliabilities += reliability_rows(quantity, numbers, everything)
    judge(differences)
    dependence = list(dependence_rows(differences, reliabilities))
    path = results.study_table(MOVEMENT_CURVES.name)
    curves = read_frame(path, MOVEMENT_CURVES, curves_of_levels.COLUMNS)
    outcomes |= {own.name: _curves(curves, own, questions.model) for own in questions.asked if own.curve}
    answers = question_rows(questions.asked, outcomes, everything, questions.model, questions.first_asked)
    for table, rows in (
        (QUESTIONS, answers),
        (MOVEMENT_DIFFERENCES, differences),
        (MOVEMENT_RELIABILITY, reliabilities),
        (MODEL_DEPENDENCE, dependence),
    ):
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)
    parts = curves_of_levels.curve_parts(curves, everything)
    path = results.study_table(CURVE_DIFFERENCES.name)
    write_table_in_parts(path, CURVE_DIFFERENCES, parts, provenance)


def _of_question(rows: pd.DataFrame, question: Question, model: str) -> pd.DataFrame:
    return rows[(rows["model"] == (question.model or model)) & (rows["of"] == question.whose)]


def _curves(curves: pd.DataFrame, question: Question, model: str) -> pd.DataFrame:
    """Curves of the recordings that a question is about, a column a percent."""
    of = curves["joint"].astype(str) + " " + curves["angle"].astype(str)
    own = _of_question(curves.assign(of=of), question, model)
    own = own[own["event"] == question.curve].astype(dict.fromkeys(RECORDING, str))
    wide = own.set_index([*RECORDING, "percent"])["mean_deg"].unstack("percent")
    return wide.reset_index()


def _numbers(results: Results, everything: Recorded) -> Iterator[tuple[Quantity, pd.DataFrame]]:
    """Every quantity's numbers, of one table after the other."""
    counted = everything.counted
    for name, quantities in groupby(QUANTITIES, key=lambda quantity: quantity.table.name):
        own = list(quantities)
        columns = dict.fromkeys(column for quantity in own for column in quantity.columns)
        whole = read_frame(results.study_table(name), TABLES[name], [*RECORDING, "model", *columns])
        for quantity in own:
            yield quantity, numbers_of(quantity, whole, counted)
