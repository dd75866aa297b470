"""What channels.tsv, channels.json and motion.json say of the columns of a `*_motion.tsv` that is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schemas.bids.decimals import text_of

FRAME_OF_REFERENCE = "transmitter"

OWN_KEY = "Shukotsu"
"""The key of motion.json under which an exporter says what BIDS has no key for."""

TYPES = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL")


@dataclass(frozen=True)
class Column:
    """A column of motion.tsv as text, null where there is no value, and its row of channels.tsv."""

    text: pa.Array
    name: str
    component: str
    type: str
    tracked_point: str
    units: str
    description: str
    status: str = "good"
    status_description: str = "n/a"

    @property
    def row(self) -> dict[str, str]:
        """The row of channels.tsv."""
        posed = self.type in ("POS", "ORNT")
        return {
            "name": self.name,
            "component": self.component,
            "type": self.type,
            "tracked_point": self.tracked_point,
            "units": self.units,
            "placement": self.tracked_point,
            "reference_frame": FRAME_OF_REFERENCE if posed else "n/a",
            "description": self.description,
            "status": self.status,
            "status_description": self.status_description,
        }


def frame_column(frame: npt.NDArray[np.int64]) -> Column:
    """The tracker's frame numbers, shape (T,)."""
    text = pa.array(frame).cast(pa.string())
    return Column(text, "frame", "n/a", "MISC", "n/a", "n/a", "frame number of the tracker")


def time_columns(
    time_s: npt.NDArray[np.float64], start_s: float, prefix: str = "", point: str = "n/a"
) -> Iterator[Column]:
    """LATENCY as BIDS wants it, to a microsecond from start_s, and the device's own time in all its digits.

    time_s : (T,), NaN where there is none. Nothing where start_s is NaN. prefix, point : of a tracked point
    with times of its own.
    """
    if not np.isfinite(start_s):
        return
    latency = [f"{value:.6f}" if np.isfinite(value) else None for value in time_s - start_s]
    what = "time since the first sample"
    yield Column(pa.array(latency, pa.string()), f"{prefix}latency", "n/a", "LATENCY", point, "s", what)
    yield Column(text_of(time_s), f"{prefix}time", "n/a", "MISC", point, "s", "time of the tracker")


def channel_counts(columns: Sequence[Column]) -> dict[str, int]:
    """Channels in all and of each type, as motion.json counts them."""
    types = [column.type for column in columns]
    return {"MotionChannelCount": len(types)} | {f"{kind}ChannelCount": types.count(kind) for kind in TYPES}


def channels_json() -> dict[str, Any]:
    """The content of channels.json: what the reference frame is, as far as poses alone can tell."""
    return {
        "reference_frame": {
            "Description": "The frame that positions and orientations are given in.",
            "Levels": {
                FRAME_OF_REFERENCE: {
                    "SpatialAxes": "n/a",
                    "RotationRule": "right-hand",
                    "RotationOrder": "n/a",
                    "Description": "The transmitter's own frame, right-handed. Orientations are unit "
                    "quaternions that take coordinates of the receiver to this frame. How the frame lies in "
                    "the room or to the subject is not recorded.",
                }
            },
        }
    }
