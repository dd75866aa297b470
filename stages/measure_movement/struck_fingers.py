"""Find which fingertip struck at each event of a recording, and the keyboard that all touches lie on.

All touches are taken together, in turns (expectation and maximisation, Dempster, Laird & Rubin 1977): given
which tip struck, the strokes show the way down, the plane of the keys and how far a white key is from the
next; given these, a tip that struck is one that was going down and stopped, at the height of the keys, at
the place of the pitch. How much that says is told by how strikers and other tips scatter about it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.skeleton.rotations import Array, unit

WHITE_KEYS = np.array([0, 0.42, 1, 1.58, 2, 3, 3.37, 4, 4.5, 5, 5.63, 6])
"""Middle of each key of an octave from C, in white keys: black ones lie between, not halfway."""

IS_BLACK: Array = np.array([0.0, 1, 0, 1, 0, 0, 1, 0, 1, 0, 1, 0])

KEY_PITCH_MM, KEY_PITCH_SD_MM = 23.5, 1.0
"""From a white key to the next, and how far keyboards differ (165 mm an octave, as a rule)."""

BLACK_MM, BLACK_SD_MM = 12.0, 3.0
"""By how much black keys lie higher."""

FEWEST_TOUCHES = 4
"""Below this there is no keyboard, but the way down alone."""

_ROUNDS = 25
_LEAST_SD = np.array([30.0, 1.0, 3.0])
"""Of a tip's speed, mm/s, its height and its place along the keys, mm."""

_TILT_SD = 0.15
"""Rad, by which the keys' plane may stand on the way down."""

_FIRST_NONE, _LEAST_NONE = 0.05, 0.005
"""Share of events that no finger of the hand made."""


@dataclass(frozen=True)
class Approach:
    """Velocities before and after, and places, (E, C, D, 3), of D tips about E events, at C times."""

    before_mm_s: Array
    after_mm_s: Array
    place_mm: Array


@dataclass(frozen=True)
class StruckFingers:
    """probability : (E, D) that each digit struck; what is missing to 1: that none of the hand did.

    best : (E, D) which of the C times it would have been. down : (3,) unit vector.
    """

    probability: Array
    best: npt.NDArray[np.int64]
    down: Array


def find_fingers(approach: Approach, pitch: Array, given: npt.NDArray[np.int64]) -> StruckFingers:
    """Find the digit of every event; pitch : (E,) MIDI number or NaN; given : (E,) its digit, or -1."""
    going = np.linalg.norm(approach.before_mm_s, axis=-1) - np.linalg.norm(approach.after_mm_s, axis=-1)
    known = np.isfinite(going).any(1)  # (E, D)
    best = np.nan_to_num(going, nan=-np.inf).argmax(1)
    none, down = _FIRST_NONE, np.full(3, np.nan)
    if not known.any():
        return StruckFingers(np.zeros(known.shape), best, down)
    fall = np.where(known, np.nan_to_num(going, nan=-1e9).max(1), -1e9)
    share = _softmax(fall / max(1.0, float(np.median(np.abs(fall[known])))))
    share = _as_given(np.where(known, share, 0.0), given)
    for _ in range(_ROUNDS):
        down = _way_down(approach, best, share)
        falling = approach.before_mm_s @ down - np.abs(approach.after_mm_s @ down)
        best = np.nan_to_num(falling, nan=-np.inf).argmax(1)
        features = [_chosen(falling, best)]
        place = _chosen(approach.place_mm, best)
        if len(given) >= FEWEST_TOUCHES:
            features += _keyboard(place, share, pitch, down)
        odds = sum(_log_ratio(own, share, least) for own, least in zip(features, _LEAST_SD, strict=False))
        odds = np.where(known, odds, -np.inf) + np.log((1 - none) / share.shape[1])
        whole = _softmax(np.column_stack([odds, np.full(len(odds), np.log(none))]))
        share = _as_given(whole[:, :-1], given)
        free = given < 0
        none = float(np.clip(whole[free, -1].mean(), _LEAST_NONE, 0.9)) if free.any() else none
    return StruckFingers(share, best, down)


def _softmax(logs: Array) -> Array:
    powers = np.exp(logs - logs.max(1, keepdims=True))
    return np.asarray(powers / powers.sum(1, keepdims=True))


def _as_given(share: Array, given: npt.NDArray[np.int64]) -> Array:
    """The share (E, D), 1 and 0 where an event names its digit."""
    out = share.copy()
    out[given >= 0] = np.eye(share.shape[1])[given[given >= 0]]
    return out


def _chosen(values: Array, best: npt.NDArray[np.int64]) -> Array:
    """Of (E, C, D, ...) those at one time each: (E, D, ...)."""
    events, digits = np.indices(best.shape)
    return np.asarray(values[events, best, digits])


def _mean(values: Array, share: Array) -> float:
    known = np.isfinite(values)
    return float((share * np.where(known, values, 0.0)).sum() / max(1e-9, (share * known).sum()))


