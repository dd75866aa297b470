"""Common parts of all readers that use a mapping: receivers, orientations, tracks joined to samples."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, list_names, nearest
from shukotsu.hand.rotations import about_axis, conjugate, from_matrix, multiply, nearest_rotation
from shukotsu.readers.samples import Locate, Samples, join_samples, segments_of_names
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping

_RATE_OFF = 0.1
"""Largest difference between the times' rate and the mapping's rate, as the logarithm of their ratio."""
LARGEST = 1e20
"""Numbers above this, in any unit, are not measurements but markers of missing values."""
IDENTITY_POSE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Track:
    """One receiver's N samples.

    row : (N,) row of each sample in the file; frame : (N,) frame numbers; time_s : (N,), NaN if unknown;
    numbers : (N, 7) as in Samples; flags : flag -> (N,) bool.
    """

    row: Integers
    frame: Integers
    time_s: Array
    numbers: Array
    flags: Mapping[str, Bools] = field(default_factory=dict)

    def take(self, samples: npt.NDArray[Any]) -> Track:
        """Return the selected samples; samples : indices, or a boolean for each sample."""
        flags = {flag: marked[samples] for flag, marked in self.flags.items()}
        row, frame, time_s = self.row[samples], self.frame[samples], self.time_s[samples]
        return Track(row, frame, time_s, self.numbers[samples], flags)


Tracks = dict[str, Track]
"""By segment."""


def without_marks(values: Array) -> Array:
    """Replace numbers too large to be measurements by NaN: missing values such as NDI's -3.697e28."""
    return np.where(np.isfinite(values) & (np.abs(values) > LARGEST), np.nan, values)


