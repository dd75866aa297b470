"""Long rows without a frame number: which belong to one frame, as their times and their order say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import isotonic_regression

from shukotsu.arrays import Array, Integers
from shukotsu.errors import count_of
from shukotsu.readers.formats.mapped import Track

_MOST_STEPS = 2.0**30
"""Steps from the middle, of rows that times put into frames: 50 days at 240 Hz, a millionth still counts."""
_MOST_MOVED = 8
"""So many rows times of arrival may put a row from its place; beyond, the rows are in no order."""
_FEW_FAR = 1e-3
"""Where no more rows than this are a quarter of a step off their frame, times alone tell frames apart."""
_DOUBTFUL = 1e-2
"""Where more rows than this may be in the frame beside theirs, a study must be told."""
_BLOCK = 4096
"""Steps over which a tracker's clock keeps its rate."""
_PEAK = 20.0
"""So many times the mean power, or more, is no peak by chance."""
_BLOCKS = 16
"""So many blocks, from the beginning, tell the rate."""


def framed_by_time(tracks: Mapping[str, Track]) -> tuple[dict[str, Track], list[str], list[str]]:
    """Number long rows by their times; return notes and losses, too.

    Where times scatter less than a frame's step, a frame is what is nearest together. Where they scatter more
    and every receiver has as many rows, the rows of one number belong together; where rows are lost, each
    receiver's are put in their order onto the frames of the common rate. Samples whose time is none, or far
    off all others, are left out.
    """
    finite_s = [track.time_s[np.isfinite(track.time_s)] for track in tracks.values()]
    steps_s = np.concatenate([np.diff(np.unique(times_s)) for times_s in finite_s])
    step_s = float(np.quantile(steps_s, 0.25, method="lower"))  # of which lost rows make many longer
    middle_s = float(np.median(np.concatenate(finite_s)))
    timed, keys_s, turns = {}, [], []
    notes: list[str] = []
    losses: list[str] = []
    for segment, track in tracks.items():
        with np.errstate(over="ignore"):
            timed[segment] = track.of(np.abs(track.time_s - middle_s) < _MOST_STEPS * step_s)
        times_s = timed[segment].time_s - middle_s
        order, every = np.argsort(times_s, kind="stable"), np.arange(len(times_s))
        # The second of two samples of one time belongs with the second of another receiver's two.
        turns.append(np.empty(len(times_s)))
        turns[-1][order] = every - np.searchsorted(times_s[order], times_s[order])
        if len(every) and np.abs(order - every).max() > _MOST_MOVED:
            timed[segment], times_s, turns[-1] = timed[segment].of(order), times_s[order], turns[-1][order]
        keys_s.append(times_s)
    frames, far = _nearest_together(
        [key_s + 1e-6 * step_s * turn for key_s, turn in zip(keys_s, turns, strict=True)], step_s
    )
    if far > _FEW_FAR:
        frames, doubt = _by_count(keys_s), ""
        if not frames:
            frames, doubt = _by_rate(keys_s, step_s)
        sentence, share = _ambiguity(keys_s, frames)
        (losses if doubt or share > _DOUBTFUL else notes).append(sentence + doubt)
    if lost := sum(len(track.row) for track in tracks.values()) - sum(map(len, keys_s)):
        losses.append(
            f"{count_of(lost, 'row', 'are')} left out, since without a time nothing says to "
            "which frame they belong"
        )
    number = np.unique(np.concatenate(frames), return_inverse=True)[1]
    parts = np.split(number, np.cumsum([len(frame) for frame in frames])[:-1])
    pairs = zip(timed.items(), parts, strict=True)
    return {name: replace(track, frame=frame) for (name, track), frame in pairs}, notes, losses


