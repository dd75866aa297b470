"""The tables of a study's comparisons, from its tables of movement and its recordings' levels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.schemas.catalogue import MOVEMENT_DIFFERENCES, MOVEMENT_RELIABILITY, PROBLEMS
from shukotsu.schemas.quantities import QUANTITIES, Quantity
from shukotsu.schemas.results import Results
from shukotsu.schemas.tables import Provenance, Table, columns_from_rows, read_table, write_table
from shukotsu.stages.compare_movement.level_differences import difference_rows, judge, level_pairs
from shukotsu.stages.compare_movement.movement_values import (
    RECORDING,
    Recorded,
    numbers_of,
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
    """Read the study's tables of movement and write the tables of comparisons beside them.

    levels : as `factor_levels` returns them. factors : those that are compared pair by pair.
    sheets : where they are from, for the tables' metadata. Raises TableError where a table is damaged.
    """
    problems = _read(results, PROBLEMS, ["subject", "session", "hand", "severity"])
    everything = recorded(levels, factors, problems)
    inputs = [results.study_table(name) for name in (PROBLEMS.name, *TABLES)]
    provenance = Provenance.of([*sheets, *inputs], factors=list(factors))
    differences: list[Row] = []
    reliabilities: list[Row] = []
    pairs = list(level_pairs(everything))
    for quantity, numbers in _numbers(results, everything):
        differences += difference_rows(quantity, numbers, pairs)
        reliabilities += reliability_rows(quantity, numbers, everything)
    judge(differences)
    for table, rows in ((MOVEMENT_DIFFERENCES, differences), (MOVEMENT_RELIABILITY, reliabilities)):
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)


def _numbers(results: Results, everything: Recorded) -> Iterator[tuple[Quantity, pd.DataFrame]]:
    """Every quantity's numbers, of one table after the other."""
    counted = everything.counted
    for name, quantities in groupby(QUANTITIES, key=lambda quantity: quantity.table.name):
        listed = list(quantities)
        columns = dict.fromkeys([*listed[0].of, *(quantity.name for quantity in listed)])
        whole = _read(results, TABLES[name], [*RECORDING, "model", *columns])
        for quantity in listed:
            yield quantity, numbers_of(quantity, whole, counted)


def _read(results: Results, table: Table, columns: Sequence[str]) -> pd.DataFrame:
    frame: pd.DataFrame = read_table(results.study_table(table.name), table, list(columns)).to_pandas()
    return frame
