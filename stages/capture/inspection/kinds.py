"""Which kind of file it is, and so who looks at it."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

from schemas.errors import InputError
from schemas.layout import Layout
from stages.capture.formats.readers import AUTO, find_reader
from stages.capture.inspection.findings import Findings
from stages.capture.samples import ReadingOptions


def look(path: Path, layout: Layout) -> Findings:
    """Say what is in a file or folder. Raises InputError where it is absent, empty or of no known kind."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path}: is empty; expected a recording")
    name = path.name.lower()
    if path.is_dir():
        return _matrices(path)
    if name.endswith(".c3d"):
        from stages.capture.inspection.c3d_files import look_at_c3d

        return look_at_c3d(path, layout)
    if name.endswith((".parquet", ".pq")):
        from stages.capture.inspection.own_tables import look_at_parquet

        return look_at_parquet(path, layout)
    if name.endswith(".arrows"):
        return _capture(path)
    if name.endswith("_motion.tsv"):
        return _self_described(path, "motion_bids", "tracked point", layout)
    if name.endswith((".xdf", ".xdfz")):
        return _self_described(path, "xdf", "marker or object", layout)
    return _text(path, layout)


def _text(path: Path, layout: Layout) -> Findings:
    from stages.capture.inspection.own_tables import is_tidy, look_at_tidy_csv
    from stages.capture.inspection.tables import look_at_table

    if is_tidy(path):
        return look_at_tidy_csv(path, layout)
    return _matrices(path) if _like_matrices(path) else look_at_table(path, layout)


def _like_matrices(path: Path) -> bool:
    """Whether the first line that is not empty is four numbers, or sixteen that end as a pose does."""
    with path.open("rb") as stream:
        words = next((line.split() for line in stream if line.strip()), [])
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return False
    return len(numbers) == 4 or (len(numbers) == 16 and numbers[12:] == [0, 0, 0, 1])


def _matrices(path: Path) -> Findings:
    from stages.capture.inspection.matrix_files import look_at_matrices

    return look_at_matrices(path)


def _capture(path: Path) -> Findings:
    from stages.capture.decode.findings import describe

    return Findings(tuple(describe(path)))


def _self_described(path: Path, module: str, what: str, layout: Layout) -> Findings:
    """Say what such a file says of itself; a mapping is drafted where the file cannot be read without."""
    reader = importlib.import_module(f"stages.capture.formats.{module}")
    if _reads_without_mapping(path, layout):
        told = f"every {what} is a segment of layout {layout.name}: needs no mapping"
        return Findings((*reader.describe(path), told))
    draft: dict[str, Any] = reader.draft_mapping(path)
    head = [
        f"# Drafted from {path.name}, which says its units itself. Each name under receivers must be",
        "# a segment of the layout: correct it, or take the receiver out. Check the rest as well.",
    ]
    body = [f"{key}: {_json(value)}" for key, value in draft.items() if key != "receivers"]
    body += ["receivers:", *(f"  {segment}: {_json(told)}" for segment, told in draft["receivers"].items())]
    return Findings(tuple(reader.describe(path)), "\n".join([*head, *body]) + "\n")


def _reads_without_mapping(path: Path, layout: Layout) -> bool:
    try:
        find_reader(path, AUTO)(path, layout, ReadingOptions())
    except InputError:
        return False
    return True


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
