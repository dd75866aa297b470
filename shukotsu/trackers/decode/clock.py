"""Device time: the frame counter is the clock, and the host's clock is fitted to it.

Bytes arrive late and never early, by a delay that varies with the operating system. The fitted line is the
one below all arrivals that is closest to them on average: an edge of their lower convex hull.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from shukotsu.trackers.protocols.records import Array, Wholes

SHORTEST_FIT_S = 30.0
"""Below this the delays' scatter moves the slope by more than a crystal is off (about 1e-4)."""

LARGEST_DRIFT = 2e-3
"""A device whose rate is farther from the nominal one than this does not run at that rate."""


@dataclass(frozen=True)
class DeviceClock:
    """time_s = (frame - first_frame) * period_s; the host's clock showed host_ns at 0.

    fitted : whether period_s was fitted to the host's clock, or is the nominal one.
    measured_rate_hz : frames a second by the host's clock, NaN where the recording is too short to tell.
    delay_ms : median delay of the arrivals against the fitted line.
    """

    first_frame: int
    period_s: float
    host_ns: int
    fitted: bool
    measured_rate_hz: float
    delay_ms: float

    def time_s(self, frame: Wholes) -> Array:
        """Device time of frames, (N,) in and out, s from the first frame."""
        return np.asarray((frame - self.first_frame) * self.period_s)


def fit_clock(frame: Wholes, host_ns: Wholes, rate_hz: float, first_frame: int) -> DeviceClock:
    """Fit the host's clock to the frame counter; time starts at `first_frame`.

    frame, host_ns : (N,) of arrivals, frames not falling; at least one.
    """
    host_first = int(host_ns[0])
    x, y = (frame - first_frame) / rate_hz, (host_ns - host_first).astype(float) * 1e-9
    slope, fitted, measured = 1.0, False, float("nan")
    if x[-1] - x[0] >= SHORTEST_FIT_S:
        slope = _slope_below(x, y)
        measured = rate_hz / slope if slope > 0 else float("nan")
        fitted = abs(slope - 1) <= LARGEST_DRIFT
    slope = slope if fitted else 1.0
    late = y - slope * x
    offset = float(late.min())
    return DeviceClock(
        first_frame,
        slope / rate_hz,
        host_first + round(offset * 1e9),
        fitted,
        measured,
        float(np.median(late - offset) * 1e3),
    )


def _slope_below(x: Array, y: Array) -> float:
    """Slope of the line below all points with the least mean distance, x ascending, (N,) each."""
    hull: list[int] = []
    late = y - x
    second = np.floor(x).astype(np.int64)  # of each only the least late can be an edge that matters
    edges = np.flatnonzero(np.diff(second, prepend=second[0] - 1)).tolist()
    for start, stop in itertools.pairwise([*edges, len(x)]):
        point = int(start + np.argmin(late[start:stop]))
        while len(hull) >= 2 and _above(x, y, hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    right = max(1, int(np.searchsorted(x[hull], x.mean())))
    a, b = hull[right - 1], hull[right]
    return float((y[b] - y[a]) / (x[b] - x[a]))


def _above(x: Array, y: Array, a: int, b: int, c: int) -> bool:
    """Whether point b lies on or above the line from a to c."""
    return bool((y[b] - y[a]) * (x[c] - x[a]) >= (y[c] - y[a]) * (x[b] - x[a]))
