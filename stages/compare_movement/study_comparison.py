"""The tables of a study's comparisons, from its tables of movement and its recordings' levels."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
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
)
from shukotsu.schemas.results import Results
from shukotsu.schemas.tables import Provenance, columns_from_rows, write_table, write_table_in_parts
from shukotsu.stages.compare_movement import curves_of_levels
from shukotsu.stages.compare_movement.level_differences import difference_rows, too_many_levels
from shukotsu.stages.compare_movement.model_agreement import dependence_rows
from shukotsu.stages.compare_movement.movement_values import (
    QUANTITIES,
    RECORDING,
    Quantity,
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


def compare_study(
    levels: Sequence[Mapping[str, str]],
    factors: Sequence[str],
    results: Results,
    sheets: Sequence[Path] = (),
) -> None:
    """Read the study's tables of movement and write the four tables of comparisons beside them.

    levels : as `schemas.factors.factor_levels` gives them. sheets : where they are from, for the tables'
    metadata. Raises TableError where a table is damaged.
    """
    import pandas as pd

    columns = ["subject", "session", "hand", "severity"]
    problems = read_frame(results.study_table(PROBLEMS.name), PROBLEMS, columns)
    frame = pd.DataFrame(levels, columns=list(dict.fromkeys([*RECORDING, *factors])), dtype=str)
    everything = recorded(frame, factors, problems)
    for message in too_many_levels(everything):
        print(f"note: {message}", file=sys.stderr)
    inputs = [results.study_table(name) for name in (PROBLEMS.name, *TABLES, MOVEMENT_CURVES.name)]
    provenance = Provenance.of([*sheets, *inputs], factors=list(factors))
    differences: list[Row] = []
    reliabilities: list[Row] = []
    for quantity, numbers in _numbers(results, everything):
        differences += difference_rows(quantity, numbers, everything)
        reliabilities += reliability_rows(quantity, numbers, everything)
    dependence = list(dependence_rows(differences, reliabilities))
    for table, rows in (
        (MOVEMENT_DIFFERENCES, differences),
        (MOVEMENT_RELIABILITY, reliabilities),
        (MODEL_DEPENDENCE, dependence),
    ):
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)
    curves = read_frame(results.study_table(MOVEMENT_CURVES.name), MOVEMENT_CURVES, curves_of_levels.COLUMNS)
    parts = curves_of_levels.curve_parts(curves, everything)
    path = results.study_table(CURVE_DIFFERENCES.name)
    write_table_in_parts(path, CURVE_DIFFERENCES, parts, provenance)


def _numbers(results: Results, everything: Recorded) -> Iterator[tuple[Quantity, pd.DataFrame]]:
    """Every quantity's numbers, of one table after the other."""
    counted = everything.counted
    for name, quantities in groupby(QUANTITIES, key=lambda quantity: quantity.table.name):
        own = list(quantities)
        columns = [*RECORDING, "model", *own[0].of]
        columns += dict.fromkeys(
            column for quantity in own for column in (quantity.name, quantity.sd) if column
        )
        whole = read_frame(results.study_table(name), TABLES[name], columns)
        for quantity in own:
            yield quantity, numbers_of(quantity, whole, counted)
