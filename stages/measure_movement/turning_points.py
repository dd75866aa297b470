"""Find when a fingertip stopped going down, or began to rise, and how fast it was just before.

A filter that reaches over a contact mixes the speed before with the rest after. So each side has a parabola
of its own, of place against time, fitted by least squares to the frames of that side alone; both meet at the
turning point, whose time is the one at which they fit best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.skeleton.rotations import Array

BEFORE_S, AFTER_S = 0.030, 0.030
"""How much of a movement the parabolas are fitted to, on either side, unless told otherwise."""

FEWEST_BEFORE, FEWEST_AFTER = 5, 4
"""Frames that they need, for which slow trackers take longer."""

SOFT_S = 0.0015
"""Pulp and felt give way over some ms, of which the corner is the middle: the speed before is that so much
earlier.
"""

SLOPE_S = 0.025
"""How much of it a straight line is fitted to, where nothing is known yet."""

_SEARCH_S = np.arange(-16, 17) * 5e-4
_UNIT_S = 0.01
"""In which times are counted, so that the equations are well conditioned."""


@dataclass(frozen=True)
class TurningPoint:
    """A corner of a path: when, where (3,) and with which velocity (3,) before it.

    sd_s, speed_sd_mm_s : 1-sigma of time and of the speed before, from the noise. noise_mm : of a place along
    one direction.
    """

    time_s: float
    sd_s: float
    place_mm: Array
    before_mm_s: Array
    speed_sd_mm_s: float
    noise_mm: float


def one_sided(time_s: Array, place_mm: Array, at_s: Array) -> tuple[Array, Array, Array]:
    """Velocities before and after, and places from before, (K, ...), at K times, by straight lines.

    time_s : (n,); place_mm : (n, ...). NaN where a side has fewer than three frames, or a
    gap.
    """
    flat = place_mm.reshape(len(time_s), -1)
    off_s, unknown, found = time_s - at_s[:, None], np.isnan(flat), []
    for inside in ((off_s <= 0) & (off_s > -SLOPE_S), (off_s >= 0) & (off_s < SLOPE_S)):
        count = inside.sum(1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            middle = (off_s * inside).sum(1, keepdims=True) / count
            slope = inside * (off_s - middle)
            slope = np.where(count > 2, slope / (slope**2).sum(1, keepdims=True), np.nan)
            place = inside / count - middle * slope
        gap = inside.astype(float) @ unknown > 0  # one elsewhere says nothing of this side
        found += [np.where(gap, np.nan, own @ np.nan_to_num(flat)) for own in (slope, place)]
    before, place_before, after, _ = (own.reshape(len(at_s), *place_mm.shape[1:]) for own in found)
    return before, after, place_before


def turning_point(
    time_s: Array, place_mm: Array, about_s: float, before_s: float = BEFORE_S
) -> TurningPoint | None:
    """Fit the corner of a path (n, 3) within 8 ms of a time; None without enough frames about it."""
    for _ in range(2):
        off_s, place = _about(time_s, place_mm, about_s, before_s)
        if not len(off_s):
            return None
        squares = _fit(off_s - _SEARCH_S[:, None], place)[1]
        best = int(np.clip(squares.argmin(), 1, len(squares) - 2))
        low, middle, high = squares[best - 1 : best + 2]
        bend = low - 2 * middle + high
        step_s = _SEARCH_S[1] - _SEARCH_S[0]
        about_s += _SEARCH_S[best] + (np.clip((low - high) / (2 * bend), -1, 1) * step_s if bend > 0 else 0)
    off_s, place = _about(time_s, place_mm, about_s, before_s)
    if not len(off_s):
        return None
    parameters, squares_mm2, design = _fit(off_s, place)
    noise_mm = float(np.sqrt(float(squares_mm2) / max(1, place.size - parameters.size - 1)))
    return _with_errors(about_s, off_s, design, parameters, noise_mm)


def velocity_before(time_s: Array, place_mm: Array, at_s: float, before_s: float) -> Array:
    """Velocity (3,) of a path (n, 3) just before its corner at a known time; NaN without enough frames."""
    off_s, place = _about(time_s, place_mm, at_s, before_s)
    return _speed_before(_fit(off_s, place)[0]) if len(off_s) else np.full(3, np.nan)


def _speed_before(parameters: Array) -> Array:
    return np.asarray((parameters[1] - 2 * parameters[2] * SOFT_S / _UNIT_S) / _UNIT_S)


def _about(time_s: Array, place_mm: Array, about_s: float, before_s: float) -> tuple[Array, Array]:
    """Times from the middle and places of the frames about it; none where there are too few."""
    known = np.isfinite(place_mm).all(-1)
    off_s, place = time_s[known] - about_s, place_mm[known]
    before, after = off_s[off_s < -1e-9], off_s[off_s >= -1e-9]
    if len(before) < FEWEST_BEFORE or len(after) < FEWEST_AFTER:
        return np.empty(0), np.empty((0, 3))
    frame_s = float(np.median(np.diff(time_s)))
    first, last = before[-FEWEST_BEFORE], after[FEWEST_AFTER - 1]
    longest_s = [max(s, 1.5 * n * frame_s) for s, n in ((before_s, FEWEST_BEFORE), (AFTER_S, FEWEST_AFTER))]
    if -first > longest_s[0] or last > longest_s[1]:
        return np.empty(0), np.empty((0, 3))  # the frames there are lie across a gap
    first, last = min(-before_s, first), max(AFTER_S, last)
    own = (off_s >= first - 1e-9) & (off_s <= last + 1e-9)
    return off_s[own], place[own]


def _design(off_s: Array) -> Array:
    """Design (..., n, 5) of two parabolas that meet at time 0."""
    u = off_s / _UNIT_S
    before, after = np.minimum(u, 0.0), np.maximum(u, 0.0)
    return np.stack([np.ones_like(u), before, before**2, after, after**2], -1)


def _fit(off_s: Array, place_mm: Array) -> tuple[Array, Array, Array]:
    """Parameters (..., 5, 3) of a corner at time 0, summed squares (...) and design; off_s : (..., n)."""
    design, middle = _design(off_s), place_mm.mean(0)
    back = np.swapaxes(design, -1, -2)
    parameters = np.linalg.solve(back @ design + 1e-9 * np.eye(5), back @ (place_mm - middle))
    squares = ((place_mm - middle - design @ parameters) ** 2).sum((-1, -2))
    parameters[..., 0, :] += middle
    return parameters, squares, design


def _with_errors(
    time_s: float, off_s: Array, design: Array, parameters: Array, noise_mm: float
) -> TurningPoint:
    """Turn parameters to velocities, with the errors that the noise leaves in the corner's time as well."""
    place, before, bend, after, other_bend = parameters
    before_mm_s = _speed_before(parameters)
    speed = max(float(np.linalg.norm(before_mm_s)), 1e-9)
    # derivative of the places by the time of the corner: both parabolas are shifted by it
    early, u = (off_s < 0)[:, None], (off_s / _UNIT_S)[:, None]
    shifted: Array = np.where(early, before + 2 * u * bend, after + 2 * u * other_bend) / -_UNIT_S
    taken = np.linalg.lstsq(design, shifted, rcond=None)[0]
    left = float(((shifted - design @ taken) ** 2).sum())
    sd_s = noise_mm / float(np.sqrt(max(left, 1e-12)))
    variance = float(np.linalg.pinv(design.T @ design)[1, 1])
    by_time = float(taken[1] @ before_mm_s) / speed
    speed_sd = float(np.hypot(noise_mm * np.sqrt(variance), by_time * sd_s)) / _UNIT_S
    return TurningPoint(time_s, sd_s, place, before_mm_s, speed_sd, noise_mm)