def snake_case(name: str) -> str:
    """Convert a name to the style of segment names: IndexDistal and "index distal" become index_distal."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", parted.lower()).strip("_")


def implied_mapping(where: str, format_: str, names: Sequence[str]) -> FileMapping:
    """Build the mapping of a self-describing file, in which each receiver has the name of its segment.

    Raises InputError if there are no names.
    """
    if not names:
        raise InputError(f"{where}: has no receiver with a position or an orientation")
    receivers = {name: {"value": name} for name in names}
    return FileMapping(where, format_, 0.0, None, None, receivers, (), {})


def name_in_file(mapping: FileMapping, segment: str, names: Sequence[str], where: str) -> str:
    """Return the name that a segment's receiver has in a self-describing file: `value` in the mapping.

    names : all receivers in the file; where : the file, for messages. Raises InputError if the mapping has
    no value for the segment, or it is not among the names.
    """
    receiver = f"{mapping.where}: receivers.{segment}"
    if "value" not in mapping.receivers[segment]:
        raise InputError(f"{receiver}: has no value; set it to the receiver's name in the file")
    name = str(mapping.receivers[segment]["value"])
    if name not in names:
        present = f"{list_names(names)}{nearest(name, names)}"
        raise InputError(f"{receiver}: value {name!r} is not in {where}, which has {present}")
    return name


def segments_of(mapping: FileMapping, layout: Layout) -> Integers:
    """Return indices into `layout.measured` of the mapping's receivers, followed by its fixed segments.

    Raises InputError if the layout does not have one of them.
    """
    keys = ["receivers"] * len(mapping.receivers) + ["fixed"] * len(mapping.fixed)
    names = [*mapping.receivers, *mapping.fixed]
    return segments_of_names(np.arange(len(names)), names, layout, lambda at: f"{mapping.where}: {keys[at]}")


def samples_of_tracks(
    tracks: Sequence[Track],
    mapping: FileMapping,
    layout: Layout,
    locate: Locate,
    notes: Iterable[str] = (),
    losses: Iterable[str] = (),
) -> Samples:
    """Join the tracks of the mapping's receivers, in the mapping's order, and its fixed segments to samples.

    A fixed segment has the identity pose in every frame of the recording, at the time of the first track that
    has the frame.

    Parameters
    ----------
    tracks : sequence of Track
        A track for each of the mapping's receivers.
    mapping : FileMapping
        Receivers, fixed segments, axes and rate.
    layout : Layout
        Layout of the hand.
    locate : callable
        Function from a row to its file and line, for messages.
    notes, losses : iterables of sentences
        See `Samples`; losses are repeated as notes.

    Raises
    ------
    InputError
        If the rate of the tracks' times contradicts the mapping's rate.

    """
    _check_rate(tracks, mapping)
    marks = sum(int(((np.abs(t.numbers) > LARGEST) & np.isfinite(t.numbers)).sum()) for t in tracks)
    if marks:
        notes = [*notes, f"{marks} numbers beyond {LARGEST:g} are missing values: their poses stay gaps"]
        tracks = [replace(track, numbers=without_marks(track.numbers)) for track in tracks]
    frame, first = np.unique(np.concatenate([track.frame for track in tracks]), return_index=True)
    row, time_s = (np.concatenate([getattr(t, name) for t in tracks])[first] for name in ("row", "time_s"))
    still = Track(row, frame, time_s, np.tile(IDENTITY_POSE, (len(frame), 1)))
    segments = segments_of(mapping, layout)
    if mapping.position_axes != ("x", "y", "z"):
        columns = [*("xyz".index(axis[-1]) for axis in mapping.position_axes), 3, 4, 5, 6]
        signs = [-1.0 if axis.startswith("-") else 1.0 for axis in mapping.position_axes] + [1.0] * 4
        tracks = [replace(track, numbers=track.numbers[:, columns] * signs) for track in tracks]
    every = [*tracks, *(still for _ in mapping.fixed)]
    rows = np.concatenate([track.row for track in every])
    parts = [
        Samples(layout.measured, np.full(len(t.row), segment), t.frame, t.time_s, t.numbers, str, t.flags)
        for segment, t in zip(segments.tolist(), every, strict=True)
    ]
    where, lost = (lambda sample: locate(int(rows[sample]))), tuple(losses)
    return replace(join_samples(parts), locate=where, notes=(*notes, *lost), losses=lost)


def _check_rate(tracks: Sequence[Track], mapping: FileMapping) -> None:
    """Raise InputError if the mapping's rate agrees with neither the median nor the mean rate of the times.

    Either one suffices, because time stamps may be coarse, or rows lost. Receivers that are not in step are
    not checked: they are put on a grid of the mapping's rate.
    """
    if not mapping.rate_hz or not mapping.details.get("in_step", True):
        return
    with np.errstate(over="ignore"):
        times_s = [track.time_s[np.isfinite(track.time_s)] for track in tracks]
        steps_s = np.concatenate([np.diff(np.unique(finite_s)) for finite_s in times_s])
        if not len(steps_s):
            return
        count = sum(len(finite_s) - 1 for finite_s in times_s if len(finite_s))
        rates_hz = 1 / np.median(steps_s), count / steps_s.sum()
    if all(abs(np.log(rate_hz / mapping.rate_hz)) > _RATE_OFF for rate_hz in rates_hz):
        raise InputError(
            f"{mapping.where}: rate_hz: is {mapping.rate_hz:g}, but the times in the file have a rate of "
            f"{rates_hz[0]:.4g} Hz; find out which is right, or leave rate_hz out"
        )


TOLERANCE = 1e-2
"""Largest element of |R^T R - I| that is accepted as rounding of a rotation matrix."""


def quaternions(numbers: Array, orientation: Mapping[str, Any], locate: Locate) -> Array:
    """Convert orientations of any kind to quaternions from the receiver's to the transmitter's frame.

    Parameters
    ----------
    numbers : array, shape (N, 4), (N, 3) or (N, 9)
        Quaternions, Euler angles, rotation vectors or matrices (row by row), NaN where a value is missing.
    orientation : mapping
        The mapping's `orientation` group: kind, order, axes, unit, direction.
    locate : callable
        Function from a row to its file and line, for messages.

    Returns
    -------
    array, shape (N, 4)
        Quaternions (w, x, y, z). Those computed from other kinds are unit quaternions; their row is
        all NaN if a number is missing, all infinite if one is infinite.

    Raises
    ------
    InputError
        At the first matrix that is not a rotation.

    """
    kind = orientation["kind"]
    if kind == "quaternion":
        turned = numbers[:, [orientation["order"].index(part) for part in "wxyz"]]
    elif kind == "matrix":
        turned = from_matrix(proper_rotations(numbers.reshape(-1, 3, 3), locate))
    else:
        angles_rad = np.radians(numbers) if orientation["unit"] == "deg" else numbers
        angles_rad = np.where(np.isfinite(angles_rad), angles_rad, np.nan)
    if kind == "rotation-vector":
        half_rad = np.linalg.norm(angles_rad, axis=-1, keepdims=True) / 2
        turned = np.concatenate([np.cos(half_rad), np.sinc(half_rad / np.pi) / 2 * angles_rad], -1)
    if kind == "euler":  # Polhemus azimuth, elevation, roll are ZYX (LIBERTY user manual, attitude matrix)
        # R = R_a(first) R_b(second) R_c(third): intrinsic rotations, each about the already rotated axes
        axes = [np.eye(3)["XYZ".index(axis)] for axis in orientation["axes"]]
        first, second, third = (about_axis(axis, angles_rad[:, i]) for i, axis in enumerate(axes))
        turned = multiply(multiply(first, second), third)
    if kind != "quaternion":
        turned = np.where(np.isinf(numbers).any(-1, keepdims=True), np.inf, turned)
    return conjugate(turned) if orientation["rotates"] == "transmitter-to-receiver" else np.asarray(turned)


def proper_rotations(matrices: Array, locate: Locate) -> Array:
    """Return the nearest rotation to each matrix, shape (N, 3, 3); NaN if a number is missing or infinite.

    Raises InputError at the first matrix that is mirrored or deviates by more than TOLERANCE: it is not a
    rounded rotation, so that the nearest one would be arbitrary.
    """
    rotations = np.full(matrices.shape, np.nan)
    whole = np.isfinite(matrices).all((-2, -1))
    some = matrices[whole]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(np.swapaxes(some, -1, -2) @ some - np.eye(3)).max((-2, -1))
        mirrored = np.linalg.det(some) < 0
    bad = ~(off <= TOLERANCE) | mirrored
    if bad.any():
        first = int(np.argmax(bad))
        what = (
            f"the matrix is not a rotation: its columns are off unit length and right angles by "
            f"{off[first]:.3g}; expected {TOLERANCE} at most; check that these are the right columns"
        )
        if mirrored[first] and off[first] <= TOLERANCE:
            what = (
                "the rotation is mirrored (determinant -1); expected a right-handed one (+1); "
                "an axis was negated somewhere, so export the file again in a right-handed coordinate system"
            )
        if not some[first].any():
            what = "the rotation is all zeros; zeros that stand for missing values must be written as NaN"
        raise InputError(f"{locate(int(np.flatnonzero(whole)[first]))}: {what}")
    rotations[whole] = nearest_rotation(some)
    return rotations
