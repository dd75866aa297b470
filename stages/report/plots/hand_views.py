"""Project a posed hand as seen from its back and, beside that, from its thumb's side.

Positions are in the view's axes: right, up (distal) and towards the viewer (dorsal), mm, as `hand_motion`
gives them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.stages.report.hand_motion import Chain, DrawnPoint
from shukotsu.stages.report.palette import Look, digit_looks

Array = npt.NDArray[np.float64]

GUTTER_MM, BAR_MM = 10.0, 20.0
_PAD_MM = 14.0
_NEAR_MM = 45.0
"""A joint farther than this from the box around the receivers is a gross failure: it must not shrink the
rest.
"""


@dataclass(frozen=True)
class Window:
    """A picture's extent: the box around receivers and plausible joints, corners (3,), mm."""

    low_mm: Array
    high_mm: Array

    @property
    def size_mm(self) -> Array:
        """Extent along right, up and towards the viewer."""
        return np.asarray(self.high_mm - self.low_mm)

    @property
    def width_mm(self) -> float:
        """Both views side by side."""
        return float(self.size_mm[0] + GUTTER_MM + self.size_mm[2])

    def holds(self, point: DrawnPoint) -> bool:
        """Tell whether the point is inside."""
        return bool((point.position_mm >= self.low_mm).all() and (point.position_mm <= self.high_mm).all())


@dataclass(frozen=True)
class View:
    """One projection: from the back (right and up), or beside it from the side (dorsal and up).

    Its places are (x, y) from the lower left corner of both views, y upward, mm.
    """

    window: Window
    kind: str
    hand: str

    @property
    def left(self) -> float:
        """Return the view's left edge, mm."""
        return 0.0 if self.kind == "back" else float(self.window.size_mm[0]) + GUTTER_MM

    @property
    def width(self) -> float:
        """Return the view's width, mm."""
        return float(self.window.size_mm[0 if self.kind == "back" else 2])

    @property
    def height(self) -> float:
        """Return the height of both views, mm."""
        return float(self.window.size_mm[1])

    def places(self, position_mm: Array) -> Array:
        """Places (..., 2) of positions (..., 3)."""
        low, high = self.window.low_mm, self.window.high_mm
        up = position_mm[..., 1] - low[1]
        if self.kind == "back":
            return np.stack([position_mm[..., 0] - low[0], up], axis=-1)
        dorsal = position_mm[..., 2] - low[2] if self.hand == "right" else high[2] - position_mm[..., 2]
        return np.stack([self.left + dorsal, up], axis=-1)

    def chain(self, chain: Chain) -> Array:
        """Places (n, 2) of a digit's points, NaN where one has none."""
        nowhere = np.full(3, np.nan)
        return self.places(np.array([nowhere if p is None else p.position_mm for p in chain.points]))


def views_of(window: Window, hand: str) -> tuple[View, View]:
    """The view from the back and that from the side."""
    return View(window, "back", hand), View(window, "side", hand)


def window_of(receivers_mm: Array, chains: Sequence[Chain]) -> Window:
    """The window for a hand: its receivers (n, 3) and every joint of any model that is near them."""
    low, high = receivers_mm.min(axis=0), receivers_mm.max(axis=0)
    joints = [point.position_mm for chain in chains for point in chain.points if point is not None]
    near = [p for p in joints if (p >= low - _NEAR_MM).all() and (p <= high + _NEAR_MM).all()]
    everything = np.concatenate([receivers_mm, np.reshape(near, (-1, 3))])
    return Window(everything.min(axis=0) - _PAD_MM, everything.max(axis=0) + _PAD_MM)


def looks_of_points(chains: Sequence[Chain]) -> list[tuple[DrawnPoint, Look | None]]:
    """Every point that has a place, once, with the look of its digit; None where several digits share it."""
    looks = digit_looks([chain.digit for chain in chains])
    points: dict[str, tuple[DrawnPoint, Look | None]] = {}
    for chain in chains:
        for point in filter(None, chain.points):
            points[point.name] = (point, None if point.name in points else looks[chain.digit])
    return list(points.values())
