"""Read C3D files by a mapping, with ezc3d: marker clusters as rigid segments, or poses of group ROTATION."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from shukotsu.arrays import Array, Bools, Integers
from shukotsu.errors import InputError, count_of, list_names, nearest
from shukotsu.hand.rotations import from_matrix, nearest_rotation
from shukotsu.readers.formats import mapped
from shukotsu.readers.samples import Samples
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping
from shukotsu.tables.limits import RATES_HZ, UNIT_NAMES, check_regular
from shukotsu.tables.text_files import reading

_BLOCK = 512
_MOST_FRAMES = 65535
"""Largest frame number that the 16-bit header fields can hold; larger numbers are also stored as this one."""


@dataclass(frozen=True)
class C3dFile:
    """Content of a C3D file, as far as it is used here.

    points : (T, P, 3) in the file's unit, NaN where a point is not visible; labels : names of the P points.
    matrices : (T', R, 4, 4) of the ROTATION group, T' a multiple of T; rotation_labels : names of the R.
    unit : mm, cm, m or inch; any other unit as the file spells it; empty if the file states no unit.
    rate_hz : NaN if the file states no plausible rate. first_frame : number of the first stored frame.
    doubts : a sentence for each doubt: data after the last frame, points at exactly 0, 0, 0.
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


def read_c3d(path: Path, layout: Layout, mapping: FileMapping) -> Samples:
    """Read the clusters and rotations that the mapping names (C3D user guide, www.c3d.org).

    Frames keep the file's numbers; time is 0 at the first stored frame. Raises InputError if the file is
    not a C3D file, states another unit than the mapping, or lacks a label that the mapping names.
    """
    mapped.segments_of(mapping, layout)
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
    window = np.arange(first - 1, last)  # row numbers, 0 is the first stored frame
    rate_hz = file.rate_hz if np.isfinite(file.rate_hz) else mapping.rate_hz or float("nan")
    tracks, notes, clusters = [], [], []
    for segment, receiver in mapping.receivers.items():
        if "markers" in receiver:
            poses, odd, note, loose = _of_cluster(file, segment, receiver["markers"], window, mapping)
            clusters += loose
        else:
            poses, note = _of_rotation(file, segment, receiver["rotation"], window, mapping)
            odd = np.zeros(len(window), bool)
        frame, time_s = file.first_frame + window, window / rate_hz
        tracks.append(mapped.Track(window, frame, time_s, poses, {"misfit": odd}))
        notes += [note] if note else []

    def locate(index: int) -> str:
        return f"{path}: frame {file.first_frame + index}"

    samples = mapped.samples_of_tracks(tracks, mapping, layout, locate, notes, file.doubts)
    return replace(samples, clusters=tuple(clusters))


RIGID_VARIATION = 0.06
"""Largest variation of a distance in a rigid group, without noise, as a share of the distance; it must also
stay below five times this share of the travel of whichever of the two markers moves less."""
_FRAMES, _MARKERS, _DISTANCES = 100, 200, 2_000_000
_NOISE_WIDTH = 4.1
"""Width between the 2nd and 98th percentile of normal noise, in standard deviations."""


def rigid_groups(points: Array, segments: Sequence[str] | None = None) -> list[list[int]]:
    """Find groups of three or more markers whose mutual distances stay constant in nearly all frames.

    Noise is estimated from the second difference of a distance over three consecutive frames, because joints
    move slowly.

    Parameters
    ----------
    points : array, shape (T, P, 3)
        Marker positions, NaN where a marker is not visible.
    segments : sequence of P names, optional
        Segment that each label names, or "". Markers of different segments never share a group; markers of
        one segment may form a group even if they do not move.

    Returns
    -------
    list of list of int
        Marker indices of each group; empty with fewer than 3 frames or markers, or more than `_MARKERS`
        markers.

    """
    markers = points.shape[1]
    if not 3 <= markers <= _MARKERS or len(points) < 3:
        return []
    first, second = np.triu_indices(markers, 1)
    step = 1 + len(points) * len(first) // _DISTANCES
    starts = np.arange(0, len(points) - 2, max(1, min(step, len(points) // _FRAMES)))
    triples = points[starts[:, None] + np.arange(3)]
    distance = np.linalg.norm(triples[:, :, first] - triples[:, :, second], axis=-1)
    seen = np.flatnonzero(np.isfinite(distance).all(1).mean(0) > 0.1)
    if not len(seen):
        return []
    distance, first_seen, second_seen = distance[..., seen], first[seen], second[seen]
    low, middle, high = np.nanpercentile(distance.reshape(-1, len(seen)), [2, 50, 98], axis=0)
    noise = np.nanmedian(np.abs(np.diff(distance, 2, axis=1)[:, 0]), axis=0) / 0.6745 / np.sqrt(6)
    moved = np.full(markers, 0.0)
    for index in np.unique([first_seen, second_seen]):
        moved[index] = np.subtract(*np.nanpercentile(triples[:, :, index], [98, 2], axis=(0, 1))).max()
    width = _NOISE_WIDTH * noise
    steps = np.minimum(moved[first_seen], moved[second_seen]) - width
    names = np.array(segments or [""] * markers)
    named = (names[first] != "") & (names[second] != "")
    alike = (named & (names[first] == names[second]))[seen]
    least = np.where(alike, middle, np.minimum(middle, 5 * steps))
    variation = np.full(len(first), 1e9)
    variation[seen] = np.maximum(high - low - width, 0.05 * width) / np.maximum(least, 1e-12)
    variation[named & (names[first] != names[second])] = 1e9
    group = fcluster(linkage(variation, "complete"), RIGID_VARIATION, "distance")
    groups = [np.flatnonzero(group == number).tolist() for number in range(1, group.max() + 1)]
    return sorted(members for members in groups if len(members) >= 3)


THINNEST = 0.05
"""Markers whose width is less than this share of their length count as collinear: rotation about the line is
noise."""
_ROUNDS = 100
_SETTLED_MM = 1e-5


@dataclass(frozen=True)
class ClusterPoses:
    """Poses of a cluster of M markers in T frames, NaN where too few markers are visible.

    rotation : (T, 3, 3) cluster to laboratory frame; position_mm : (T, 3) fitted position of the first
    marker. shape_mm : (M, 3) the markers in the cluster's frame: the first is the origin, x points to the
    second, the third is in the x-y plane with y > 0. residual_mm : (T, M) distance of each marker from its
    fitted position, NaN where it is not used; misfit_mm : (T,) rms of these distances.
    """

    rotation: Array
    position_mm: Array
    shape_mm: Array
    residual_mm: Array

    @property
    def misfit_mm(self) -> Array:
        """Rms distance of the markers from the fitted shape, (T,); NaN in frames without a pose."""
        seen = np.isfinite(self.residual_mm)
        square = np.where(seen, self.residual_mm, 0.0) ** 2
        return np.asarray(np.sqrt(square.sum(1) / np.where(seen.any(1), seen.sum(1), np.nan)))


def cluster_poses(markers_mm: Array, what: str) -> ClusterPoses:
    """Fit one rigid shape to a cluster's markers and compute its pose in every frame.

    A frame needs three markers that are not collinear.

    Parameters
    ----------
    markers_mm : array, shape (T, M, 3), M >= 3
        Positions in the laboratory frame, NaN where a marker is not visible.
    what : str
        Beginning of error messages: the file and the cluster.

    Raises
    ------
    InputError
        If no frame has three such markers, a marker is never visible together with three markers of known
        position, or the cluster is collinear.

    """
    seen: Bools = np.asarray(np.isfinite(markers_mm).all(-1))
    # the shape in the cluster's frame: first marker at the origin, second on x, third in the x-y plane
    shape = _mean_shape(np.where(seen[..., None], markers_mm, 0.0), seen, what)
    along, across = shape[1] - shape[0], shape[2] - shape[0]
    if _width(shape[:3]) < THINNEST:
        raise InputError(
            f"{what}: its first three markers are on a line, but they define its axes; list others first"
        )
    x = along / np.linalg.norm(along)
    z = np.cross(x, across)
    z /= np.linalg.norm(z)
    shape = np.asarray((shape - shape[0]) @ np.stack([x, np.cross(z, x), z], 1))
    fits = seen & _spread_out(shape, seen)[:, None]
    points = np.where(fits[..., None], markers_mm, 0.0)
    rotation, position = _fit(shape, points, fits.astype(float))
    left = np.linalg.norm(points - (shape @ np.swapaxes(rotation, 1, 2) + position[:, None]), axis=-1)
    posed = fits.any(1)
    rotation[~posed] = np.nan
    position[~posed] = np.nan
    return ClusterPoses(rotation, position, shape, np.where(fits, left, np.nan))


def _mean_shape(points: Array, seen: Bools, what: str) -> Array:
    """Return the mean shape (M, 3) of the superimposed frames, in the laboratory pose of one of them.

    The iteration starts from the most typical frame of those with the most visible markers; frames that fit
    badly, for example with swapped markers, get a lower weight.
    """
    patterns, codes, counts = np.unique(seen, axis=0, return_inverse=True, return_counts=True)
    most = int(np.lexsort((counts, patterns.sum(1)))[-1])
    alike = np.flatnonzero(codes.ravel() == most)
    apart = points[alike][:, patterns[most]]
    apart = np.linalg.norm(apart[:, :, None] - apart[:, None], axis=-1)
    start = int(alike[np.argmin(np.abs(apart - np.median(apart, axis=0)).sum((1, 2)))])
    shape: Array = points[start]
    placed: Bools = seen[start]
    if placed.sum() < 3:
        raise InputError(f"{what}: no frame has three of its markers; check the labels and the frames read")
    if _width(shape[placed]) < THINNEST:
        raise InputError(
            f"{what}: its markers are on a line (within {THINNEST} of its length), so the rotation about "
            "that line is unknown; add a marker off the line"
        )
    for _ in range(_ROUNDS):
        usable = seen & placed & _spread_out(shape, seen & placed)[:, None]
        if not usable.any():
            raise InputError(f"{what}: its markers have no common rigid shape over the frames read")
        rotation, position = _fit(shape, points, usable.astype(float))
        back = (points - position[:, None]) @ rotation
        square = np.where(usable, ((back - shape) ** 2).sum(-1), 0.0).sum(1)
        posed = usable.any(1)
        misfit = square / np.maximum(usable.sum(1), 1)
        # `misfit` is a mean square: a frame whose rms is three times the median gets half the weight
        scale = 9 * float(np.median(misfit[posed])) + _SETTLED_MM**2
        weight = np.where(posed, 1 / (1 + misfit / scale), 0.0)[:, None] * seen
        reached = weight.sum(0) > 0
        mean = np.einsum("tm,tmi->mi", weight, back) / np.where(reached, weight.sum(0), 1.0)[:, None]
        settled = bool((reached == placed).all()) and float(np.abs(mean - shape).max()) < _SETTLED_MM
        shape, placed = np.where(reached[:, None], mean, shape), reached
        if settled:
            break
    if not placed.all():
        raise InputError(
            f"{what}: its marker {int(np.argmin(placed)) + 1} is never seen together with three others of "
            "known position; leave it out of the mapping"
        )
    return shape


def _fit(shape: Array, points: Array, weight: Array) -> tuple[Array, Array]:
    """Return rotations (T, 3, 3) and translations (T, 3) that map the shape (M, 3) to points (T, M, 3)."""
    total = np.maximum(weight.sum(1), 1.0)[:, None]
    middle, centre = weight @ shape / total, np.einsum("tm,tmi->ti", weight, points) / total
    spread = np.einsum("tm,tmi,tmj->tij", weight, points - centre[:, None], shape - middle[:, None])
    rotation = nearest_rotation(spread)
    return rotation, centre - np.einsum("tij,tj->ti", rotation, middle)


def _spread_out(shape: Array, seen: Bools) -> Bools:
    """Return for each frame whether the markers in `seen` (T, M) determine a rotation, shape (T,)."""
    patterns, codes = np.unique(seen, axis=0, return_inverse=True)
    good = [pattern.sum() >= 3 and _width(shape[pattern]) >= THINNEST for pattern in patterns]
    return np.asarray(np.array(good)[codes.ravel()], bool)


def _width(points: Array) -> float:
    """Return the ratio of width to length of points (M, 3): 0 if they are collinear."""
    length, width = np.linalg.svd(points - points.mean(0), compute_uv=False)[:2]
    return float(width / length) if length > 0 else 0.0


def _check_parameters(path: Path, records: bytes, size: int) -> None:
    """Raise InputError if a parameter claims more bytes than the file has: ezc3d would read on for hours.

    A record consists of the name's length, the group's number, the name and the offset of the next record. In
    a parameter's record (group number above 0) follow bytes per value, number of dimensions, and dimensions.
    """
    order = ">H" if records[3:4] == b"\x56" else "<H"  # files of MIPS or SGI processors are big-endian
    at = 4
    while at + 2 < len(records) and records[at]:
        length, group = (abs(n) for n in struct.unpack_from("bb", records, at))
        name, way = records[at + 2 : at + 2 + length], at + 2 + length
        follows = records[way + 2 : way + 258].ljust(256, b"\0")
        value_bytes, n_dimensions, *rest = struct.unpack("b255B", follows)
        if records[at + 1] < 128 and abs(value_bytes) * math.prod(n or 1 for n in rest[:n_dimensions]) > size:
            raise InputError(
                f"{path}: not a readable C3D file (parameter {name.decode(errors='replace')} of group "
                f"{group} claims to be longer than the file); copy it again"
            )
        at = way + (struct.unpack_from(order, records.ljust(way + 2), way)[0] or len(records))


def open_c3d(path: Path) -> C3dFile:
    """Read a C3D file. Raises InputError if it does not exist, is not a C3D file or is truncated."""
    import ezc3d

    with reading(path, "a C3D file"):
        size = check_regular(path, "a C3D file")
        with path.open("rb") as stream:
            head = stream.read(_BLOCK)
            stream.seek((head[0] - 1) * _BLOCK if head else 0)
            _check_parameters(path, stream.read(255 * _BLOCK), size)
    try:
        content = ezc3d.c3d(str(path))
    except MemoryError:
        raise
    except Exception as error:  # ezc3d has no exception type of its own for unreadable files
        why = str(error).removesuffix(": iostream error")
        raise InputError(f"{path}: not a readable C3D file ({why}); copy it again") from error
    parameters = content["parameters"]
    # ezc3d returns NaN for a point whose residual is -1
    points = np.asarray(content["data"]["points"][:3], float).transpose(2, 1, 0)
    rotations = np.asarray(content["data"]["rotations"], float).transpose(3, 2, 0, 1)
    per_frame, analogs, first, last, _, scale, start = struct.unpack_from("<HHHHHfH", head, 2)
    # without a usable frame count ezc3d reads to the end of the file, including the zeros that pad its last
    # block
    if not first <= last < _MOST_FRAMES:
        filled = np.flatnonzero((points != 0).any((1, 2)))
        points = points[: filled[-1] + 1 if len(filled) else 1]
    zeros = (points == 0).all(-1)
    counts = [last - first + 1 if last < _MOST_FRAMES else 0]
    counts += [int(count) for count in parameters["POINT"].get("LONG_FRAMES", {}).get("value", ())]
    if "ACTUAL_END_FIELD" in parameters.get("TRIAL", {}):
        low, high = (parameters["TRIAL"]["ACTUAL_END_FIELD"]["value"].ravel() % (1 << 16)).tolist()[:2]
        counts.append(low + (high << 16) - first + 1)
    if len(points) < max(counts):
        raise InputError(
            f"{path}: is cut off: it has {len(points)} of the {count_of(max(counts), 'frame')} that it "
            "declares; copy it again"
        )
    if not len(points):
        raise InputError(f"{path}: has no frames; export it again")
    frame_bytes = (4 * per_frame + analogs) * (4 if scale < 0 else 2)
    more_bytes = size - _BLOCK * (start - 1) - len(points) * frame_bytes
    at_zero = int(zeros.sum())
    taken = f"{count_of(at_zero, 'point')} at 0, 0, 0 {'is' if at_zero == 1 else 'are'} treated as not seen"
    doubts = [taken] if at_zero else []
    if more_bytes > _BLOCK and not rotations.size:
        read = f"{count_of(len(points), 'frame', 'are')} read"
        doubts.append(f"{read}, but more data follow in the file; check that no frame is missing")
    unit = "".join(parameters["POINT"].get("UNITS", {}).get("value", [])[:1]).strip()
    unit = UNIT_NAMES.get(unit.lower(), unit)
    rate_hz = float(np.ravel(parameters["POINT"].get("RATE", {}).get("value", np.nan))[0])
    rate_hz = rate_hz if RATES_HZ[0] <= rate_hz <= RATES_HZ[1] else float("nan")
    points = mapped.without_marks(np.where(zeros[..., None], np.nan, points))
    labels, of_rotations = (_labels(parameters.get(group, {})) for group in ("POINT", "ROTATION"))
    return C3dFile(path, points, labels, rotations, of_rotations, unit, rate_hz, first, tuple(doubts))


def _labels(group: Any) -> tuple[str, ...]:
    """Return the labels of a group; those after the 255th are in LABELS2, LABELS3 and so on."""
    names = (f"LABELS{number}" for number in ("", *range(2, 20)))
    return tuple(label.strip() for name in names if name in group for label in group[name]["value"])


def _of_cluster(
    file: C3dFile, segment: str, markers: Sequence[str], window: Integers, mapping: FileMapping
) -> tuple[Array, Bools, str, list[dict[str, Any]]]:
    """Return a cluster's poses (T, 7), where it misfits (T,), a note on both, and the values of a finding.

    The list of findings is empty if no frame exceeds the mapping's `misfit_mm`; else its one entry reports
    which of the markers do form rigid groups.
    """
    key = f"{mapping.where}: receivers.{segment}.markers"
    columns = [_index(file.path, file.labels, marker, "marker", key) for marker in markers]
    points_mm = file.points[window][:, columns] * mapping.mm_per_unit
    seen = np.asarray(np.isfinite(points_mm).any((0, 2)))
    if not seen.all():
        unseen = markers[int(seen.argmin())]
        raise InputError(f"{file.path}: marker {unseen!r} is seen in no frame read; leave it out of {key}")
    cluster = cluster_poses(points_mm, f"{file.path}: cluster {segment}")
    poses = np.concatenate([cluster.position_mm, from_matrix(cluster.rotation)], -1)
    misfit, left = cluster.misfit_mm, cluster.residual_mm[np.isfinite(cluster.residual_mm)]
    note = (
        f"cluster {segment}: {len(cluster.shape_mm)} markers, residual {np.sqrt(np.mean(left**2)):.2g} mm "
        f"rms, {left.max():.2g} mm max, {np.isfinite(misfit).sum()} of {count_of(len(misfit), 'frame')}"
    )
    odd = misfit > mapping.details["misfit_mm"]
    if not odd.any():
        return poses, odd, note, []
    groups = rigid_groups(points_mm)
    rigid = [f"[{', '.join(markers[index] for index in group)}]" for group in groups]
    counts = {"count": int(odd.sum()), "percent": 100 * odd.sum() / np.isfinite(misfit).sum()}
    whole = [*map(len, groups)] == [len(markers)]
    return poses, odd, note, [{"segment": segment, **counts, "groups": rigid, "whole": whole}]


def _of_rotation(
    file: C3dFile, segment: str, label: str, window: Integers, mapping: FileMapping
) -> tuple[Array, str]:
    """Return the pose (T, 7) of each point frame, and a note if the group is sampled faster than the points.

    Of several samples in a point frame the first is used.
    """
    key = f"{mapping.where}: receivers.{segment}.rotation"
    column = _index(file.path, file.rotation_labels, label, "rotation", key)
    ratio, odd = divmod(len(file.matrices), file.frames)
    if odd or not ratio:
        raise InputError(
            f"{file.path}: has {count_of(len(file.matrices), 'rotation')} for "
            f"{count_of(file.frames, 'frame')}; expected a multiple of the number of frames"
        )
    matrices = file.matrices[window * ratio, column]

    def locate(index: int) -> str:
        return f"{file.path}: frame {file.first_frame + window[index]}, rotation {label}"

    rotation = mapped.proper_rotations(matrices[:, :3, :3], locate)
    poses = np.concatenate([matrices[:, :3, 3] * mapping.mm_per_unit, from_matrix(rotation)], -1)
    note = f"rotation {label}: {ratio} samples a frame, the first of them is used" if ratio > 1 else ""
    return poses, note


def _index(path: Path, labels: Sequence[str], label: str, what: str, key: str) -> int:
    if labels.count(label) == 1:
        return labels.index(label)
    if label in labels:
        raise InputError(f"{path}: {what} {label!r} occurs more than once; {key} needs a unique label")
    guess = nearest(label, labels) or f", which has {list_names(labels)}"
    raise InputError(f"{key}: {what} {label!r} is not in {path}{guess}")
