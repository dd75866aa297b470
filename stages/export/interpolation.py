"""Positions and rotations between samples: linear, and by the shortest arc at constant angular velocity."""

from __future__ import annotations

import numpy as np

from skeleton.rotations import Array
from stages.export.motion import Bools, Whole


def bracketed(at: Array, x: Array) -> tuple[Whole, Whole, Array]:
    """Rows before and after each value of `at` in the growing x (n,), and how far it is between them, 0 to 1.

    Beyond either end both rows are that end's.
    """
    after = np.clip(np.searchsorted(x, at, side="right"), 1, max(len(x) - 1, 1))
    before, after = after - 1, np.minimum(after, len(x) - 1)
    width = x[after] - x[before]
    share = np.divide(at - x[before], width, out=np.zeros(len(at)), where=width > 0)
    return before, after, np.clip(share, 0.0, 1.0)


def blended(first: Array, second: Array, share: Array) -> Array:
    """Linear between (..., n) and (..., n) at shares (...) 0 to 1; at 0 and 1 exactly either end's value."""
    part = share[..., None]
    return np.where(part <= 0, first, np.where(part >= 1, second, first + part * (second - first)))


def slerped(first: Array, second: Array, share: Array) -> Array:
    """Unit quaternions (..., 4) on the shortest arc (Shoemake 1985) at shares (...) 0 to 1, constant speed.

    At 0 and 1 exactly either end's, so that a NaN beside a sample does not spoil it; signs as of the first.
    """
    cosine = np.sum(first * second, -1)
    near = np.where(cosine[..., None] < 0, -second, second)
    half = np.arctan2(np.linalg.norm(near - first, axis=-1), np.linalg.norm(near + first, axis=-1))
    arc = 2 * half
    sine = np.sin(arc)
    close: Bools = sine < 1e-9
    safe = np.where(close, 1.0, sine)
    left = np.where(close, 1 - share, np.sin((1 - share) * arc) / safe)
    right = np.where(close, share, np.sin(share * arc) / safe)
    mixed = left[..., None] * first + right[..., None] * near
    mixed = mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
    part = share[..., None]
    return np.where(part <= 0, first, np.where(part >= 1, near, mixed))
