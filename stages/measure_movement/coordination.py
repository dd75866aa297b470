"""Coordination of a hand's joints: principal components of their angles in a recording.

Noise of single frames adds its variance to every component, and is taken off. What else the angles' stated
errors leave open may make a component of its own, so one that has no more variance than all stated errors
would have along it is not counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.anatomy.recorded_movement import ERRORS, AngleSeries
from shukotsu.skeleton.rotations import Array

MOST_FRAMES = 20_000
"""Frames, evenly spaced, that postures are taken from."""

LEAST_KNOWN = 0.5
"""Share of the frames in which all angles must be known; the least known are left out until they are."""

ENOUGH_PERCENT = 90.0
"""Of the variance, what the components make whose loadings are given."""

NOISE_QUANTILE = 3.27
"""What the largest component of noise, scaled as by Johnstone (2001, Ann Stat 29:295), exceeds in 0.1 %."""


@dataclass(frozen=True)
class Components:
    """Principal components of A angles, in the order of their variance.

    variance, noise : (K,) square degrees: all, and what single frames' noise adds. share : (K,) of the
    variance without noise of all that are counted, NaN of one that is not. loadings : (K, A) unit vectors,
    the largest part positive. n_frames : in which all angles are known.
    """

    variance: Array
    noise: Array
    share: Array
    loadings: Array
    n_frames: int

    @property
    def n_enough(self) -> int:
        """Count the components that together make ENOUGH_PERCENT."""
        total = np.cumsum(self.share[~np.isnan(self.share)])
        return int(np.searchsorted(total, ENOUGH_PERCENT / 100 - 1e-9)) + 1 if len(total) else 0


def principal_components(angle_deg: Array, frame_sd_deg: Array, error_sd_deg: Array) -> Components:
    """Find the components of angles (T, A) in frames that have them all, two at least.

    frame_sd_deg : (A,) 1-sigma of a single frame. error_sd_deg : (A,) of an angle's change from the mean
    posture, that of the frame and of the hand.
    """
    known = angle_deg[~np.isnan(angle_deg).any(1)]
    count, width = known.shape
    variance, vectors = np.linalg.eigh(np.cov(known, rowvar=False).reshape(width, width))
    variance, loadings = np.maximum(variance[::-1], 0.0), vectors.T[::-1]
    largest = np.take_along_axis(loadings, np.abs(loadings).argmax(1)[:, None], 1)
    loadings = loadings * np.where(largest < 0, -1.0, 1.0)
    noise, error = (loadings**2 @ sd**2 for sd in (frame_sd_deg, error_sd_deg))
    counts = variance > np.maximum(error * _most_of_noise(count, width), 1e-9)
    signal = np.where(counts, np.maximum(variance - noise, 0.0), np.nan)
    return Components(variance, noise, signal / max(np.nansum(signal), 1e-12), loadings, count)


def _most_of_noise(count: int, width: int) -> float:
    """Give what the largest component of noise of variance 1 alone exceeds in one recording of a thousand."""
    roots = np.sqrt([count - 1, width])
    return float((roots.sum() ** 2 + NOISE_QUANTILE * roots.sum() * (1 / roots).sum() ** (1 / 3)) / count)


@dataclass
class Postures:
    """Take in the angles of a recording, one after the other."""

    names: list[tuple[str, str]] = field(default_factory=list)
    _angle_deg: list[Array] = field(default_factory=list)
    _frame_sd_deg: list[float] = field(default_factory=list)
    _error_sd_deg: list[float] = field(default_factory=list)

    def add(self, series: AngleSeries) -> None:
        """Add an angle that any frame has."""
        some = slice(None, None, max(1, -(-len(series.angle_deg) // MOST_FRAMES)))
        angle_deg = series.angle_deg[some]
        if np.isnan(angle_deg).all():
            return
        change_sd_deg = np.full(1, np.nan)
        if series.errors_deg is not None:
            change_sd_deg = series.errors_deg[some, ERRORS.index("change_sd_deg"), 0][~np.isnan(angle_deg)]
        self.names.append((series.joint, series.angle))
        self._angle_deg.append(np.array(angle_deg))
        self._frame_sd_deg.append(float(change_sd_deg.min()))
        self._error_sd_deg.append(float(np.sqrt(np.mean(change_sd_deg**2))))

    def n_frames(self, names: list[tuple[str, str]]) -> int:
        """Count the frames that have all of these angles."""
        own = [
            angle_deg for angle_deg, name in zip(self._angle_deg, self.names, strict=True) if name in names
        ]
        return int((~np.isnan(own).any(0)).sum())

    def components(self) -> tuple[list[tuple[str, str]], Components | None, bool]:
        """Give the angles kept, their components, None where too few frames have them, and whether errors are
        stated.
        """
        if not self.names:
            return [], None, False
        angle_deg = np.stack(self._angle_deg, 1)
        kept = _known_together(~np.isnan(angle_deg))
        sds = (np.array(sd)[kept] for sd in (self._frame_sd_deg, self._error_sd_deg))
        frame_sd_deg, error_sd_deg = sds
        names, angle_deg = [self.names[index] for index in kept], angle_deg[:, kept]
        if self.n_frames(names) < 2 * len(kept):
            return names, None, False
        stated = not np.isnan(error_sd_deg).any()
        return (
            names,
            principal_components(angle_deg, *map(np.nan_to_num, (frame_sd_deg, error_sd_deg))),
            stated,
        )


def _known_together(known: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Indices of the angles (T, A) that LEAST_KNOWN of the frames have together."""
    order = np.argsort(-known.sum(0), kind="stable")
    together = np.logical_and.accumulate(known[:, order], axis=1).mean(0)
    return np.sort(order[: max(1, int((together >= LEAST_KNOWN).sum()))])


def coordination_rows(postures: Postures) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Give rows of coordination and coordination_loadings, without their keys of recording and model."""
    names, found, stated = postures.components()
    if found is None:
        row = {"component": 1, "counted": False, "n_angles": len(names), "n_frames": postures.n_frames(names)}
        few = f"{row['n_frames']} frames have all {len(names)} angles; expected {2 * len(names)} or more"
        return ([row | {"status": "failed", "message": few}] if names else []), []
    left_out = [f"{joint} {angle}" for joint, angle in postures.names if (joint, angle) not in names]
    message = f"known in too few frames: {', '.join(left_out)}" if left_out else ""
    if np.isnan(found.share).all():
        message = "; ".join(filter(None, ("nothing exceeds the stated errors of the angles", message)))
    if not stated:
        message = "; ".join(
            filter(None, ("the model states no errors, so noise counts as movement", message))
        )
    rows = [
        {
            "component": number,
            "variance_deg2": float(found.variance[index]),
            "noise_deg2": float(found.noise[index]) if stated else None,
            "counted": bool(np.isfinite(found.share[index])),
            "share_percent": 100 * float(found.share[index]),
            "cumulative_percent": 100 * float(np.nancumsum(found.share)[index] + 0 * found.share[index]),
            "n_angles": len(names),
            "n_frames": found.n_frames,
            "status": "weak" if message else "ok",
            "message": message,
        }
        for index, number in enumerate(range(1, len(names) + 1))
    ]
    return rows, list(_loading_rows(names, found))


def _loading_rows(names: list[tuple[str, str]], found: Components) -> Iterator[dict[str, Any]]:
    for index in np.flatnonzero(~np.isnan(found.share))[: found.n_enough].tolist():
        for (joint, angle), loading in zip(names, found.loadings[index].tolist(), strict=True):
            yield {"component": index + 1, "joint": joint, "angle": angle, "loading": loading}
