"""Find where in a recording the thumb's pad is likely to rest on a finger's: opposition, from poses alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fingertips import PAD, Fingertips, seen_parts
from shukotsu.stages.fit_hand.operations import Index
from shukotsu.stages.fit_hand.touches import CONTACT_SD_MM, Touch, touch_in

THUMB = "thumb"

NEAR_SD = 3.37
"""Pads predicted closer than so many sd may be in contact: 99 % of three normal numbers (chi)."""

SLOW_SHARE = 0.15
"""Share of the speed that thumb and finger reach towards each other (its 90th percentile): pads that meet are
held for a moment, pads that pass each other are not."""

HELD_MM = 1.0
"""Frames so much farther apart than the closest one still belong to the contact."""

MOST_EACH = 3
"""Contacts of one finger that are used, those held stillest."""

_SPEED_FRAMES = 4
"""Speed is that over twice as many frames, so that the tracker's noise does not count as one."""

_Rows = npt.NDArray[np.bool_]


def find_contacts(tips: Fingertips, poses: Poses) -> list[Touch]:
    """Find frames of a recording in which the thumb's pad is likely to rest on a finger's.

    That pad must be the nearest, nearer than the hand's uncertainty allows, and be held there. One person's
    way of putting pads together repeats itself: all contacts of a finger share the weight of one.
    """
    fingers = [name for name in tips.digits if name != THUMB]
    if THUMB not in tips.digits or not fingers:
        return []
    pads = tips.in_transmitter(poses, PAD)
    own = [list(tips.digits).index(name) for name in fingers]
    apart = pads[:, own] - pads[:, [list(tips.digits).index(THUMB)]]
    distance = np.nan_to_num(np.linalg.norm(apart, axis=-1), nan=np.inf)
    nearest = distance.argmin(1)
    seen = seen_parts(tips.fit.evidence, tips.fit.evidence.posterior.x, tips.offsets_mm)
    contacts = []
    for i, finger in enumerate(fingers):
        both = [seen[digit, PAD][1] for digit in (THUMB, finger)]
        variance = sum(float(np.trace(rows @ tips.covariance @ rows.T)) / 3 for rows in both)
        apart_sd_mm = float(np.sqrt(variance + CONTACT_SD_MM**2))  # per direction, averaged over directions
        near = (distance[:, i] < NEAR_SD * apart_sd_mm) & (nearest == i)
        episodes = _held(distance[:, i], _speed(apart[:, i]), near)[:MOST_EACH]
        shared = CONTACT_SD_MM * len(episodes) ** 0.5
        contacts += [touch_in(tips, poses, rows, (THUMB, finger), shared, PAD) for rows in episodes]
    return contacts


def _speed(apart_mm: Array) -> Array:
    """Speed (T,) at which a vector (T, 3) changes, mm per frame; infinite where not known."""
    speed = np.full(len(apart_mm), np.inf)
    k = _SPEED_FRAMES
    if len(apart_mm) > 2 * k:
        speed[k:-k] = np.linalg.norm(apart_mm[2 * k :] - apart_mm[: -2 * k], axis=-1) / (2 * k)
    return np.asarray(np.nan_to_num(speed, nan=np.inf))


def _held(distance_mm: Array, speed: Array, near: _Rows) -> list[Index]:
    """Frames of each time that two pads were held together, the stillest time first."""
    known = speed[np.isfinite(speed)]
    if not len(known):
        return []
    slow = SLOW_SHARE * float(np.percentile(known, 90))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    episodes = []
    for start, stop in edges.reshape(-1, 2):
        run = np.arange(start, stop)
        run = run[speed[run] < slow]
        if len(run):
            rows = run[distance_mm[run] < distance_mm[run].min() + HELD_MM]
            episodes.append((float(np.median(speed[rows])), rows))
    return [rows for _, rows in sorted(episodes, key=lambda episode: episode[0])]
