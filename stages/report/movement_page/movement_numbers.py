"""Tables of the movement page: ranges, differences, repeatability, and where models part."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from stages.report.comparison.comparison_text import p_text
from stages.report.movement_page.movement_results import OF_ANGLE, PLACE, RANGE, Movement
from stages.report.movement_page.movement_text import PAIR
from stages.report.table_cells import DASH, Column, DataTable, Folded, number, table_of, text_column
from stages.report.wording import say

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
        text_column(say("Joint"), "joint"),
        text_column(say("Angle"), "angle"),
        text_column(say("Hand"), "hand"),
        text_column(say("Task"), "task"),
        _number(say("Subjects"), "count", 0),
        _number(say("Mean [deg]"), "mean"),
        _number(say("SD between subjects [deg]"), "std"),
        _number(say("Least [deg]"), "min"),
        _number(say("Greatest [deg]"), "max"),
        _number(say("Stated error of one [deg]"), "range_sd_deg"),
    )
    return _short(
        say("Range of motion (2.5th to 97.5th percentile) over subjects"), columns, found, "ranges_of_motion"
    )


def difference_tables(movement: Movement) -> list[Folded]:
    """Every difference between two levels, a folded table a quantity, ranges first."""
    columns = (
        text_column(say("Of"), "of"),
        Column(
            say("Levels"),
            lambda r: say(
                "{factor}: {level} less {other_level}",
                factor=r["factor"],
                level=r["level"],
                other_level=r["other_level"],
            ),
            is_text=True,
        ),
        text_column(say("Hand"), "hand"),
        text_column(say("Task"), "task"),
        Column(say("Subjects"), lambda r: _subjects(r)),
        Column(say("Mean"), lambda r: number(r["mean"])),
        Column(say("Other mean"), lambda r: number(r["other_mean"])),
        Column(say("Difference"), lambda r: number(r["difference"])),
        Column(say("95 % interval"), lambda r: _interval(r["low"], r["high"])),
        Column(say("Effect size"), lambda r: f"{number(r['effect_size'])} {r['effect_size_name']}".strip()),
        Column("p", lambda r: _p(r["p"])),
        Column(say("p, corrected"), lambda r: _p(r["p_max_t"])),
        text_column(say("Test"), "test"),
        Column(say("Left out, and why"), lambda r: _left_out(r), is_text=True),
    )
    return list(_by_quantity(movement.differences, say("Differences"), columns, "movement_differences"))


def reliability_tables(movement: Movement) -> list[Folded]:
    """How every number repeats, a folded table a quantity, ranges first."""
    columns = (
        text_column(say("Of"), "of"),
        text_column(say("Across"), "across"),
        text_column(say("Hand"), "hand"),
        text_column(say("Task"), "task"),
        Column(say("Subjects"), lambda r: str(int(r["n"]))),
        Column(say("Times"), lambda r: str(int(r["k"]))),
        Column(say("ICC(2,1)"), lambda r: _with_interval(r, "icc_2_1")),
        Column(say("ICC(3,1)"), lambda r: _with_interval(r, "icc_3_1")),
        _number(say("SEM"), "sem", 2),
        _number(say("MDC"), "mdc", 2),
        _number(say("Bias"), "bias", 2),
        Column(say("Limits of agreement"), lambda r: _interval(r["loa_low"], r["loa_high"])),
        _number(say("Stated 1-sigma"), "stated_sd", 2),
        Column(say("Within 1.96 of it [%]"), lambda r: number(r["held_percent"], 0)),
    )
    return list(_by_quantity(movement.reliability, say("Repeatability"), columns, "movement_reliability"))


def dependence_table(movement: Movement) -> DataTable:
    """The answers that another model changes."""
    rows = movement.dependence
    apart = rows[np.array([agree is not None and not agree for agree in rows["agree"]], bool)]
    columns = (
        text_column(say("Of"), "of"),
        text_column(say("Quantity"), "quantity"),
        text_column(say("Question"), "question"),
        Column(say("Levels"), lambda r: _levels(r), is_text=True),
        text_column(say("Hand"), "hand"),
        text_column(say("Task"), "task"),
        text_column(say("Models that part most"), "which"),
        _number(say("By"), "widest_difference", 2),
        text_column(say("What they say"), "message"),
    )
    return _short(say("Answers that depend on the skeleton model"), columns, apart, "model_dependence")


def _by_quantity(rows: pd.DataFrame, words: str, columns: Iterable[Column], table: str) -> Iterator[Folded]:
    names = sorted(rows["quantity"].unique(), key=lambda name: name != RANGE)
    for name in names:
        own = rows[rows["quantity"] == name]
        caption = say("{words} in {name}{unit}", words=words, name=name, unit=_unit(own))
        yield Folded(
            say("{name}: {n_own} rows", name=name, n_own=len(own)), _short(caption, columns, own, table)
        )


def _unit(rows: pd.DataFrame) -> str:
    units = [unit for unit in rows["unit"].unique() if unit]
    return f" [{units[0]}]" if units else ""


def _short(caption: str, columns: Iterable[Column], rows: pd.DataFrame, table: str) -> DataTable:
    """The table, or its first rows with a note where all are."""
    more = len(rows) - MOST_ROWS
    head = rows.head(MOST_ROWS).to_dict("records")
    note = (
        say("{more} more rows are in {table}.parquet.", more=more, table=table)
        if more > 0
        else say("There is none.")
        if rows.empty
        else ""
    )
    found = table_of(f"{caption}.", list(columns), head)
    return DataTable(found.caption, found.blocks, (note,) if note else (), found.text_columns)


def _number(heading: str, name: str, decimals: int = 1) -> Column:
    return Column(heading, lambda row: number(row[name], decimals))


def _subjects(row: Any) -> str:
    return (
        str(int(row["n"]))
        if row["design"] == "within"
        else say("{n} and {n_other}", n=int(row["n"]), n_other=int(row["n_other"]))
    )


def _interval(low: float, high: float) -> str:
    return DASH if low != low or high != high else say("{low} to {high}", low=number(low), high=number(high))


def _with_interval(row: Any, name: str) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    beside = "" if low != low else say(" ({low} to {high})", low=number(low), high=number(high))
    return f"{number(row[name])}{beside}"


def _p(value: float | None) -> str:
    return DASH if value is None or value != value else p_text(value).removeprefix("p ").removeprefix("= ")


def _left_out(row: Any) -> str:
    reason = "; ".join(filter(None, (row["left_out_reason"], row["message"])))
    return f"{int(row['left_out'])}: {reason}" if row["left_out"] else reason


def _levels(row: Any) -> str:
    factor, level, other = (row[name] for name in PAIR)
    return say("{factor}: {level} less {other}", factor=factor, level=level, other=other) if level else factor
