"""Tables of the movement page: ranges, differences, repeatability, and where models part."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stages.report.comparison.comparison_text import p_text
from stages.report.movement_page.movement_results import OF_ANGLE, PLACE, RANGE, Movement
from stages.report.movement_page.movement_text import PAIR
from stages.report.table_cells import DASH, Column, DataTable, Folded, number, table_of, text_column

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS = 300
"""A table with more rows is left to its Parquet file: a page must open at once."""


def range_table(movement: Movement) -> DataTable:
    """The range of motion of every joint angle over subjects, by hand and task."""
    means = movement.subject_means
    sd = movement.ranges.groupby([*PLACE, *OF_ANGLE], sort=False, observed=True)["range_sd_deg"].median()
    cells = means.groupby([*PLACE, *OF_ANGLE], sort=False, observed=True)[RANGE]
    found = cells.agg(["count", "mean", "std", "min", "max"]).join(sd).reset_index()
    columns = (
        text_column("Joint", "joint"),
        text_column("Angle", "angle"),
        text_column("Hand", "hand"),
        text_column("Task", "task"),
        _number("Subjects", "count", 0),
        _number("Mean [deg]", "mean"),
        _number("SD between subjects [deg]", "std"),
        _number("Least [deg]", "min"),
        _number("Greatest [deg]", "max"),
        _number("Stated error of one [deg]", "range_sd_deg"),
    )
    return _short(
        "Range of motion (2.5th to 97.5th percentile) over subjects", columns, found, "ranges_of_motion"
    )


def difference_tables(movement: Movement) -> list[Folded]:
    """Every difference between two levels, a folded table a quantity, ranges first."""
    columns = (
        text_column("Of", "of"),
        Column("Levels", lambda r: f"{r['factor']}: {r['level']} less {r['other_level']}", is_text=True),
        text_column("Hand", "hand"),
        text_column("Task", "task"),
        Column("Subjects", lambda r: _subjects(r)),
        Column("Mean", lambda r: number(r["mean"])),
        Column("Other mean", lambda r: number(r["other_mean"])),
        Column("Difference", lambda r: number(r["difference"])),
        Column("95 % interval", lambda r: _interval(r["low"], r["high"])),
        Column("Effect size", lambda r: f"{number(r['effect_size'])} {r['effect_size_name']}".strip()),
        Column("p", lambda r: _p(r["p"])),
        Column("p, Holm", lambda r: _p(r["p_holm"])),
        text_column("Test", "test"),
        Column("Left out, and why", lambda r: _left_out(r), is_text=True),
    )
    return list(_by_quantity(movement.differences, "Differences", columns, "movement_differences"))


def reliability_tables(movement: Movement) -> list[Folded]:
    """How every number repeats, a folded table a quantity, ranges first."""
    columns = (
        text_column("Of", "of"),
        text_column("Across", "across"),
        text_column("Hand", "hand"),
        text_column("Task", "task"),
        Column("Subjects", lambda r: str(int(r["n"]))),
        Column("Times", lambda r: str(int(r["k"]))),
        Column("ICC(2,1)", lambda r: _with_interval(r, "icc_2_1")),
        Column("ICC(3,1)", lambda r: _with_interval(r, "icc_3_1")),
        _number("SEM", "sem", 2),
        _number("MDC", "mdc", 2),
        _number("Bias", "bias", 2),
        Column("Limits of agreement", lambda r: _interval(r["loa_low"], r["loa_high"])),
        _number("Stated 1-sigma", "stated_sd", 2),
        Column("Held by it [%]", lambda r: number(r["held_percent"], 0)),
    )
    return list(_by_quantity(movement.reliability, "Repeatability", columns, "movement_reliability"))


def dependence_table(movement: Movement) -> DataTable:
    """The answers that another model changes."""
    rows = movement.dependence
    apart = rows[np.array([agree is not None and not agree for agree in rows["agree"]], bool)]
    columns = (
        text_column("Of", "of"),
        text_column("Quantity", "quantity"),
        text_column("Question", "question"),
        Column("Levels", lambda r: _levels(r), is_text=True),
        text_column("Hand", "hand"),
        text_column("Task", "task"),
        text_column("Models that part most", "which"),
        _number("By", "widest_difference", 2),
    )
    return _short("Answers that depend on the skeleton model", columns, apart, "model_dependence")


def _by_quantity(rows: pd.DataFrame, words: str, columns: Iterable[Column], table: str) -> Iterator[Folded]:
    names = sorted(rows["quantity"].unique(), key=lambda name: name != RANGE)
    for name in names:
        own = rows[rows["quantity"] == name]
        caption = f"{words} in {name}{_unit(own)}"
        yield Folded(f"{name}: {len(own)} rows", _short(caption, columns, own, table))


def _unit(rows: pd.DataFrame) -> str:
    units = [unit for unit in rows["unit"].unique() if unit]
    return f" [{units[0]}]" if units else ""


def _short(caption: str, columns: Iterable[Column], rows: pd.DataFrame, table: str) -> DataTable:
    """The table, or its first rows with a note where all are."""
    more = len(rows) - MOST_ROWS
    head = rows.head(MOST_ROWS).to_dict("records")
    note = f"{more} more rows are in {table}.parquet." if more > 0 else "There is none." if rows.empty else ""
    found = table_of(f"{caption}.", list(columns), head)
    return DataTable(found.caption, found.blocks, (note,) if note else (), found.text_columns)


def _number(heading: str, name: str, decimals: int = 1) -> Column:
    return Column(heading, lambda row: number(row[name], decimals))


def _subjects(row: Any) -> str:
    return str(int(row["n"])) if row["design"] == "within" else f"{int(row['n'])} and {int(row['n_other'])}"


def _interval(low: float, high: float) -> str:
    return DASH if low != low or high != high else f"{number(low)} to {number(high)}"


def _with_interval(row: Any, name: str) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    beside = "" if low != low else f" ({number(low)} to {number(high)})"
    return f"{number(row[name])}{beside}"


def _p(value: float | None) -> str:
    return DASH if value is None or value != value else p_text(value).removeprefix("p ").removeprefix("= ")


def _left_out(row: Any) -> str:
    reason = "; ".join(filter(None, (row["left_out_reason"], row["message"])))
    return f"{int(row['left_out'])}: {reason}" if row["left_out"] else reason


def _levels(row: Any) -> str:
    factor, level, other = (row[name] for name in PAIR)
    return f"{factor}: {level} less {other}" if level else factor
