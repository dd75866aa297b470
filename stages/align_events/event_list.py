"""Events as every reader gives them, and those of the study's own sheet."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

FARTHEST_S = 1e11
"""Three thousand years: a time beyond it is a damaged one."""


class Clock(Enum):
    """Whose clock the times of events are on."""

    RECORDING = "the recording's time_s"
    START = "the recording's, counted from its first time"
    OWN = "the device's own"


@dataclass(frozen=True)
class Events:
    """N events in the order of their file. time_s, duration_s, value : (N,), NaN where nothing says so.

    sd_s : (N,) 1-sigma error of a time on its own clock, 0 where it is not known. channel : (N,) of MIDI,
    from 1; 0 elsewhere. notes : what a reader of the table should know of the file, a sentence each.
    """

    source: str
    clock: Clock
    names: tuple[str, ...]
    time_s: Array
    duration_s: Array
    value: Array
    sd_s: Array
    channel: npt.NDArray[np.int64]
    notes: tuple[str, ...] = field(default=())

    @classmethod
    def of(cls, source: str, clock: Clock, rows: Iterable[Sequence[Any]], *notes: str) -> Events:
        """Put events together from rows of name, time_s, duration_s, value[, sd_s[, channel]]."""
        whole = [(*row, *(0.0, 0)[len(row) - 4 :]) for row in rows]
        time_s, duration_s, value, sd_s, channel = (
            np.array([row[place] for row in whole], float) for place in range(1, 6)
        )
        names = tuple(str(row[0]) for row in whole)
        return cls(source, clock, names, time_s, duration_s, value, sd_s, channel.astype(np.int64), notes)

    def __len__(self) -> int:
        return len(self.names)

    def named(self, name: str) -> npt.NDArray[np.bool_]:
        """Tell whether an event has that name, shape (N,)."""
        return np.array([own == name for own in self.names], bool)


def events_of_rows(rows: Iterable[Mapping[str, Any]]) -> Events:
    """Give the events of a recording's rows of the study's sheet: onset_s is on the recording's clock.

    A row may have name, duration_s and value; a null is as good as none.
    """
    return Events.of(
        "sheet",
        Clock.RECORDING,
        (
            (
                row.get("name") or "event",
                row["onset_s"],
                *(_or_nan(row.get(k)) for k in ("duration_s", "value")),
            )
            for row in rows
        ),
    )


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value