def _by_count(keys_s: Sequence[Array]) -> list[Integers]:
    """Number the rows of each receiver, where all have as many and stay in step; empty: they do not.

    A receiver that lost another row than the others did is a step off their mean between the two.
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
    width = min(rows_s.shape[1], 5 + int(400 * (scatter_s / step_s) ** 2))  # rows whose median tells a step
    blocks_s = off_s[:, : rows_s.shape[1] // width * width].reshape(len(worn), -1, width)
    medians_s = np.median(blocks_s, axis=-1)
    others = max(0.5, 1 - 1 / len(worn))  # of which the mean is, as a share of all
    in_step = np.ptp(medians_s, axis=1).max() < others * step_s / 2
    in_step = in_step and np.ptp(np.median(off_s, axis=1)) < 0.97 * step_s
    return [np.arange(len(key_s)) for key_s in keys_s] if in_step else []


def _by_rate(keys_s: Sequence[Array], near_s: float) -> tuple[list[Integers], str]:
    """Put each receiver's rows in their order onto frames of a common rate; say where that is a guess.

    A receiver's rows lie on ever later frames that are nearest to their times in the sense of least squares,
    which is an isotonic regression of frame minus row.
    """
    doubt = ""
    turns, sharpness = _turns(keys_s, near_s)
    if not sharpness:
        rate_hz = max(
            (len(key_s) - 1) / np.ptp(key_s) for key_s in keys_s if len(key_s) > 1 and np.ptp(key_s)
        )
        turns = [key_s * rate_hz for key_s in keys_s]
        doubt = "; lost rows and so much scatter leave open how many frames there were"
    frames = []
    for turn in turns:
        ahead = turn - np.arange(len(turn))
        if sharpness * len(turn) > _PEAK:  # when in a step the receiver is sampled
            ahead -= np.angle(np.exp(2j * np.pi * ahead).sum()) / (2 * np.pi)
        # Each end keeps to the median of its rows, as no order holds its first and last row.
        rows = 1 + int(5 * -np.log(min(1.0, sharpness or 0.01)))
        ends = [np.median(part) if len(part) else 0.0 for part in (ahead[:rows], ahead[-rows:])]
        weights = np.concatenate([[len(turn) + 1.0], np.ones(len(turn)), [len(turn) + 1.0]])
        lost = isotonic_regression(np.concatenate([ends[:1], ahead, ends[1:]]), weights=weights).x[1:-1]
        frames.append(np.arange(len(turn)) + np.rint(lost).astype(np.int64))
    return frames, doubt


def _turns(keys_s: Sequence[Array], near_s: float) -> tuple[list[Array], float]:
    """Return times counted in steps of the rate that all have, and how sharp it is: 1 without any scatter.

    The rate is the highest peak of the power spectrum of all times, near that of steps of near_s; its phase
    is followed along the recording. Where no peak stands out the sharpness is 0.
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
    signal = power[peak] / rows - 1  # of times at random 0, with an sd of one a block
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
    sampled = np.exp(1j * np.angle(waves @ most.conj()))  # when in a step, beside the receiver with most rows
    phase = np.unwrap(np.angle(sampled.conj() @ waves)) / (2 * np.pi)
    return [turn - np.interp(turn / block_turns - 0.5, block, phase) for turn in turns], sharpness


def _ambiguity(keys_s: Sequence[Array], frames: Sequence[Integers]) -> tuple[str, float]:
    """Return in a sentence how far times scatter about their frames, and what share may be one frame off."""
    every_s = np.concatenate(keys_s)
    frame = np.unique(np.concatenate(frames), return_inverse=True)[1]
    count = np.bincount(frame)
    centre_s = np.bincount(frame, every_s) / count
    step_s = float(np.median(np.diff(np.sort(centre_s))))
    off = np.split(every_s - centre_s[frame], np.cumsum([len(key_s) for key_s in keys_s])[:-1])
    off_s = np.concatenate([part - np.median(part) if len(part) else part for part in off])
    scatter_s = math.sqrt(float(off_s @ off_s) / max(1, len(off_s) - len(count)))
    # Two rows in turn changed places, unless times go back in their order; or a lost row is another.
    swapped = all((np.diff(key_s) >= 0).all() for key_s in keys_s) * math.erfc(step_s / (2 * scatter_s))
    lost = len(count) * sum(len(key_s) > 0 for key_s in keys_s) - len(every_s)
    doubtful = min(len(every_s), len(every_s) * swapped + lost * 2.5 * (scatter_s / step_s) ** 2)
    nearer = int((np.abs(off_s) > step_s / 2).sum())
    sentence = (
        f"rows have no frame number, and times scatter by {1e3 * scatter_s:.2g} ms about frames that are "
        f"{1e3 * step_s:.3g} ms apart: {nearer} of {count_of(len(every_s), 'row', 'are')} nearer to "
        f"another frame than to "
        f"theirs, and are where their receiver's order puts them; about {doubtful:.0f} may be a frame off"
    )
    return sentence, doubtful / len(every_s)


def _nearest_together(keys_s: Sequence[Array], step_s: float) -> tuple[list[Integers], float]:
    """Number the frames that are nearest together; return the share that is far off its frame, too.

    A frame is a sample of the receiver with most, and what is nearest to it. What is half a step or more off
    all of its samples is put into frames of its own in the same way.
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
