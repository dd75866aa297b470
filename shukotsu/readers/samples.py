"""Output of every reader: the samples of the receivers, each assigned to the segment that carries it."""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, count_of, nearest, shorten
from shukotsu.study.layout import Layout

Locate = Callable[[int], str]
"""Function from a sample or a row to its file and line, for messages."""


@dataclass(frozen=True)
class Samples:
    """N samples in the order of the recording; their values are not checked yet.

    segments : the layout's measured segments, in its order; segment : (N,) indices into them.
    frame : (N,) the tracker's frame number; time_s : (N,) device time, NaN if missing.
    numbers : (N, 7) x, y, z in mm, then w, x, y, z of the quaternion (receiver to transmitter frame), NaN if
    missing; quaternions are not necessarily unit.
    locate : function from a sample to its file and line, for messages.
    flags : flags that the reader sets on single samples, flag (a key of segment_rows.FLAGS) -> (N,) bool.
    notes : remarks on the whole recording, a sentence each; for stderr and the table's metadata.
    losses : those notes that a study reports as findings: data that are lost, damaged or doubtful.
    missing_frames : number of frames that the recording should contain but does not.
    tracker : tracker named in the file, or "".
    clusters : values of a finding for each marker cluster that is not rigid.
    orientation : kind of orientation if the reader alone defines it, see `Declared`; "" if the mapping does,
    or if a file without one has the columns qw, qx, qy and qz.
    """

    segments: tuple[str, ...]
    segment: Integers
    frame: Integers
    time_s: Array
    numbers: Array
    locate: Locate
    flags: Mapping[str, Bools] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    missing_frames: int = 0
    tracker: str = ""
    orientation: str = ""
    clusters: tuple[Mapping[str, Any], ...] = ()

    def take(self, rows: slice) -> Samples:
        """Return a slice of the samples, with the remarks on the whole recording."""
        flags = {flag: marked[rows] for flag, marked in self.flags.items()}
        return replace(self, flags=flags, **{name: getattr(self, name)[rows] for name in _ARRAYS})


_ARRAYS = ("segment", "frame", "time_s", "numbers")
"""Array fields with one entry per sample."""


def join_samples(parts: Iterable[Samples]) -> Samples:
    """Concatenate the parts of a recording (at least one) in order."""
    every = list(parts)
    starts = [0, *itertools.accumulate(len(part.segment) for part in every)]

    def locate(sample: int) -> str:
        part = bisect.bisect_right(starts, sample) - 1
        return every[part].locate(sample - starts[part])

    joined: Any = {name: np.concatenate([getattr(part, name) for part in every]) for name in _ARRAYS}
    joined["flags"] = {
        flag: np.concatenate([p.flags.get(flag, np.zeros(len(p.segment), bool)) for p in every])
        for flag in sorted({flag for part in every for flag in part.flags})
    }
    for name in ("notes", "losses", "clusters"):
        joined[name] = tuple(itertools.chain.from_iterable(getattr(part, name) for part in every))
    for name in ("tracker", "orientation"):
        joined[name] = next(filter(None, (getattr(part, name) for part in every)), "")
    missing_frames = sum(part.missing_frames for part in every)
    return Samples(every[0].segments, **joined, locate=locate, missing_frames=missing_frames)


def unwrapped_frames(frames: Sequence[Integers], times_s: Sequence[Array]) -> tuple[list[Integers], str]:
    """Unwrap frame numbers of a counter of 8, 16 or 32 bits that overflowed; return them and a note.

    If the step at a supposed overflow differs from the other steps, so that it may be something else, the
    numbers are returned unchanged with an empty note.

    frames, times_s : of each receiver, in the order of its rows; times may be NaN.
    """
    most = max(range(len(frames)), key=lambda receiver: len(frames[receiver]))
    frame, time_s = frames[most], times_s[most]
    size = next((1 << bits for bits in (8, 16, 32) if max(map(np.max, frames)) < 1 << bits), 0)
    steps = np.diff(frame)
    full = steps < -0.75 * size
    steps = steps + size * full
    if not size or not full.any() or steps.min() < 0 or frame.min() < 0:
        return [*frames], ""
    timed = bool(np.isfinite(time_s).all())
    rates = np.diff(time_s) / np.maximum(steps, 1) if timed else steps
    alike = np.abs(rates / np.median(rates) - 1) < 0.5 if timed else steps < 4 * np.median(steps)
    if not alike[full].all():
        return [*frames], ""
    counted = frame + size * np.cumsum([0, *full])
    out = []
    for other, other_s in zip(frames, times_s, strict=True):
        turns = np.cumsum([0, *(np.diff(other) < -0.75 * size)])[: len(other)]
        if timed and np.isfinite(other_s).all():  # it may start late, or miss a whole cycle of the counter
            turns = np.rint((np.interp(other_s, time_s, counted) - other) / size).astype(np.int64)
        out.append(other + size * turns)
    times = count_of(full.sum(), "time")
    return out, f"the frame counter restarts after {size - 1}, {times}; frame numbers are continued"


def segments_of_names(codes: Integers, names: Sequence[str], layout: Layout, locate: Locate) -> Integers:
    """Return the index into `layout.measured` of each sample, (N,), from the recording's segment names.

    codes : (N,) indices into `names`. Raises InputError at the first sample of an unknown segment.
    """
    worn = layout.measured
    segment = np.array([worn.index(name) if name in worn else -1 for name in names], np.int64)[codes]
    if (segment < 0).any():
        first = int(np.argmax(segment < 0))
        name = names[codes[first]]
        why = f"is not in layout {layout.name}, which has {', '.join(worn)}{nearest(name, worn)}"
        if name in layout.segments:
            why = f"carries no receiver in layout {layout.name} (measured: false); leave its rows out"
        raise InputError(f"{locate(first)}: segment {shorten(name, 60)!r} {why}")
    return segment


def segments_of_stations(stations: Integers, layout: Layout, locate: Locate) -> Integers:
    """Return the index into `layout.measured` of each sample, (N,), from the tracker's station numbers.

    Raises InputError at the first sample of a station that is not in the layout.
    """
    index_of = {layout.segments[name].receiver: index for index, name in enumerate(layout.measured)}
    index_of.pop(None, None)
    numbers, codes = np.unique(stations, return_inverse=True)
    segment = np.array([index_of.get(int(number), -1) for number in numbers], np.int64)[codes]
    if (segment < 0).any():
        first = int(np.argmax(segment < 0))
        numbered = ", ".join(str(number) for number in sorted(filter(None, index_of))) or "none"
        why = (
            f"sits on no segment of layout {layout.name}, which has {numbered}; leave its rows out or add "
            "the receiver to the layout"
        )
        if stations[first] in [worn.left_receiver for worn in layout.segments.values()]:
            why = f"sits on the other hand in layout {layout.name}; leave that hand's rows out"
        raise InputError(f"{locate(first)}: receiver {stations[first]} {why}")
    return segment
