"""Events as every reader gives them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FARTHEST_S = 1e11
"""Three thousand years: a time beyond it is a damaged one."""


@dataclass(frozen=True)
class Events:
    """N events in the order of their file. time_s, duration_s, value : (N,), NaN where nothing says so.

    own_clock : whether times are of the device's clock, not of the recording's time_s. sd_s : (N,) 1-sigma
    error of a time on that clock, 0 where it is not known. channel : (N,) of MIDI, from 1; 0 elsewhere.
    notes : what a reader of the table should know of the file, a sentence each.
    """

    source: str
    own_clock: bool
    names: tuple[str, ...]
    time_s: Array
    duration_s: Array
    value: Array
    sd_s: Array
    channel: npt.NDArray[np.int64]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, source: str, own_clock: bool, rows: Iterable[Sequence[Any]], *notes: str) -> Events:
        """Put events together from rows of name, time_s, duration_s, value[, sd_s[, channel]]."""
        whole = [(*row, *(0.0, 0)[len(row) - 4 :]) for row in rows]
        time_s, duration_s, value, sd_s, channel = (
            np.array([row[column] for row in whole], float) for column in range(1, 6)
        )
        names = tuple(str(row[0]) for row in whole)
        return cls(source, own_clock, names, time_s, duration_s, value, sd_s, channel.astype(np.int64), notes)

    def named(self, name: str) -> npt.NDArray[np.bool_]:
        """Whether an event has that name, shape (N,)."""
        return np.array([each == name for each in self.names], bool)
