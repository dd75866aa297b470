"""Assign long rows without frame numbers to frames, by their times and their order."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import isotonic_regression

from shukotsu.arrays import Array, Integers
from shukotsu.errors import count_of
from shukotsu.readers.formats.mapped import Tracks

_MOST_STEPS = 2.0**30
"""Largest distance of a time from the median, in frame steps: 50 days at 240 Hz, resolved to 1e-6 step."""
_MOST_MOVED = 8
"""Largest number of rows by which jitter may displace a row; beyond it, rows are sorted by time."""
_FEW_FAR = 1e-3
"""Share of rows more than a quarter step from their frame, up to which times alone separate the frames."""
_DOUBTFUL = 1e-2
"""Share of rows that may be in a neighbouring frame, above which this is reported as a loss."""
_BLOCK = 4096
"""Frame steps over which the rate of a tracker's clock is taken as constant."""
_PEAK = 20.0
"""A spectral peak this many times the mean power is significant."""
_BLOCKS = 16
"""Number of blocks, from the beginning of the recording, from which the rate is estimated."""


def framed_by_time(tracks: Tracks) -> tuple[Tracks, list[str], list[str]]:
    """Assign long rows to frames by their times; return the tracks, notes and losses.

    If times scatter by less than a frame step, rows with the nearest times form a frame. If they scatter more
    and all receivers have the same number of rows, the n-th rows form frame n; if rows were lost, each
    receiver's rows are put, in their order, on frames of the common rate. Samples without a time, or with a
    time far from all others, are left out.
    """
    finite_s = [track.time_s[np.isfinite(track.time_s)] for track in tracks.values()]
    steps_s = np.concatenate([np.diff(np.unique(times_s)) for times_s in finite_s])
    step_s = float(np.quantile(steps_s, 0.25, method="lower"))  # low: lost rows lengthen many steps
    middle_s = float(np.median(np.concatenate(finite_s)))
    timed, keys_s, turns = {}, [], []
    notes, losses = list[str](), list[str]()
    for segment, track in tracks.items():
        with np.errstate(over="ignore"):
            timed[segment] = track.take(np.abs(track.time_s - middle_s) < _MOST_STEPS * step_s)
        times_s = timed[segment].time_s - middle_s
        order, every = np.argsort(times_s, kind="stable"), np.arange(len(times_s))
        # Samples with equal times are counted, so that the second one pairs with another receiver's second.
        turns.append(np.empty(len(times_s)))
        turns[-1][order] = every - np.searchsorted(times_s[order], times_s[order])
        if len(every) and np.abs(order - every).max() > _MOST_MOVED:
            timed[segment], times_s, turns[-1] = timed[segment].take(order), times_s[order], turns[-1][order]
        keys_s.append(times_s)
    distinct_s = [key_s + 1e-6 * step_s * turn for key_s, turn in zip(keys_s, turns, strict=True)]
    frames, far = _nearest_together(distinct_s, step_s)
    if far > _FEW_FAR:
        frames, doubt = _by_count(keys_s), ""
        if not frames:
            frames, doubt = _by_rate(keys_s, step_s)
        sentence, share = _ambiguity(keys_s, frames)
        (losses if doubt or share > _DOUBTFUL else notes).append(sentence + doubt)
    if lost := sum(len(track.row) for track in tracks.values()) - sum(map(len, keys_s)):
        losses.append(f"{count_of(lost, 'row', 'are')} left out: without a plausible time no frame is known")
    number = np.unique(np.concatenate(frames), return_inverse=True)[1]
    parts = np.split(number, np.cumsum([len(frame) for frame in frames])[:-1])
    pairs = zip(timed.items(), parts, strict=True)
    return {name: replace(track, frame=frame) for (name, track), frame in pairs}, notes, losses


