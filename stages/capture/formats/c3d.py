"""C3D files by mapping, read by ezc3d: clusters of markers as rigid segments, or poses of group ROTATION."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError, listed
from shukotsu.files.limits import RATES_HZ, check_regular
from shukotsu.files.text_files import reading
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.mapping import FileMapping
from shukotsu.schemas.units import UNIT_NAMES
from shukotsu.skeleton.rotations import Array, from_matrix
from shukotsu.stages.capture.formats.clusters import cluster_poses
from shukotsu.stages.capture.formats.mapped import (
    Integers,
    Track,
    mapped_segments,
    required_mapping,
    samples_of_tracks,
    without_marks,
)
from shukotsu.stages.capture.formats.orientation import proper_rotations
from shukotsu.stages.capture.samples import Samples, did_you_mean

_BLOCK = 512
_MOST_FRAMES = 65535
"""What 16 bits count; as a count it means so many or more."""


@dataclass(frozen=True)
class C3dFile:
    """What of a C3D file matters here.

    points : (T, P, 3) in the file's unit, NaN where a point is not seen; labels : of the P points.
    matrices : (T', R, 4, 4) of the ROTATION group, T' a whole multiple of T; rotation_labels : of the R.
    unit : mm, cm, m or inch, or the file's own word where it is none of these; empty where it states none.
    rate_hz : NaN where the file states none. first_frame : number of the first frame stored, from 1.
    doubts : a sentence where the file goes on behind the frames that it counts.
    """

    path: Path
    points: Array
    labels: tuple[str, ...]
    matrices: Array
    rotation_labels: tuple[str, ...]
    unit: str
    rate_hz: float
    first_frame: int
    doubts: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """Return the number of stored frames."""
        return len(self.points)


def read_c3d(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read clusters and rotations as the mapping names them (C3D user guide, www.c3d.org).

    Frames keep the file's numbers, times count from the first frame stored. Raises InputError where the
    file is no C3D file, states another unit, or has no such label.
    """
    mapping = required_mapping(path, mapping, "a C3D file")
    mapped_segments(mapping, layout)
    file = open_c3d(path)
    mapped_unit = mapping.config["position_unit"]
    if file.unit and file.unit != mapped_unit:
        raise InputError(
            f"{path}: states its unit as {file.unit!r} (POINT:UNITS), but {mapping.where} says "
            f"{mapped_unit!r}; correct the mapping, or the file if its unit is wrong"
        )
    first, last = mapping.details.get("first_frame", 1), mapping.details.get("last_frame", file.frames)
    if not 1 <= first <= last <= file.frames:
        raise InputError(
            f"{mapping.where}: c3d: frames {first} to {last} are not in {path}, which has frames 1 to "
            f"{file.frames}"
        )
    window = np.arange(first - 1, last)  # from 0 at the first frame stored
    tracks, notes = [], []
    for segment, receiver in mapping.receivers.items():
        if "markers" in receiver:
            track, note = _of_cluster(file, segment, receiver["markers"], window, mapping)
        else:
            track, note = _of_rotation(file, segment, receiver["rotation"], window, mapping)
        tracks.append(track)
        notes += [note] if note else []
    return samples_of_tracks(
        tracks, mapping, layout, lambda index: f"{path}: frame {file.first_frame + index}", notes, file.doubts
    )


def open_c3d(path: Path) -> C3dFile:
    """Read a C3D file. Raises InputError where it is absent, is none, or is cut off."""
    import ezc3d

    with reading(path, "a C3D file"):
        size = check_regular(path, "a C3D file")
        with path.open("rb") as stream:
            head = stream.read(_BLOCK)
    try:
        content = ezc3d.c3d(str(path))
    except MemoryError:
        raise
    except Exception as error:  # ezc3d raises whatever its code runs into
        why = str(error).removesuffix(": iostream error")
        raise InputError(f"{path}: not a readable C3D file ({why}); copy it again") from error
    parameters = content["parameters"]
    points = np.asarray(content["data"]["points"][:3], float).transpose(
        2, 1, 0
    )  # NaN where the residual is -1
    rotations = np.asarray(content["data"]["rotations"], float).transpose(3, 2, 0, 1)
    per_frame, analogs, first, last, _, scale, start = struct.unpack_from("<HHHHHfH", head, 2)
    if not first <= last < _MOST_FRAMES:  # what is read to the file's end has zeros that fill its last block
        points = points[: np.flatnonzero((points != 0).any((1, 2)))[-1:].sum() + 1]
    counts = [last - first + 1 if last < _MOST_FRAMES else 0]
    counts += [int(count) for count in parameters["POINT"].get("LONG_FRAMES", {}).get("value", ())]
    if "ACTUAL_END_FIELD" in parameters.get("TRIAL", {}):
        low, high = (parameters["TRIAL"]["ACTUAL_END_FIELD"]["value"].ravel() % (1 << 16)).tolist()[:2]
        counts.append(low + (high << 16) - first + 1)
    if len(points) < max(counts):
        raise InputError(
            f"{path}: is cut off: it has {len(points)} of the {max(counts)} frames that it counts; "
            "copy it again"
        )
    if not len(points):
        raise InputError(f"{path}: has no frames; export it again")
    frame_bytes = (4 * per_frame + analogs) * (4 if scale < 0 else 2)
    more_bytes = size - _BLOCK * (start - 1) - len(points) * frame_bytes
    doubt = f"{len(points)} frames are read, but the file goes on behind them; see that this is all"
    unit = "".join(parameters["POINT"].get("UNITS", {}).get("value", [])[:1]).strip()
    rate = float(np.ravel(parameters["POINT"].get("RATE", {}).get("value", np.nan))[0])
    return C3dFile(
        path,
        without_marks(points),
        _labels(parameters.get("POINT", {})),
        rotations,
        _labels(parameters.get("ROTATION", {})),
        UNIT_NAMES.get(unit.lower(), unit),
        rate if RATES_HZ[0] <= rate <= RATES_HZ[1] else float("nan"),
        first,
        (doubt,) if more_bytes > _BLOCK and not rotations.size else (),
    )


def _labels(group: Any) -> tuple[str, ...]:
    """Labels of a group; beyond 255 they run on in LABELS2, LABELS3 and so on."""
    names = (f"LABELS{number}" for number in ("", *range(2, 20)))
    return tuple(label.strip() for name in names if name in group for label in group[name]["value"])


def _track(file: C3dFile, window: Integers, mapping: FileMapping, poses: Array, misfit: Array) -> Track:
    rate = file.rate_hz if np.isfinite(file.rate_hz) else mapping.rate_hz or float("nan")
    return Track(
        window,
        file.first_frame + window,
        window / rate,
        poses,
        {"misfit": misfit > mapping.details["misfit_mm"]},
    )


def _of_cluster(
    file: C3dFile, segment: str, markers: Sequence[str], window: Integers, mapping: FileMapping
) -> tuple[Track, str]:
    place = f"{mapping.where}: receivers.{segment}.markers"
    columns = [_index(file.path, file.labels, marker, "marker", place) for marker in markers]
    points_mm = file.points[window][:, columns] * mapping.mm_per_unit
    unseen = [
        marker
        for marker, seen in zip(markers, np.asarray(np.isfinite(points_mm).any((0, 2))), strict=True)
        if not seen
    ]
    if unseen:
        raise InputError(
            f"{file.path}: marker {unseen[0]!r} is seen in no frame read; leave it out of {place}"
        )
    cluster = cluster_poses(points_mm, f"{file.path}: cluster {segment}")
    poses = np.concatenate([cluster.position_mm, from_matrix(cluster.rotation)], -1)
    misfit, left = cluster.misfit_mm, cluster.residual_mm[np.isfinite(cluster.residual_mm)]
    note = (
        f"cluster {segment}: {len(cluster.shape_mm)} markers, residual "
        f"{np.sqrt(np.mean(left**2)):.2g} mm rms, "
        f"{left.max():.2g} mm max, {np.isfinite(misfit).sum()} of {len(misfit)} frames"
    )
    return _track(file, window, mapping, poses, misfit), note


def _of_rotation(
    file: C3dFile, segment: str, label: str, window: Integers, mapping: FileMapping
) -> tuple[Track, str]:
    """Take the matrix of each point frame; where the group is sampled faster, those in step with points."""
    place = f"{mapping.where}: receivers.{segment}.rotation"
    column = _index(file.path, file.rotation_labels, label, "rotation", place)
    ratio, odd = divmod(len(file.matrices), file.frames)
    if odd or not ratio:
        raise InputError(
            f"{file.path}: has {len(file.matrices)} rotations for {file.frames} frames; "
            "expected a whole multiple"
        )
    matrices = file.matrices[window * ratio, column]
    rotation = proper_rotations(
        matrices[:, :3, :3],
        lambda index: f"{file.path}: frame {file.first_frame + window[index]}, rotation {label}",
    )
    poses = np.concatenate([matrices[:, :3, 3] * mapping.mm_per_unit, from_matrix(rotation)], -1)
    note = f"rotation {label}: {ratio} samples a frame, the first of them is used" if ratio > 1 else ""
    return _track(file, window, mapping, poses, np.full(len(window), np.nan)), note


def _index(path: Path, labels: Sequence[str], label: str, what: str, place: str) -> int:
    if labels.count(label) == 1:
        return labels.index(label)
    if label in labels:
        raise InputError(f"{path}: {what} {label!r} stands in the file more than once; {place} needs one")
    guess = did_you_mean(label, labels)
    known = "" if guess else f", which has {listed(labels)}"
    raise InputError(f"{place}: {what} {label!r} is not in {path}{known}{guess}")
