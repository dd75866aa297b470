"""Which frames to fit: those that together show the widest spread of postures."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array

Index = npt.NDArray[np.int64]

MOST_CANDIDATES = 1500
"""More neighbouring frames than this are the same posture again."""


def spread_frames(postures: Array, n_frames: int) -> tuple[Index, Array]:
    """Choose frames by farthest point: each next one is the farthest from all before it (Gonzalez 1985).

    postures : (T, D) features of a frame, equally scaled; begins with the one farthest from their mean.
    Returns the rows in the order of time and (n,) the share of all frames that are nearest to each.
    """
    step = max(1, len(postures) // MOST_CANDIDATES)
    candidates = postures[::step]
    distance = ((candidates - candidates.mean(0)) ** 2).sum(1)
    chosen = [int(np.argmax(distance))]
    nearest: Index = np.zeros(len(candidates), int)
    distance = ((candidates - candidates[chosen[0]]) ** 2).sum(1)
    while len(chosen) < min(n_frames, len(candidates)) and distance.max() > 0.0:
        chosen.append(int(np.argmax(distance)))
        other = ((candidates - candidates[chosen[-1]]) ** 2).sum(1)
        closer = other < distance
        nearest[closer] = len(chosen) - 1
        distance = np.where(closer, other, distance)
    share = np.bincount(nearest, minlength=len(chosen)) / len(candidates)
    order = np.argsort(chosen)
    return np.array(chosen)[order] * step, share[order]
