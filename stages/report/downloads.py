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
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from shukotsu.schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, JOINT_ERRORS, SKELETON_SCORES, TIP_ERRORS
from shukotsu.schemas.model_tables import MODEL_DIFFERENCES
from shukotsu.schemas.tables import Table
from shukotsu.stages.report.study_results import Row, StudyResults

MOST_BYTES = 1_500_000
"""What all files may add to the page; the scores of a hundred simulated subjects are more."""

_FORMULA = re.compile(r"^[=+\-@\t\r]")
_PLAIN_NUMBER = re.compile(r"^[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?$")


@dataclass(frozen=True)
class Download:
    """One CSV file: its name, its rows without the header, and its bytes deflated, in base64."""

    name: str
    n_rows: int
    data: str


@dataclass(frozen=True)
class Downloads:
    """Hold the page's files, and the tables that are too large for it: their files' names and rows."""

    files: tuple[Download, ...]
    not_packed: tuple[tuple[str, int], ...]


def downloads(results: StudyResults) -> Downloads:
    """Pack comparisons, scores, errors, bone lengths and joint centres, as many as MOST_BYTES hold."""
    compared = [row for row in results.model_differences if row["baseline"]]
    files: list[Download] = []
    not_packed = []
    for name, columns, rows in (
        (MODEL_DIFFERENCES.name, _columns(MODEL_DIFFERENCES), compared),
        (SKELETON_SCORES.name, _columns(SKELETON_SCORES), results.scores),
        (JOINT_ERRORS.name, _columns(JOINT_ERRORS), results.joint_errors),
        (TIP_ERRORS.name, _columns(TIP_ERRORS), results.tip_errors),
        (BONE_LENGTHS.name, _columns(BONE_LENGTHS), results.bones),
        (JOINT_CENTRES.name, _columns(JOINT_CENTRES), results.joints),
    ):
        if not rows:
            continue
        file = packed(f"{name}.csv", rows, columns, MOST_BYTES - sum(len(each.data) for each in files))
        if file is None:
            not_packed.append((results.paths.study_table(name).name, len(rows)))
        else:
            files.append(file)
    return Downloads(tuple(files), tuple(not_packed))


def _columns(table: Table) -> tuple[str, ...]:
    """Those of a table that are one value a row; a covariance is none, and a message is its sentence."""
    names = (column.name for column in table.columns if not pa.types.is_nested(column.type))
    return tuple(name for name in names if name != "message_values")


def packed(
    name: str, rows: Sequence[Row], columns: Sequence[str], most_bytes: int = MOST_BYTES
) -> Download | None:
    """Pack rows as one CSV file; None where it takes more bytes than that."""
    data = base64.b64encode(zlib.compress(csv_of(rows, columns).encode(), 9)).decode("ascii")
    return Download(name, len(rows), data) if len(data) <= most_bytes else None


def csv_of(rows: Sequence[Row], columns: Sequence[str]) -> str:
    """Rows as CSV (RFC 4180), every column, a header first; null is empty, a truth value true or false.

    A text that a spreadsheet would take for a formula gets an apostrophe before it; a number never does.
    """
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(columns)
    writer.writerows([_cell(row[name]) for name in columns] for row in rows)
    return out.getvalue()


def _cell(value: Any) -> Any:
    """A value as the CSV writer is to see it: it writes null and numbers as they should be."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str) and _FORMULA.match(value) and not _PLAIN_NUMBER.match(value):
        return f"'{value}"
    return value
