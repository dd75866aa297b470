"""Treatment of gaps in a motion, and resampling to an even rate.

A gap is a run of frames in which a joint has no complete pose, or of frames that were lost, which missing
frame numbers show. Gaps are refused, held, cut or interpolated, as the user chooses, and always reported. A
gap is filled in the frame of the proximal bone, so that a held finger still moves with the hand; gaps of the
root are filled in the transmitter's frame. Known poses keep exactly their numbers. Between samples, positions
are interpolated linearly, and rotations along the shortest arc at constant angular velocity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shukotsu.arrays import Array, Index
from shukotsu.errors import InputError, count_of
from shukotsu.export.exported_motion import require_times
from shukotsu.hand.posing import PosedRecording, known_points
from shukotsu.hand.rotations import about_axis, angle, conjugate, continuous, multiply, rotate, unit

FILLED_FRAMES = 100_000
"""Largest number of frames that are filled: seven minutes at 240 Hz."""

_SAME_S = 1e-9
_WIDEST_STEPS = 1.5
"""Consecutive frames more than this many usual intervals apart have a gap between them."""


def resample_evenly(motion: PosedRecording, fps: float, widest_s: float = 0.0) -> PosedRecording:
    """Resample the motion at an even rate from its first device time: positions linearly, rotations by slerp.

    A new frame has no pose (NaN) in a gap that was kept, or between frames that are farther apart than both
    1.5 usual intervals and widest_s. There is no filter, so motion above half of the new rate causes
    aliasing. Raises InputError if times are missing or do not increase, or if there would be more than
    FILLED_FRAMES.
    """
    time_s = motion.time_s
    require_times(motion, time_s, "--fps", "resampling")
    if len(time_s) < 2:
        return replace(motion, rate_hz=fps)
    count = int(np.floor((time_s[-1] - time_s[0]) * fps + 1e-6)) + 1
    if count > FILLED_FRAMES:
        wide = int(np.argmax(np.diff(time_s)))
        raise InputError(
            f"--fps: {fps:g} would make {count_of(count, 'frame')} of {np.ptp(time_s):.0f} s (the longest "
            f"pause is after frame {motion.frame[wide]}), more than {FILLED_FRAMES}; give a lower rate, or "
            "parts by --frames"
        )
    at = np.minimum(time_s[0] + np.arange(count) / fps, time_s[-1])
    before, after, share = bracket(at, time_s)
    share = np.where(at - time_s[before] < _SAME_S, 0.0, np.where(time_s[after] - at < _SAME_S, 1.0, share))
    apart = time_s[after] - time_s[before] > max(_WIDEST_STEPS / motion.rate_hz, widest_s)
    share = np.where(apart & (share > 0) & (share < 1), np.nan, share)
    out = motion.mapped(
        lambda places: blend(places[before], places[after], share[:, None]),
        lambda turns: continuous(slerp_rotations(turns[before], turns[after], share[:, None])),
        frame=motion.frame[np.where(share > 0.5, after, before)],
        time_s=at,
    )
    valid = known_points(out.receivers.position_mm, out.receivers.quaternion)
    out = replace(out, rate_hz=fps, receivers=replace(out.receivers, valid=valid))
    return out.noting(
        f"resampled from {count_of(len(time_s), 'frame')} ({motion.rate_hz:g} Hz) to {len(at)} ({fps:g} Hz) "
        "over device time, unfiltered"
    )


def largest_time_error_s(motion: PosedRecording) -> float:
    """Return the largest deviation of device times from an even rate, s; 0 without times.

    It is the error of times in a file that stores only a rate.
    """
    if len(motion.time_s) < 2 or not np.isfinite(motion.time_s).all():
        return 0.0
    even = motion.time_s[0] + np.arange(len(motion.time_s)) / motion.rate_hz
    return float(np.abs(motion.time_s - even).max())


def bracket(at: Array, x: Array) -> tuple[Index, Index, Array]:
    """Return the rows before and after each of `at` in the increasing x (n,), and its share of the way.

    The share is 0 at the row before and 1 at the row after. Beyond an end of x, the share is that of the end.
    """
    after = np.clip(np.searchsorted(x, at, side="right"), 1, max(len(x) - 1, 1))
    before, after = after - 1, np.minimum(after, len(x) - 1)
    width = x[after] - x[before]
    share = np.divide(at - x[before], width, out=np.zeros(len(at)), where=width > 0)
    return before, after, np.clip(share, 0.0, 1.0)


def blend(first: Array, second: Array, share: Array) -> Array:
    """Interpolate linearly between (..., n) and (..., n) at shares (...), exact at 0 and 1."""
    part = share[..., None]
    return np.where(part <= 0, first, np.where(part >= 1, second, first + part * (second - first)))


def slerp_rotations(first: Array, second: Array, share: Array) -> Array:
    """Interpolate unit quaternions (..., 4) along the shortest arc (Shoemake 1985) at shares (...), 0 to 1.

    At 0 and 1 the result is exactly that end, so that a NaN at the other end has no effect. The signs are
    those nearest to `first`.
    """
    near = np.where(np.sum(first * second, -1, keepdims=True) < 0, -second, second)
    turn = multiply(conjugate(first), near)
    mixed = multiply(first, about_axis(unit(turn[..., 1:]), share * angle(turn)))
    part = share[..., None]
    return np.where(part <= 0, first, np.where(part >= 1, near, mixed))


@dataclass(frozen=True)
class Gap:
    """Gap from frame number `first` to `last`.

    joint : the first joint without a pose in it, empty for lost frames. length_s : time from the last frame
    before it to the first frame after it, NaN without times.
    """

    first: int
    last: int
    joint: str
    length_s: float

    def __str__(self) -> str:
        what = f"joint {self.joint} has no pose in" if self.joint else "the recording lost"
        frames = f"frame {self.first}" if self.first == self.last else f"frames {self.first} to {self.last}"
        return f"{what} {frames}" + (f" ({self.length_s:.3f} s)" if np.isfinite(self.length_s) else "")


def close_gaps(motion: PosedRecording, policy: str, max_gap_s: float) -> PosedRecording:
    """Remove gaps by a policy and add a note on what was done.

    The policy is one of: refuse, raise InputError that names the first gap; hold, repeat the pose before the
    gap, or after it if it is at the start; cut, keep only the longest stretch without gaps; interpolate,
    positions linearly and rotations by slerp over device time, with an InputError if a gap is longer than
    max_gap_s or at an end. Raises InputError as well if no frame is left or a joint has no pose at all.
    """
    gaps = find_gaps(motion)
    if not len(motion.frame):
        raise InputError(f"{motion.origin}: no frame to export; widen --frames or look at the recording")
    if not gaps:
        return motion
    if policy == "refuse":
        raise InputError(
            f"{motion.origin}: {gaps[0]}, the first of {len(gaps)} gaps, which this format cannot hold; "
            "choose --gaps hold, cut or interpolate, or a --frames range without one"
        )
    if policy == "cut":
        return _cut(motion)
    never = ~motion.known.any(0)
    if never.any():
        raise InputError(
            f"{motion.origin}: joint {motion.names[int(np.argmax(never))]} has no pose in any of these "
            "frames, so there is nothing to fill from; widen --frames"
        )
    if _lost(motion).sum() > FILLED_FRAMES:  # a wrong frame number can mean very many frames
        widest = max((gap for gap in gaps if not gap.joint), key=lambda gap: gap.last - gap.first)
        raise InputError(
            f"{motion.origin}: {widest}, more than the {FILLED_FRAMES} frames that are filled; use --frames "
            "to leave it out, or --gaps cut"
        )
    open_end = next((gaps[row] for row in (0, -1) if not motion.whole[row]), None)
    if policy == "interpolate" and open_end:
        raise InputError(
            f"{motion.origin}: {open_end}, open to one end of the recording, where nothing can be "
            "interpolated; use --frames to leave it out, or --gaps cut or hold"
        )
    for gap in gaps if policy == "interpolate" else ():
        if not gap.length_s <= max_gap_s:
            raise InputError(
                f"{motion.origin}: {gap}, longer than --max-gap-s {max_gap_s:g}; raise it, or use --gaps cut "
                "or hold"
            )
    return _fill_gaps(with_lost_frames(motion), gaps, policy)


def find_gaps(motion: PosedRecording) -> list[Gap]:
    """Return all gaps in the order of their frames."""
    whole, time_s = motion.whole, motion.time_s
    edges = np.flatnonzero(np.diff(np.concatenate([[True], whole, [True]]).astype(int)))
    gaps = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        joint = motion.names[int(np.argmin(motion.known[start]))]
        before, after = max(start - 1, 0), min(stop, len(whole) - 1)
        length = float(time_s[after] - time_s[before])
        gaps.append(Gap(int(motion.frame[start]), int(motion.frame[stop - 1]), joint, length))
    for row in np.flatnonzero(_lost(motion)):
        first, last = int(motion.frame[row]) + 1, int(motion.frame[row + 1]) - 1
        gaps.append(Gap(first, last, "", float(time_s[row + 1] - time_s[row])))
    return sorted(gaps, key=lambda gap: gap.first)


def _lost(motion: PosedRecording) -> Index:
    """Return the number of lost frames after each frame but the last (T - 1,), by the usual step."""
    step = np.diff(motion.frame)
    if not len(step):
        return np.zeros(0, np.int64)
    usual = max(1, int(np.median(step)))
    return np.maximum(np.rint(step / usual).astype(np.int64) - 1, 0)


def with_lost_frames(motion: PosedRecording) -> PosedRecording:
    """Return the motion with a frame without poses, at an interpolated time, for each lost frame."""
    lost = _lost(motion)
    if not lost.any():
        return motion
    position = np.concatenate([[0], np.cumsum(1 + lost)])
    rows = np.arange(position[-1] + 1)
    recorded = np.isin(rows, position)
    blank = ~recorded[:, None, None]
    wide = motion.take(np.cumsum(recorded) - 1)
    return wide.mapped(
        lambda mm: np.where(blank, np.nan, mm),
        lambda turns: np.where(blank, np.nan, turns),
        valid=wide.receivers.valid & recorded[:, None],
        frame=np.rint(np.interp(rows, position, motion.frame)).astype(np.int64),
        time_s=np.interp(rows, position, motion.time_s),
    )


def _cut(motion: PosedRecording) -> PosedRecording:
    whole = motion.whole
    joined = np.zeros(len(whole), bool)
    joined[1:] = whole[1:] & whole[:-1] & (_lost(motion) == 0)
    starts = np.flatnonzero(whole & ~joined)
    if not len(starts):
        raise InputError(
            f"{motion.origin}: no frame in which every joint has a pose, so --gaps cut leaves nothing"
        )
    ends = np.flatnonzero(whole & ~np.append(joined[1:], False)) + 1
    best = int(np.argmax(ends - starts))
    out = motion.take(slice(starts[best], ends[best]))
    removed = [part for part in (motion.frame[: starts[best]], motion.frame[ends[best] :]) if len(part)]
    away = [f"{part[0]}" if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in removed]
    return out.noting(
        f"gaps cut: frames {out.frame[0]} to {out.frame[-1]} are kept, the longest stretch without a "
        f"gap ({len(out.frame)} of {len(whole)}); removed: {', '.join(away) or 'none'}"
    )


def _fill_gaps(motion: PosedRecording, gaps: list[Gap], policy: str) -> PosedRecording:
    """Fill every gap, parents first, since a child is filled in its parent's frame."""
    whole, times = motion.known, motion.time_s
    x = times if np.isfinite(times).all() else np.arange(len(times), dtype=float)
    position, turn = motion.position_mm.copy(), motion.quaternion.copy()
    for index, joint in enumerate(motion.joints):
        blank = ~whole[:, index]
        if not blank.any():
            continue
        places, turns = position[:, index], turn[:, index]
        if joint.parent >= 0:
            above = turn[:, joint.parent]
            places = rotate(conjugate(above), places - position[:, joint.parent])
            turns = multiply(conjugate(above), turns)
        rows = np.flatnonzero(whole[:, index])
        before, after, share = bracket(x, x[rows])
        if policy == "hold":
            share = np.where(np.arange(len(x)) >= rows[after], 1.0, 0.0)
        before, after = rows[before], rows[after]
        places = blend(places[before], places[after], share)
        turns = slerp_rotations(turns[before], turns[after], share)
        if joint.parent >= 0:
            places, turns = position[:, joint.parent] + rotate(above, places), multiply(above, turns)
        position[blank, index], turn[blank, index] = places[blank], turns[blank]
    frames = int((~motion.whole).sum())
    longest = max(gap.length_s for gap in gaps)
    how = "holding the pose before it" if policy == "hold" else "interpolation"
    length = f", the longest {longest:.3f} s" if np.isfinite(longest) else ""
    note = f"{count_of(len(gaps), 'gap')} ({count_of(frames, 'frame')}{length}) filled by {how}"
    filled = replace(motion, position_mm=position, quaternion=continuous(turn))
    return filled.noting(f"{note} in the parent bone's frame")
