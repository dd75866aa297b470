"""What all readers by mapping share: which receivers there are, and their tracks put together."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.mapping import FileMapping
from stages.capture.samples import ReadingOptions, Samples, segments_of_names

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


def required_mapping(path: Path, options: ReadingOptions, what: str) -> FileMapping:
    """Give the mapping; InputError where there is none, `what` naming the kind of file."""
    if options.mapping is None:
        raise InputError(
            f"{path}: {what} needs a mapping that says its units and receivers; "
            f"`python -m stages.capture inspect {path} --write-mapping mapping.yaml` writes one to edit"
        )
    return options.mapping


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
    segments = mapped_segments(mapping, layout)
    if mapping.config:  # a file that describes itself says its units, too
        notes = [*notes, *_time_doubts(tracks, mapping), *_distance_doubts(tracks, mapping)]
    frames, first = np.unique(np.concatenate([track.frame for track in tracks]), return_index=True)
    time_s = np.concatenate([track.time_s for track in tracks])[first]
    row = np.concatenate([track.row for track in tracks])[first]
    still = Track(row, frames, time_s, np.tile(IDENTITY_POSE, (len(frames), 1)))
    every = [*tracks, *(still for _ in mapping.fixed)]
    rows = np.concatenate([track.row for track in every])
    flags = {flag for track in tracks for flag in track.marks}
    unmarked = [np.zeros(len(track.row), bool) for track in every]
    return Samples(
        layout.measured,
        np.repeat(segments, [len(track.row) for track in every]),
        np.concatenate([track.frame for track in every]),
        np.concatenate([track.time_s for track in every]),
        np.concatenate([track.numbers for track in every]),
        lambda sample: place(int(rows[sample])),
        {
            flag: np.concatenate([t.marks.get(flag, none) for t, none in zip(every, unmarked, strict=True)])
            for flag in sorted(flags)
        },
        tuple(notes),
    )


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
    found = {}
    for one, other in itertools.combinations(range(len(tracks)), 2):
        distance = np.linalg.norm(position_mm[one] - position_mm[other], axis=-1)
        if np.isfinite(distance).any():
            found[f"{names[one]} and {names[other]}"] = float(np.nanmedian(distance))
    if not found:
        return []
    nearest, farthest = min(found, key=found.__getitem__), max(found, key=found.__getitem__)
    odd = [nearest] if found[nearest] < NEAREST_MM else []
    odd += [farthest] if found[farthest] > FARTHEST_MM else []
    return [
        f"{pair} are {found[pair]:.3g} mm apart in the median; is position_unit "
        f"({mapping.config['position_unit']}) right?"
        for pair in odd
    ]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Give the nearest known word as the end of a sentence; nothing where none is near."""
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), by_lower, 1)
    return f"; did you mean {by_lower[near[0]]!r}?" if near else ""
