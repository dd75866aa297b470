"""Dots side by side: every subject of a row is seen, none hides another while there is room."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def swarm(x: Array, diameter: float, most_lanes: int) -> tuple[Array, int, int]:
    """How far dots at x (n,) (pixels) are moved across the row so that none overlaps.

    Gives the offsets (n,) from the middle, in pixels; how many lanes are used, which is odd; how many dots
    overlap others because all of `most_lanes` lanes were taken. The same x give the same offsets.
    """
    ends = [-math.inf] * most_lanes
    lanes = np.zeros(len(x), int)
    overlapping = 0
    for index in np.argsort(x, kind="stable").tolist():
        here = float(x[index])
        lane = next((lane for lane, end in enumerate(ends) if here - end >= diameter), -1)
        if lane < 0:
            overlapping += 1
            lane = ends.index(min(ends))
        ends[lane] = here
        lanes[index] = lane
    steps = (lanes + 1) // 2 * np.where(lanes % 2, -1, 1)  # 0, -1, 1, -2, 2: from the middle outward
    n_lanes = 2 * int(np.abs(steps).max(initial=0)) + 1
    return steps * diameter, n_lanes, overlapping


def dots(x: Array, y: Array) -> str:
    """The path of dots at x, y (n,): lines of no length, whose round caps are the dots; from left to right.

    A tenth of a pixel is the least that it tells apart. It takes some eight bytes a dot.
    """
    order = np.lexsort((y, x))
    places = np.rint(np.stack([x, y], -1)[order] * 10).astype(int)
    steps = np.diff(places, axis=0, prepend=np.zeros((1, 2), int))
    return "".join(f"m{_short(dx)}{'' if dy < 0 else ' '}{_short(dy)}h0" for dx, dy in steps.tolist())


def _short(tenths: int) -> str:
    text = f"{tenths / 10:g}"
    return text.replace("0.", ".", 1) if abs(tenths) < 10 and tenths else text
