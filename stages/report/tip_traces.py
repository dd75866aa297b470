"""Tip error over time, thinned to what a picture can show: the smallest and largest of each pixel column.

The table of tips is streamed: only one digit's series is in memory at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schemas.catalogue import TIPS
from schemas.errors import InputError
from schemas.tables import open_table, read_metadata

Array = npt.NDArray[np.float64]

COLUMNS = 240
_KEY = ("subject", "hand", "task", "trial", "model", "digit")
_BATCH_ROWS = 1 << 17
# A step between valid samples longer than this many usual steps is a gap: one missing frame makes it 2.
_GAP_STEPS = 1.9


@dataclass(frozen=True)
class Trace:
    """One digit's tip error in at most COLUMNS columns, C of them occupied.

    x : (C,) time in s or frame number at the column's first sample; low_mm, high_mm : (C,); rises : (C,)
    whether the low comes first; broken : (C,) whether a gap lies before the column. span : first and last
    x of the recording, gaps included. median_mm is of all valid frames.
    """

    x: Array
    low_mm: Array
    high_mm: Array
    rises: npt.NDArray[np.bool_]
    broken: npt.NDArray[np.bool_]
    span: tuple[float, float]
    in_seconds: bool
    median_mm: float


def read_traces(path: Path) -> dict[tuple[str, ...], Trace]:
    """Read the tips table: traces by subject, hand, task, trial, model and digit.

    A digit without any error has no trace. Raises InputError where the file is no tips table or the rows
    of a digit do not stand together.
    """
    if path.is_file() and "failure" in read_metadata(path):
        return {}
    traces: dict[tuple[str, ...], Trace] = {}
    seen: set[tuple[str, ...]] = set()
    for key, numbers in _series(path):
        if key in seen:
            raise InputError(f"{path}: rows of {', '.join(key)} do not stand together; make the file again")
        seen.add(key)
        trace = thin(*numbers)
        if trace is not None:
            traces[key] = trace
    return traces


def thin(frame: Array, time_s: Array, error_mm: Array, columns: int = COLUMNS) -> Trace | None:
    """Thin one series (each of shape (n,), NaN where there is nothing); None where no error is valid."""
    in_seconds = bool(np.isfinite(time_s).all())
    x = time_s if in_seconds else frame
    valid = np.isfinite(error_mm)
    if not valid.any():
        return None
    span = float(x.min()), float(x.max())
    width = (span[1] - span[0]) / columns or 1.0
    usual_step = float(np.median(np.diff(x))) if len(x) > 1 else 0.0
    kept_x, kept = x[valid], error_mm[valid]
    column = np.minimum(((kept_x - span[0]) / width).astype(int), columns - 1)
    first = np.flatnonzero(np.diff(column, prepend=-1))
    last = np.append(first[1:], len(kept)) - 1
    step = np.diff(kept_x, prepend=kept_x[0])[first]
    return Trace(
        x=kept_x[first],
        low_mm=np.minimum.reduceat(kept, first),
        high_mm=np.maximum.reduceat(kept, first),
        rises=kept[first] <= kept[last],
        broken=step > max(_GAP_STEPS * usual_step, 1.5 * width if len(kept) > columns else 0.0),
        span=span,
        in_seconds=in_seconds,
        median_mm=float(np.median(kept)),
    )


def _series(path: Path) -> Iterator[tuple[tuple[str, ...], tuple[Array, Array, Array]]]:
    """Each digit's frame, time_s and error_mm, joined over the batches that they stand in."""
    key: tuple[str, ...] | None = None
    parts: list[Array] = []
    with open_table(path, TIPS) as file:
        for batch in file.iter_batches(_BATCH_ROWS, columns=[*_KEY, "frame", "time_s", "error_mm"]):
            for own_key, part in _runs(batch):
                if own_key != key and key is not None:
                    yield key, _joined(parts)
                    parts = []
                key = own_key
                parts.append(part)
    if key is not None:
        yield key, _joined(parts)


def _runs(batch: pa.RecordBatch) -> Iterator[tuple[tuple[str, ...], Array]]:
    """Stretches of rows with one key: the key and the numbers, shape (3, n)."""
    codes = [batch.column(name).dictionary_encode() for name in _KEY]
    changes = np.zeros(batch.num_rows, bool)
    for code in codes:
        changes |= np.diff(code.indices.to_numpy(), prepend=-1) != 0
    starts = np.flatnonzero(changes)
    numbers = np.stack(
        [
            batch.column(name).to_numpy(zero_copy_only=False).astype(float)
            for name in ("frame", "time_s", "error_mm")
        ]
    )
    for start, end in zip(starts, [*starts[1:], batch.num_rows], strict=True):
        key = tuple(code.dictionary[code.indices[int(start)].as_py()].as_py() for code in codes)
        yield key, numbers[:, start:end]


def _joined(parts: list[Array]) -> tuple[Array, Array, Array]:
    frame, time_s, error_mm = np.concatenate(parts, axis=1)
    return frame, time_s, error_mm
