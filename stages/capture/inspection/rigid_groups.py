"""Find markers that keep their distances: groups of three or more that ride on one segment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from shukotsu.skeleton.rotations import Array

RIGID_VARIATION = 0.02
"""Each distance in a group varies (interquartile) by less than this share of it, and of what the two move."""
_FRAMES, _MARKERS = 300, 200


def rigid_groups(points: Array, labels: Sequence[str]) -> dict[str, list[int]]:
    """Group markers of which all distances keep still while others change.

    points : (T, P, 3), NaN where a marker is not seen. Returns a group's first label, and its indices.
    There are none of markers that keep still, and none where there are too many markers.
    """
    if not 3 <= len(labels) <= _MARKERS:
        return {}
    points = points[:: max(1, len(points) // _FRAMES)]
    first, second = np.triu_indices(len(labels), 1)
    distance = np.linalg.norm(points[:, first] - points[:, second], axis=-1)
    seen = np.flatnonzero(np.isfinite(distance).mean(0) > 0.1)
    if not len(seen):
        return {}
    low, middle, high = np.nanpercentile(distance[:, seen], [25, 50, 75], axis=0)
    moved = np.full(len(labels), 0.0)
    for index in np.unique([first[seen], second[seen]]):
        moved[index] = np.subtract(*np.nanpercentile(points[:, index], [75, 25], axis=0)).max()
    least = np.minimum(middle, 5 * np.minimum(moved[first[seen]], moved[second[seen]]))
    variation = np.full(len(first), 1e9)
    variation[seen] = (high - low) / np.maximum(least, 1e-12)
    group = fcluster(linkage(variation, "complete"), RIGID_VARIATION, "distance")
    found = [np.flatnonzero(group == number).tolist() for number in range(1, group.max() + 1)]
    found = sorted(own for own in found if len(own) >= 3)
    return {labels[own[0]]: own for own in found}