def _by_count(keys_s: Sequence[Array]) -> list[Integers]:
    """Number each receiver's rows from 0 if all have as many and stay in step; else return an empty list.

    If receivers lost different rows, one of them deviates by a step from the others' mean between the two
    rows.
    """
    worn = [key_s for key_s in keys_s if len(key_s)]
    if len({*map(len, worn)}) > 1:
        return []
    rows_s = np.stack(worn)
    off_s = rows_s - rows_s.mean(0)
    step_s = float(np.median(np.diff(rows_s.mean(0))))
    if step_s <= 0:
        return []
    scatter_s = 1.05 * float(np.median(np.abs(np.diff(off_s))))  # sd of a normal distribution
    # rows in a block: enough for its median to resolve a shift by one step
    width = min(rows_s.shape[1], 5 + int(400 * (scatter_s / step_s) ** 2))
    blocks_s = off_s[:, : rows_s.shape[1] // width * width].reshape(len(worn), -1, width)
    medians_s = np.median(blocks_s, axis=-1)
    others = max(0.5, 1 - 1 / len(worn))  # a shift by one step minus the receiver's own share of the mean
    in_step = np.ptp(medians_s, axis=1).max() < others * step_s / 2
    in_step = in_step and np.ptp(np.median(off_s, axis=1)) < 0.97 * step_s
    return [np.arange(len(key_s)) for key_s in keys_s] if in_step else []


def _by_rate(keys_s: Sequence[Array], near_s: float) -> tuple[list[Integers], str]:
    """Put each receiver's rows, in their order, on frames of a common rate; also return a caveat, or "".

    The frame numbers increase with the row and fit the times in the least-squares sense: frame minus row is
    an isotonic regression.
    """
    doubt = ""
    turns, sharpness = _turns(keys_s, near_s)
    if not sharpness:
        moving_s = [key_s for key_s in keys_s if len(key_s) > 1 and np.ptp(key_s)]
        rate_hz = max((len(key_s) - 1) / np.ptp(key_s) for key_s in moving_s)
        turns = [key_s * rate_hz for key_s in keys_s]
        doubt = "; with lost rows and so much scatter the number of frames is uncertain"
    frames = []
    for turn in turns:
        ahead = turn - np.arange(len(turn))
        if sharpness * len(turn) > _PEAK:  # subtract the phase at which this receiver is sampled in a step
            ahead -= np.angle(np.exp(2j * np.pi * ahead).sum()) / (2 * np.pi)
        # The ends are pulled to the median of their rows, since order alone does not bound the first and
        # last.
        rows = 1 + int(5 * -np.log(min(1.0, sharpness or 0.01)))
        ends = [np.median(part) if len(part) else 0.0 for part in (ahead[:rows], ahead[-rows:])]
        weights = np.concatenate([[len(turn) + 1.0], np.ones(len(turn)), [len(turn) + 1.0]])
        lost = isotonic_regression(np.concatenate([ends[:1], ahead, ends[1:]]), weights=weights).x[1:-1]
        frames.append(np.arange(len(turn)) + np.rint(lost).astype(np.int64))
    return frames, doubt


def _turns(keys_s: Sequence[Array], near_s: float) -> tuple[list[Array], float]:
    """Return each receiver's times in steps of the common rate, and that rate's sharpness from 0 to 1.

    The rate is the highest peak, near 1 / near_s, of the power spectrum of all times; its phase is tracked
    along the recording. The sharpness is 1 without scatter and 0, with an empty list, if no peak is
    significant.
    """
    start_s, size = min(key_s.min() for key_s in keys_s if len(key_s)), 8 * _BLOCK
    hz, power, counts = np.fft.rfftfreq(4 * size, near_s / 8), np.zeros(2 * size + 1), []
    for key_s in keys_s:
        at = np.minimum((key_s - start_s) / (near_s / 8), _BLOCKS * size).astype(np.int64)
        count = np.bincount(at, minlength=_BLOCKS * size + 1)[:-1].reshape(_BLOCKS, size)
        count = count[count.any(-1)]
        power += (np.abs(np.fft.rfft(count - count.mean(-1, keepdims=True), 4 * size)) ** 2).sum(0)
        counts += count.sum(-1).tolist()
    inside = np.flatnonzero((hz > 0.4 / near_s) & (hz < 1.3 / near_s))
    peak = inside[np.argmax(power[inside])]
    rows = sum(counts)
    signal = power[peak] / rows - 1  # expected 0 for random times, with an SD of 1 / sqrt(blocks)
    if signal < _PEAK / np.sqrt(len(counts)):
        return [], 0.0
    sharpness = float(signal * rows / np.square(counts, dtype=float).sum())
    turns = [key_s * hz[peak] for key_s in keys_s]
    block_turns = max(8.0, _PEAK / sharpness / len(keys_s))
    block, inverse = np.unique(np.floor(np.concatenate(turns) / block_turns), return_inverse=True)
    parts = np.split(inverse, np.cumsum([len(turn) for turn in turns])[:-1])
    waves = np.zeros((len(turns), len(block)), complex)
    for wave, turn, part in zip(waves, turns, parts, strict=True):
        np.add.at(wave, part, np.exp(2j * np.pi * turn))
    most = waves[np.argmax([len(turn) for turn in turns])]
    # each receiver's phase in a step, relative to the receiver with most rows
    sampled = np.exp(1j * np.angle(waves @ most.conj()))
    phase = np.unwrap(np.angle(sampled.conj() @ waves)) / (2 * np.pi)
    return [turn - np.interp(turn / block_turns - 0.5, block, phase) for turn in turns], sharpness


def _ambiguity(keys_s: Sequence[Array], frames: Sequence[Integers]) -> tuple[str, float]:
    """Return a sentence on the scatter of times about frames, and the share that may be one frame off."""
    every_s = np.concatenate(keys_s)
    frame = np.unique(np.concatenate(frames), return_inverse=True)[1]
    count = np.bincount(frame)
    centre_s = np.bincount(frame, every_s) / count
    step_s = float(np.median(np.diff(np.sort(centre_s))))
    off = np.split(every_s - centre_s[frame], np.cumsum([len(key_s) for key_s in keys_s])[:-1])
    off_s = np.concatenate([part - np.median(part) if len(part) else part for part in off])
    scatter_s = math.sqrt(float(off_s @ off_s) / max(1, len(off_s) - len(count)))
    # Two kinds of rows are doubtful: consecutive ones that may have been swapped, unless times ever go back,
    # which shows that rows are in their true order; and the neighbours of lost rows.
    are_sorted = all((np.diff(key_s) >= 0).all() for key_s in keys_s)
    swapped = math.erfc(step_s / (2 * scatter_s)) if are_sorted else 0.0
    lost = len(count) * sum(len(key_s) > 0 for key_s in keys_s) - len(every_s)
    doubtful = min(len(every_s), len(every_s) * swapped + lost * 2.5 * (scatter_s / step_s) ** 2)
    nearer = int((np.abs(off_s) > step_s / 2).sum())
    sentence = (
        f"rows have no frame number, and times scatter by {1e3 * scatter_s:.2g} ms about frames that are "
        f"{1e3 * step_s:.3g} ms apart: {nearer} of {count_of(len(every_s), 'row', 'are')} nearer to another "
        f"frame than to their own, and were placed by the order of their receiver's rows; about "
        f"{doubtful:.0f} may be a frame off"
    )
    return sentence, doubtful / len(every_s)


def _nearest_together(keys_s: Sequence[Array], step_s: float) -> tuple[list[Integers], float]:
    """Group the samples nearest in time into frames; return frame numbers and the share far from their frame.

    Each sample of the receiver with the most samples starts a frame, which takes every other receiver's
    nearest sample within half a step. The remaining samples form further frames in the same way. Far means
    more than a quarter of a step.
    """
    frames = [np.zeros(len(keys), np.int64) for keys in keys_s]
    left = [np.arange(len(keys)) for keys in keys_s]
    centres_s: list[Array] = []
    count = far = 0
    while any(map(len, left)):
        most = max(range(len(left)), key=lambda receiver: len(left[receiver]))
        centre_s = np.sort(keys_s[most][left[most]])
        middles_s = (centre_s[1:] + centre_s[:-1]) / 2
        for receiver, samples in enumerate(left):
            nearest = np.searchsorted(middles_s, keys_s[receiver][samples])
            off_s = np.abs(keys_s[receiver][samples] - centre_s[nearest])
            order = np.lexsort((off_s, nearest))
            taken = order[np.unique(nearest[order], return_index=True)[1]]
            taken = taken[off_s[taken] < step_s / 2]
            far += int((off_s[taken] > step_s / 4).sum())
            frames[receiver][samples[taken]] = count + nearest[taken]
            left[receiver] = np.delete(samples, taken)
        centres_s.append(centre_s)
        count += len(centre_s)
    number = np.argsort(np.argsort(np.concatenate(centres_s), kind="stable"))
    return [number[frame] for frame in frames], far / sum(map(len, keys_s))
