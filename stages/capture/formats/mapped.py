"""What all readers by mapping share: which receivers there are, and their tracks put together."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from schemas.errors import InputError
from schemas.layout import Layout
from schemas.mapping import FileMapping
from skeleton.rotations import Array
from stages.capture.samples import ReadingOptions, Samples, did_you_mean, joined, segments_of_names

Integers = npt.NDArray[np.int64]

LONGEST_STEP_S, SHORTEST_STEP_S = 0.1, 2e-4
FARTHEST_MM, NEAREST_MM = 2000.0, 3.0
"""Median time steps, and distances of receivers on one body, beyond which a unit is doubted."""

_COMPARED_FRAMES = 1000

IDENTITY_POSE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Track:
    """One receiver's N samples.

    row : (N,) where each stands in the file; frame : (N,); time_s : (N,), NaN where there is none;
    numbers : (N, 7) as in Samples; marks : flag -> (N,) bool.
    """

    row: Integers
    frame: Integers
    time_s: Array
    numbers: Array
    marks: Mapping[str, npt.NDArray[np.bool_]] = field(default_factory=dict)

    def of(self, samples: npt.NDArray[Any]) -> Track:
        """Those samples alone, by index or by a boolean for each."""
        marks = {flag: marked[samples] for flag, marked in self.marks.items()}
        row, frame, time_s = self.row[samples], self.frame[samples], self.time_s[samples]
        return Track(row, frame, time_s, self.numbers[samples], marks)


def required_mapping(path: Path, options: ReadingOptions, what: str) -> FileMapping:
    """Give the mapping; InputError where there is none, `what` naming the kind of file."""
    if options.mapping is None:
        raise InputError(
            f"{path}: {what} needs a mapping that says its units and receivers; "
            f"`python -m stages.capture inspect {path} --write-mapping mapping.yaml` writes one to edit"
        )
    return options.mapping


def implied_mapping(where: str, format_: str, key: str, names: Sequence[str]) -> FileMapping:
    """The mapping of a file that describes itself: each of its names, under that key, is a segment.

    Raises InputError where there is none.
    """
    if not names:
        raise InputError(f"{where}: names nothing that has a position or an orientation")
    receivers = {name: {key: name} for name in names}
    return FileMapping(where, format_, 0.0, None, None, receivers, (), {})


def name_in_file(mapping: FileMapping, segment: str, key: str, known: Sequence[str], where: str) -> str:
    """What a file that describes itself calls a segment, by that key of its receiver in the mapping.

    Raises InputError where the mapping says nothing, or a name that is not known `where` names are looked up.
    """
    place = f"{mapping.where}: receivers.{segment}"
    if key not in mapping.receivers[segment]:
        raise InputError(f"{place}: has no {key}; say which of the file's it is")
    name = str(mapping.receivers[segment][key])
    if name not in known:
        raise InputError(
            f"{place}: {key} {name!r} is not in {where}, which has {', '.join(known) or 'none'}"
            f"{did_you_mean(name, known)}"
        )
    return name


def mapped_segments(mapping: FileMapping, layout: Layout) -> Integers:
    """Indices into `layout.measured` of the mapping's receivers and then of its fixed segments.

    Raises InputError where the layout does not know one.
    """
    names = [*mapping.receivers, *mapping.fixed]
    keys = [f"{mapping.where}: receivers"] * len(mapping.receivers)
    keys += [f"{mapping.where}: fixed"] * len(mapping.fixed)
    return segments_of_names(np.arange(len(names)), names, layout, keys.__getitem__)


def samples_of_tracks(
    tracks: Sequence[Track],
    mapping: FileMapping,
    layout: Layout,
    place: Callable[[int], str],
    notes: Iterable[str] = (),
) -> Samples:
    """Put the tracks of the mapping's receivers, in its order, and its fixed segments into samples.

    place : row -> file and line. A fixed segment has the identity pose in every frame that there is, at the
    time of the first receiver that has the frame. Times and distances that make a unit of the mapping
    doubtful are noted.
    """
    if mapping.config:  # a file that describes itself says its units, too
        notes = [*notes, *_time_doubts(tracks, mapping), *_distance_doubts(tracks, mapping)]
    frame, first = np.unique(np.concatenate([track.frame for track in tracks]), return_index=True)
    row, time_s = (np.concatenate([getattr(t, name) for t in tracks])[first] for name in ("row", "time_s"))
    still = Track(row, frame, time_s, np.tile(IDENTITY_POSE, (len(frame), 1)))
    segments = mapped_segments(mapping, layout)
    every = [*tracks, *(still for _ in mapping.fixed)]
    rows = np.concatenate([track.row for track in every])
    parts = [
        Samples(
            layout.measured,
            np.full(len(track.row), segment),
            track.frame,
            track.time_s,
            track.numbers,
            str,
            track.marks,
        )
        for segment, track in zip(segments.tolist(), every, strict=True)
    ]
    return replace(joined(parts), place=lambda sample: place(int(rows[sample])), notes=tuple(notes))


def _time_doubts(tracks: Sequence[Track], mapping: FileMapping) -> list[str]:
    steps = [np.diff(np.unique(track.time_s[np.isfinite(track.time_s)])) for track in tracks]
    medians = [float(np.median(step)) for step in steps if len(step)]
    step_s = float(np.median(medians)) if medians else LONGEST_STEP_S
    if SHORTEST_STEP_S <= step_s <= LONGEST_STEP_S:
        return []
    key = "time_unit" if "time_unit" in mapping.details else "the rate"
    return [f"the median time step is {step_s:.3g} s, a rate of {1 / step_s:.2g} Hz; is {key} right?"]


def _distance_doubts(tracks: Sequence[Track], mapping: FileMapping) -> list[str]:
    """Doubt the unit where the nearest or the farthest two receivers are not as on one body."""
    names = list(mapping.receivers)
    every = np.unique(np.concatenate([track.frame for track in tracks]))
    frames = every[:: max(1, len(every) // _COMPARED_FRAMES)]
    position_mm = np.full((len(tracks), len(frames), 3), np.nan)
    for place, track in zip(position_mm, tracks, strict=True):
        _, at, of = np.intersect1d(frames, track.frame, return_indices=True)
        place[at] = track.numbers[of, :3]
    median_mm = {}
    for i, j in itertools.combinations(range(len(tracks)), 2):
        distance = np.linalg.norm(position_mm[i] - position_mm[j], axis=-1)
        if np.isfinite(distance).any():
            median_mm[f"{names[i]} and {names[j]}"] = float(np.nanmedian(distance))
    if not median_mm:
        return []
    nearest, farthest = min(median_mm, key=median_mm.__getitem__), max(median_mm, key=median_mm.__getitem__)
    odd = [nearest] if median_mm[nearest] < NEAREST_MM else []
    odd += [farthest] if median_mm[farthest] > FARTHEST_MM else []
    return [
        f"{pair} are {median_mm[pair]:.3g} mm apart in the median; is position_unit "
        f"({mapping.config['position_unit']}) right?"
        for pair in odd
    ]
