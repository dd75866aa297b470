"""The body of a binary record: its output items as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

from stages.capture.trackers.liberty.items import ITEMS, record_bytes
from stages.capture.trackers.numbers import fill_in
from stages.capture.trackers.records import Records, empty_records


@cache
def record_type(items: tuple[int, ...]) -> np.dtype[np.void]:
    """Give the NumPy type of a whole binary record; an item that is given twice keeps its first numbers."""
    fields: list[tuple[str, str]] = [("header", "V2"), ("station", "u1"), ("command", "u1")]
    fields += [("error", "u1"), ("reserved", "u1"), ("size", "<i2")]
    seen: set[str] = set()
    for place, item in enumerate(items):
        for name in ITEMS[item].fields:
            fields.append((f"{name}_{place}" if name in seen else name, f"<{ITEMS[item].kind}"))
            seen.add(name)
    return np.dtype(fields)


def read_bodies(
    b: npt.NDArray[np.uint8],
    at: npt.NDArray[np.int64],
    items: Sequence[int],
    mm_per_unit: float,
    offset: int = 0,
) -> Records:
    """Read N records of one output list that start at bytes `at` of `b`; `offset` is that of b's first byte.

    Nothing is checked but what cannot be right: see `Records.doubtful`.
    """
    kind = record_type(tuple(items))
    size = record_bytes(items)
    if len(at) > 1 and (np.diff(at) == size).all():
        rows = b[at[0] : at[-1] + size].view(kind)
    else:
        rows = np.lib.stride_tricks.sliding_window_view(b, size)[at].view(kind)[:, 0]
    records = empty_records(len(at))
    records.offset[:] = at + offset
    records.size[:] = size
    records.station[:] = rows["station"]
    records.error[:] = np.where(rows["error"] == ord(" "), 0, rows["error"])
    fill_in(records, {name: rows[name] for name in kind.names or ()}, mm_per_unit)
    return records
