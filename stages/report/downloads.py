"""The study's numbers at full precision, packed into the page, to be saved as CSV files.

A number is written with the fewest digits that read back as the same 64 bits. The page carries a file
deflated and in base64, which `tables.js` unpacks and saves.
"""

from __future__ import annotations

import base64
import csv
import io
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES, TIP_ERRORS
from schemas.tables import Table
from stages.report.comparison import Comparison
from stages.report.study_results import Row, StudyResults

MOST_BYTES = 1_500_000
"""What all files may add to the page; the scores of a hundred simulated subjects are more."""

COMPARISON_COLUMNS = (
    "metric",
    "table",
    "unit",
    "held_out",
    "digit",
    "model",
    "other",
    "n_subjects",
    "n_compared_subjects",
    "mean_difference",
    "median_difference",
    "lowest_difference",
    "highest_difference",
    "interval_95_low",
    "interval_95_high",
    "p",
    "p_holm",
    "n_comparisons",
    "effect_size",
    "n_better",
    "n_equal",
)
"""Differences are model - other, in `unit`; an empty digit is all digits."""

_ROWS_AT_ONCE = 2000
_FORMULA = re.compile(r"^[=+\-@\t\r]")
_PLAIN_NUMBER = re.compile(r"^[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?$")


@dataclass(frozen=True)
class Download:
    """One CSV file: its name, its rows without the header, and its bytes deflated, in base64."""

    name: str
    n_rows: int
    data: str


@dataclass(frozen=True)
class NotPacked:
    """A table that is too large for the page: its file among the results."""

    file: str
    n_rows: int


@dataclass(frozen=True)
class Downloads:
    """What the page offers, and what it leaves in the folder of the results."""

    files: tuple[Download, ...]
    not_packed: tuple[NotPacked, ...]


def downloads(results: StudyResults, comparisons: Sequence[Comparison]) -> Downloads:
    """Pack the comparisons, the scores, the joint errors and the tip errors, as many as MOST_BYTES hold."""
    files: list[Download] = []
    not_packed = []
    for name, columns, rows in (
        ("comparisons", COMPARISON_COLUMNS, [comparison_row(each) for each in comparisons]),
        (SKELETON_SCORES.name, _columns(SKELETON_SCORES), results.scores),
        (JOINT_ERRORS.name, _columns(JOINT_ERRORS), results.joint_errors),
        (TIP_ERRORS.name, _columns(TIP_ERRORS), results.tip_errors),
    ):
        file = packed(f"{name}.csv", rows, columns, MOST_BYTES - sum(len(each.data) for each in files))
        if file is None:
            not_packed.append(NotPacked(results.paths.study_table(name).name, len(rows)))
        elif rows:
            files.append(file)
    return Downloads(tuple(files), tuple(not_packed))


def _columns(table: Table) -> tuple[str, ...]:
    return tuple(column.name for column in table.columns)


def packed(
    name: str, rows: Sequence[Row], columns: Sequence[str], most_bytes: int = MOST_BYTES
) -> Download | None:
    """Pack rows as one CSV file; None as soon as it is seen to take more bytes than that."""
    deflated, n_bytes = [], 0
    press = zlib.compressobj(9)
    for text in _csv_in_parts(rows, columns):
        deflated.append(press.compress(text.encode()))
        n_bytes += len(deflated[-1])
        if _in_base64(n_bytes) > most_bytes:
            return None
    data = base64.b64encode(b"".join([*deflated, press.flush()])).decode("ascii")
    return Download(name, len(rows), data) if len(data) <= most_bytes else None


def _in_base64(n_bytes: int) -> int:
    return -(-n_bytes // 3) * 4


def csv_of(rows: Sequence[Row], columns: Sequence[str]) -> str:
    """Rows as CSV (RFC 4180), every column, a header first; null is empty, a truth value true or false.

    A text that a spreadsheet would take for a formula gets an apostrophe before it; a number never does.
    """
    return "".join(_csv_in_parts(rows, columns))


def _csv_in_parts(rows: Sequence[Row], columns: Sequence[str]) -> Iterator[str]:
    """The same, some rows at a time."""
    for start in range(0, max(len(rows), 1), _ROWS_AT_ONCE):
        out = io.StringIO(newline="")
        writer = csv.writer(out, lineterminator="\r\n")
        if start == 0:
            writer.writerow(columns)
        some = rows[start : start + _ROWS_AT_ONCE]
        writer.writerows(zip(*(_cells([row[name] for row in some]) for name in columns), strict=True))
        yield out.getvalue()


def comparison_row(comparison: Comparison) -> Row:
    """One comparison by COMPARISON_COLUMNS; null where there is no such number."""
    found = comparison.found
    low, high = (found.interval if found else None) or (None, None)
    known = (
        {
            "mean_difference": found.mean,
            "median_difference": found.median,
            "lowest_difference": found.lowest,
            "highest_difference": found.highest,
            "p": found.p,
            "effect_size": found.effect,
            "n_better": found.n_better,
            "n_equal": found.n_equal,
        }
        if found
        else {}
    )
    return (
        dict.fromkeys(COMPARISON_COLUMNS)
        | known
        | {
            "metric": comparison.metric.name,
            "table": comparison.metric.table,
            "unit": comparison.metric.unit,
            "held_out": comparison.held_out,
            "digit": comparison.digit,
            "model": comparison.model,
            "other": comparison.other,
            "n_subjects": len(comparison.subjects),
            "n_compared_subjects": len(comparison.compared),
            "interval_95_low": low,
            "interval_95_high": high,
            "p_holm": comparison.p_holm,
            "n_comparisons": comparison.n_compared,
        }
    )


def _cells(column: list[Any]) -> list[Any]:
    """A column's values as the CSV writer is to see them: it writes null and numbers as they should be."""
    words = {value: _cell(value) for value in {v for v in column if isinstance(v, (str, bool))}}
    return (
        [words[value] if isinstance(value, (str, bool)) else value for value in column] if words else column
    )


def _cell(value: str | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"'{value}" if _FORMULA.match(value) and not _PLAIN_NUMBER.match(value) else value
