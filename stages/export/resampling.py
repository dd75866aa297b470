"""An even rate made from uneven times.

Between samples positions are linear, and rotations go by the shortest arc at constant angular velocity.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shukotsu.errors import InputError
from shukotsu.skeleton.posing import Bools, Index, PosedRecording, known_points
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.export.motion import continuous

FILLED_FRAMES = 100_000
"""The most that are made where a recording has none: seven minutes at 240 Hz."""

_SAME_S = 1e-9
_WIDEST_STEPS = 1.5
"""Frames further apart than this many usual intervals have a gap between them."""


def resampled(motion: PosedRecording, fps: float, widest_s: float = 0.0) -> PosedRecording:
    """Return the motion at an even rate from its first time on: positions linear, rotations by slerp.

    Device times count, not frame numbers. A new frame in a gap that was kept, or between frames that are
    further apart than 1.5 usual intervals and than widest_s, has no pose (NaN). Nothing is filtered: a rate
    below twice the motion's own aliases. Raises InputError where times are missing or do not grow, or where
    pauses would make more than FILLED_FRAMES.
    """
    time_s = motion.time_s
    if not np.isfinite(time_s).all():
        raise InputError("--fps: the recording has no device time; give its rate_hz in a mapping")
    still = np.flatnonzero(np.diff(time_s) <= 0)
    if len(still):
        raise InputError(
            f"--fps: device time does not grow from frame {motion.frame[still[0]]} to the next; it must, to "
            "be resampled"
        )
    if len(time_s) < 2:
        return replace(motion, rate_hz=fps)
    if (pauses := _count(time_s, fps) - len(time_s) * fps / motion.rate_hz) > FILLED_FRAMES:
        wide = int(np.argmax(np.diff(time_s)))
        raise InputError(
            f"--fps: pauses of the recording, the longest after frame {motion.frame[wide]}, would make "
            f"{pauses:.0f} frames, more than {FILLED_FRAMES}; export the parts before and after it with "
            "--frames"
        )
    at = np.minimum(time_s[0] + np.arange(_count(time_s, fps)) / fps, time_s[-1])
    before, after, share = bracketed(at, time_s)
    share = np.where(at - time_s[before] < _SAME_S, 0.0, np.where(time_s[after] - at < _SAME_S, 1.0, share))
    apart = time_s[after] - time_s[before] > max(_WIDEST_STEPS / motion.rate_hz, widest_s)
    share = np.where(apart & (share > 0) & (share < 1), np.nan, share)
    out = motion.mapped(
        lambda places: blended(places[before], places[after], share[:, None]),
        lambda turns: continuous(slerped(turns[before], turns[after], share[:, None])),
        frame=motion.frame[np.where(share > 0.5, after, before)],
        time_s=at,
    )
    valid = known_points(out.receivers.position_mm, out.receivers.quaternion)
    out = replace(out, rate_hz=fps, receivers=replace(out.receivers, valid=valid))
    return out.noting(
        f"resampled from {len(time_s)} frames ({motion.rate_hz:g} Hz) to {len(at)} ({fps:g} Hz) over device "
        "time, unfiltered"
    )


def _count(time_s: Array, fps: float) -> int:
    return int(np.floor((time_s[-1] - time_s[0]) * fps + 1e-6)) + 1


def largest_time_error_s(motion: PosedRecording) -> float:
    """Return the most that a device time is off an even rate that starts with the first; 0 without times.

    What a file loses that holds a rate and no times.
    """
    if len(motion.time_s) < 2 or not np.isfinite(motion.time_s).all():
        return 0.0
    even = motion.time_s[0] + np.arange(len(motion.time_s)) / motion.rate_hz
    return float(np.abs(motion.time_s - even).max())


def bracketed(at: Array, x: Array) -> tuple[Index, Index, Array]:
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