def _way_down(approach: Approach, best: npt.NDArray[np.int64], share: Array) -> Array:
    lost = _chosen(approach.before_mm_s, best) - _chosen(approach.after_mm_s, best)
    lost = np.where(np.isfinite(lost), lost, 0.0)
    size = np.linalg.norm(lost, axis=-1)
    # the median of the direction, by weights: one wild stroke does not turn it
    way = unit((share[..., None] * lost).sum((0, 1)))
    for _ in range(5):
        across = np.linalg.norm(lost - (lost @ way)[..., None] * way, axis=-1)
        weight = share * size / np.maximum(across, 0.05 * np.median(size) + 1e-9)
        way = unit((weight[..., None] * lost).sum((0, 1)))
    return np.asarray(way)


def _keyboard(place_mm: Array, share: Array, pitch: Array, down: Array) -> list[Array]:
    """Heights over the keys and, where pitches tell where they are, places along them less the pitch's, (E,
    D).
    """
    side = unit(np.cross(down, np.eye(3)[np.abs(down).argmin()]))
    axes = np.stack([side, np.cross(down, side), -down], -1)
    own = place_mm @ axes  # (E, D, 3), up last
    known = np.asarray(np.isfinite(own).all(-1))
    own = np.where(known[..., None], own, 0.0)
    weight = np.where(known, share, 0.0)
    note = np.where(np.isfinite(pitch), pitch, 0).astype(np.int64)
    is_black: Array = np.where(np.isfinite(pitch), IS_BLACK[note % 12], 0.0)
    black = is_black[:, None] * np.ones(own.shape[:2])
    white = np.where(np.isfinite(pitch), 7 * (note // 12) + WHITE_KEYS[note % 12], np.nan)
    middle = (weight[..., None] * own).sum((0, 1)) / max(weight.sum(), 1e-9)
    flat = own - middle
    design = np.stack([np.ones_like(black), flat[..., 0], flat[..., 1], black], -1)
    raised = flat[..., 2] - BLACK_MM * black
    prior = np.array([0.0, 1 / _TILT_SD**2, 1 / _TILT_SD**2, 1 / BLACK_SD_MM**2])
    height = raised - design @ _robust(design, raised, weight, prior)
    keys = np.nan_to_num(white - np.nanmean(white) if np.isfinite(white).any() else white)
    if not np.isfinite(white).all() or np.ptp(white) < 2:
        return [np.where(known, height, np.nan)]
    slope = (weight * keys[:, None])[..., None] * flat
    along = unit(slope.sum((0, 1))[:2])
    for _ in range(3):  # the direction in which the touches lie by their pitch
        lateral = flat[..., :2] @ along
        design = np.stack([np.ones_like(lateral), keys[:, None] * np.ones_like(lateral)], -1)
        off = lateral - KEY_PITCH_MM * design[..., 1]
        fitted = _robust(design, off, weight, np.array([0.0, 1 / KEY_PITCH_SD_MM**2]))
        residual = off - design @ fitted
        near = weight / np.maximum(1.0, np.abs(residual) / 10.0)
        centred = keys[:, None] - (near * keys[:, None]).sum() / max(near.sum(), 1e-9)
        along = unit(((near * centred)[..., None] * flat[..., :2]).sum((0, 1)))
    return [np.where(known, height, np.nan), np.where(known, residual, np.nan)]


def _robust(design: Array, values: Array, weight: Array, prior: Array) -> Array:
    """Weighted least squares with a prior of mean 0 (inverse variances, of values with sd 3), less for what
    is far off (Huber).
    """
    columns = design.reshape(-1, design.shape[-1])
    fitted: Array = np.zeros(columns.shape[1])
    flat, own = values.ravel(), weight.ravel()
    for _ in range(5):
        far = np.maximum(1.0, np.abs(flat - columns @ fitted) / 6.0)
        used = own / far / 9.0
        normal = (columns * used[:, None]).T @ columns + np.diag(prior + 1e-9)
        fitted = np.asarray(np.linalg.solve(normal, columns.T @ (used * flat)))
    return fitted


def _log_ratio(feature: Array, share: Array, least_sd: float) -> Array:
    """How much likelier a tip's number (E, D) is of one that strikes than of one that does not."""
    logs = []
    for weight in (share, 1 - share):
        known = np.isfinite(feature)
        mean = _mean(feature, weight)
        sd = max(float(least_sd), float(np.sqrt(_mean((feature - mean) ** 2, weight))))
        far = np.where(known, (feature - mean) / sd, 0.0)
        # with tails (Student's t, 4 degrees of freedom): a wild number must not decide alone
        logs.append(-2.5 * np.log1p(far**2 / 4) - np.log(sd))
    return np.asarray(np.where(np.isfinite(feature), logs[0] - logs[1], 0.0))
