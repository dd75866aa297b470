"""Directions and frames that a tracker says are set, compared as far as its rounding allows."""

from __future__ import annotations

import math
from collections.abc import Sequence

LEAST_COSINE = 0.9999


def same_direction(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two vectors point the same way, to 0.8 degrees; never where one has no length."""
    lengths = math.hypot(*a) * math.hypot(*b)
    return lengths > 0 and sum(x * y for x, y in zip(a, b, strict=True)) / lengths > LEAST_COSINE


def is_zero(values: Sequence[float]) -> bool:
    """Whether an offset or a rotation is none."""
    return all(abs(value) < 1e-4 for value in values)


def is_default_alignment(values: Sequence[float]) -> bool:
    """Whether an alignment (origin, a point on x, one on y: 9 numbers) is the transmitter's own frame.

    The points may be at any distance: it differs between trackers and with the unit.
    """
    along_x, along_y = same_direction(values[3:6], (1, 0, 0)), same_direction(values[6:9], (0, 1, 0))
    return math.hypot(*values[:3]) < 1e-3 and along_x and along_y
