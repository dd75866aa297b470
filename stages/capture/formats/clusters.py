"""Marker clusters as rigid bodies: their mean shape, and the pose of that shape in every frame.

The shape is a generalised Procrustes mean (Gower 1975) without scaling, with markers missing here and there;
a frame's pose is the least-squares fit of the shape to the markers that it has (Kabsch 1976).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.skeleton.rotations import Array, nearest_rotation

THINNEST = 0.05
"""Markers whose width is less than this share of their length are on a line: the turn about it is noise."""

_ROUNDS = 100
_SETTLED_MM = 1e-5

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class ClusterPoses:
    """The poses of one cluster of M markers in T frames, NaN where too few markers are seen.

    rotation : (T, 3, 3) cluster to laboratory; position_mm : (T, 3) of the first marker, as fitted.
    shape_mm : (M, 3) the markers in the cluster's frame: the first is the origin, x runs to the second,
    the third is in the plane of x and y, on the side of +y. residual_mm : (T, M) distance of each marker
    from its fit, NaN where it is not seen; misfit_mm : (T,) its rms.
    """

    rotation: Array
    position_mm: Array
    shape_mm: Array
    residual_mm: Array

    @property
    def misfit_mm(self) -> Array:
        """Rms distance of each frame's markers from the shape, (T,); NaN where there is no pose."""
        seen = np.isfinite(self.residual_mm)
        square = np.where(seen, self.residual_mm, 0.0) ** 2
        return np.asarray(np.sqrt(square.sum(1) / np.where(seen.any(1), seen.sum(1), np.nan)))


def cluster_poses(markers_mm: Array, what: str) -> ClusterPoses:
    """Fit one rigid shape to a cluster's markers and give its pose in every frame.

    markers_mm : (T, M, 3) in the laboratory frame, NaN where a marker is not seen; M >= 3. A frame needs
    three markers that are not on a line. Raises InputError, beginning with `what`, where no frame has
    them, where a marker cannot be placed beside the others, or where the cluster is a line.
    """
    seen: Bools = np.asarray(np.isfinite(markers_mm).all(-1))
    shape = _local(_mean_shape(np.where(seen[..., None], markers_mm, 0.0), seen, what), what)
    fits = seen & _spread_out(shape, seen)[:, None]
    points = np.where(fits[..., None], markers_mm, 0.0)
    rotation, position = _fit(shape, points, fits.astype(float))
    left = np.linalg.norm(points - (shape @ np.swapaxes(rotation, 1, 2) + position[:, None]), axis=-1)
    posed = fits.any(1)
    rotation[~posed] = np.nan
    position[~posed] = np.nan
    return ClusterPoses(rotation, position, shape, np.where(fits, left, np.nan))


def _mean_shape(points: Array, seen: Bools, what: str) -> Array:
    """Mean of all frames laid onto each other, shape (M, 3), in the laboratory pose of one frame.

    It grows from the frame with most markers; frames far off it (markers swapped) weigh less.
    """
    start = int(np.argmax(seen.sum(1)))
    shape: Array = points[start]
    known: Bools = seen[start]
    if known.sum() < 3:
        raise InputError(f"{what}: no frame has three of its markers; check the labels and the frames read")
    if _width(shape[known]) < THINNEST:
        raise InputError(
            f"{what}: its markers are on a line (within {THINNEST} of its length), so the turn about "
            "that line is not known; add a marker beside it"
        )
    for _ in range(_ROUNDS):
        usable = seen & known & _spread_out(shape, seen & known)[:, None]
        if not usable.any():
            raise InputError(f"{what}: its markers keep no shape in common over the frames read")
        rotation, position = _fit(shape, points, usable.astype(float))
        back = (points - position[:, None]) @ rotation
        square = np.where(usable, ((back - shape) ** 2).sum(-1), 0.0).sum(1)
        posed = usable.any(1)
        misfit = square / np.maximum(usable.sum(1), 1)
        scale = (
            9 * float(np.median(misfit[posed])) + _SETTLED_MM**2
        )  # half where it is three times the median
        weight = np.where(posed, 1 / (1 + misfit / scale), 0.0)[:, None] * seen
        reached = weight.sum(0) > 0
        mean = np.einsum("tm,tmi->mi", weight, back) / np.where(reached, weight.sum(0), 1.0)[:, None]
        settled = bool((reached == known).all()) and float(np.abs(mean - shape).max()) < _SETTLED_MM
        shape, known = np.where(reached[:, None], mean, shape), reached
        if settled:
            break
    if not known.all():
        raise InputError(
            f"{what}: marker {int(np.argmin(known)) + 1} of it is never seen with three others of known "
            "place; leave it out of the mapping"
        )
    return shape


def _fit(shape: Array, points: Array, weight: Array) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) and translations (T, 3) that lay the shape (M, 3) on the points (T, M, 3)."""
    total = np.maximum(weight.sum(1), 1.0)[:, None]
    middle, centre = weight @ shape / total, np.einsum("tm,tmi->ti", weight, points) / total
    spread = np.einsum("tm,tmi,tmj->tij", weight, points - centre[:, None], shape - middle[:, None])
    rotation = nearest_rotation(spread)
    return rotation, centre - np.einsum("tij,tj->ti", rotation, middle)


def _spread_out(shape: Array, seen: Bools) -> Bools:
    """Return whether the markers that a frame sees, of those known, fix a rotation, shape (T,)."""
    patterns, codes = np.unique(seen, axis=0, return_inverse=True)
    good = [pattern.sum() >= 3 and _width(shape[pattern]) >= THINNEST for pattern in patterns]
    return np.asarray(np.array(good)[codes.ravel()], bool)


def _width(points: Array) -> float:
    """Width over length of points (M, 3): 0 where they are on a line."""
    length, width = np.linalg.svd(points - points.mean(0), compute_uv=False)[:2]
    return float(width / length) if length > 0 else 0.0


def _local(shape: Array, what: str) -> Array:
    """The shape in its own frame: first marker the origin, second on x, third in the plane of x and y."""
    along, across = shape[1] - shape[0], shape[2] - shape[0]
    if _width(shape[:3]) < THINNEST:
        raise InputError(
            f"{what}: its first three markers are on a line, but they span its frame; name others first"
        )
    x = along / np.linalg.norm(along)
    z = np.cross(x, across)
    z /= np.linalg.norm(z)
    return np.asarray((shape - shape[0]) @ np.stack([x, np.cross(z, x), z], 1))
