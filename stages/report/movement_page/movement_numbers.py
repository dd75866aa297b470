"""Tables of the movement page: ranges, differences and repeatability."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from shukotsu.sentences.translation import tr
from shukotsu.stages.report.comparison.comparison_text import p_text
from shukotsu.stages.report.movement_page.movement_results import OF_ANGLE, PLACE, RANGE, Movement
from shukotsu.stages.report.table_cells import DASH, Column, DataTable, Folded, number, table_of, text_column

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS = 300
"""A table with more rows is left to its Parquet file: a page must open at once."""


def range_table(movement: Movement) -> DataTable:
    """The range of motion of every joint angle over subjects, by hand and task."""
    means = movement.subject_means
    sd = movement.ranges.groupby([*PLACE, *OF_ANGLE], sort=False)["range_sd_deg"].median()
    cells = means.groupby([*PLACE, *OF_ANGLE], sort=False)[RANGE]
    found = cells.agg(["count", "mean", "std", "min", "max"]).join(sd).reset_index()
    columns = (
        text_column(tr("Joint"), "joint"),
        text_column(tr("Angle"), "angle"),
        text_column(tr("Hand"), "hand"),
        text_column(tr("Task"), "task"),
        _number(tr("Subjects"), "count", 0),
        _number(tr("Mean [deg]"), "mean"),
        _number(tr("SD between subjects [deg]"), "std"),
        _number(tr("Least [deg]"), "min"),
        _number(tr("Greatest [deg]"), "max"),
        _number(tr("Stated error of one [deg]"), "range_sd_deg"),
    )
    return _short(
        tr("Range of motion (2.5th to 97.5th percentile) over subjects"), columns, found, "ranges_of_motion"
    )


def difference_tables(movement: Movement) -> list[Folded]:
    """Every difference between two levels, a folded table a quantity, ranges first."""
    columns = (
        text_column(tr("Of"), "of"),
        Column(
            tr("Levels"),
            lambda r: tr(
                "{factor}: {level} less {other_level}",
                factor=r["factor"],
                level=r["level"],
                other_level=r["other_level"],
            ),
            is_text=True,
        ),
        text_column(tr("Hand"), "hand"),
        text_column(tr("Task"), "task"),
        Column(tr("Subjects"), lambda r: _subjects(r)),
        Column(tr("Mean"), lambda r: number(r["mean"])),
        Column(tr("Other mean"), lambda r: number(r["other_mean"])),
        Column(tr("Difference"), lambda r: number(r["difference"])),
        Column(tr("95 % interval"), lambda r: _interval(r["low"], r["high"])),
        Column(tr("Effect size"), lambda r: f"{number(r['effect_size'])} {r['effect_size_name']}".strip()),
        Column("p", lambda r: _p(r["p"])),
        Column(tr("p, corrected"), lambda r: _p(r["p_holm"])),
        text_column(tr("Verdict"), "verdict"),
        text_column(tr("Test"), "test"),
        Column(tr("Left out, and why"), lambda r: _left_out(r), is_text=True),
    )
    return list(_by_quantity(movement.differences, tr("Differences"), columns, "movement_differences"))


def reliability_tables(movement: Movement) -> list[Folded]:
    """Tabulate the repeatability of every number, a folded table a quantity, ranges first."""
    columns = (
        text_column(tr("Of"), "of"),
        text_column(tr("Across"), "across"),
        text_column(tr("Hand"), "hand"),
        text_column(tr("Task"), "task"),
        Column(tr("Subjects"), lambda r: str(int(r["n"]))),
        Column(tr("Times"), lambda r: str(int(r["k"]))),
        Column(tr("ICC(2,1)"), lambda r: _with_interval(r, "icc_2_1")),
        Column(tr("ICC(3,1)"), lambda r: _with_interval(r, "icc_3_1")),
        _number(tr("SEM"), "sem", 2),
        _number(tr("MDC"), "mdc", 2),
    )
    return list(_by_quantity(movement.reliability, tr("Repeatability"), columns, "movement_reliability"))


def _by_quantity(rows: pd.DataFrame, words: str, columns: Iterable[Column], table: str) -> Iterator[Folded]:
    names = sorted(rows["quantity"].unique(), key=lambda name: name != RANGE)
    for name in names:
        own = rows[rows["quantity"] == name]
        caption = tr("{words} in {name}{unit}", words=words, name=name, unit=_unit(own))
        yield Folded(
            tr("{name}: {n_own} rows", name=name, n_own=len(own)), _short(caption, columns, own, table)
        )


def _unit(rows: pd.DataFrame) -> str:
    units = [unit for unit in rows["unit"].unique() if unit]
    return f" [{units[0]}]" if units else ""


def _short(caption: str, columns: Iterable[Column], rows: pd.DataFrame, table: str) -> DataTable:
    """The table, or its first rows with a note where all are."""
    more = len(rows) - MOST_ROWS
    head = rows.head(MOST_ROWS).to_dict("records")
    note = (
        tr("{more} more rows are in {table}.parquet.", more=more, table=table)
        if more > 0
        else tr("There is none.")
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
        else tr("{n} and {n_other}", n=int(row["n"]), n_other=int(row["n_other"]))
    )


def _interval(low: float, high: float) -> str:
    return DASH if low != low or high != high else tr("{low} to {high}", low=number(low), high=number(high))


def _with_interval(row: Any, name: str) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    beside = "" if low != low else tr(" ({low} to {high})", low=number(low), high=number(high))
    return f"{number(row[name])}{beside}"


def _p(value: float | None) -> str:
    return DASH if value is None or value != value else p_text(value).removeprefix("p ").removeprefix("= ")


def _left_out(row: Any) -> str:
    reason = "; ".join(filter(None, (row["left_out_reason"], row["message"])))
    return f"{int(row['left_out'])}: {reason}" if row["left_out"] else reason
