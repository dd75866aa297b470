"""C3D, by ezc3d, for motion-capture programs: joints and receivers as points, bones and receivers as poses.

Points are the joints by their names, then four points of each receiver: `<segment>_receiver`, its origin, and
`_x`, `_y` and `_z`, 20 mm along its axes. The ROTATION group has the poses of bones (WebXR bone frame to
world), named after the joint that they start at, and of receivers, `<segment>_receiver`. Gaps are kept, with
residual -1 and reliability -1. Lost frames are written without points, so that the rate is constant.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from shukotsu.arrays import Array, Index
from shukotsu.errors import InputError, count_of
from shukotsu.export import exported_motion
from shukotsu.hand.posing import PosedRecording
from shukotsu.hand.rotations import matrix
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.whole_files import replacing

ARM_MM = 20.0
"""Distance from a receiver's origin to the points on its axes."""

LONGEST_LABEL = 127
"""Length of the longest label that even readers which treat the length byte as signed can read."""

MOST_FRAMES = 65534
"""Largest unambiguous count of frames in the header's 16 bits; 65535 also means any larger count."""

_MOST_POINTS = 255
"""Largest number of labels in one parameter."""
_BLOCK, _LAST_START, _PARAMETER_BLOCKS = 512, 32767, 255
"""Bytes per block; last block at which rotations can start; largest number of blocks before the points."""

_NOTE_WIDTH = 120
_NOTABLE_S = 5e-4
NO_POINT = np.array([0.0, 0.0, 0.0, -1.0])
"""x, y, z and residual of a missing point."""


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Write the motion as one file, in mm with z up; return sentences on what it lacks.

    Lengths are 32-bit floats, accurate to about 3e-5 mm half a metre from the transmitter. Raises InputError
    if there is no frame, if the rate is unknown, if frames are too uneven in time for one rate, or if there
    are too many frames or points.
    """
    if not len(motion.frame):
        raise InputError(f"{path}: C3D needs at least one frame; widen --frames")
    import ezc3d

    motion, unseen = exported_motion.with_seen_receivers(motion)
    row, rate_hz, error_s = _timing(motion, path)
    described = list(_receiver_points(motion))
    frames, labels = int(row[-1]) + 1, _labels([*motion.names, *(name for name, _ in described)])
    bones = [joint.name for joint in motion.joints if not joint.tip]
    posed = _labels([*bones, *(f"{segment}_receiver" for segment in motion.receivers.segments)])
    if frames > MOST_FRAMES or len(labels) > _MOST_POINTS:
        raise InputError(
            f"{path}: has {count_of(frames, 'frame')} of {count_of(len(labels), 'point')}, and C3D holds at "
            f"most {MOST_FRAMES} of {_MOST_POINTS}; give --frames for shorter files, or a lower --fps"
        )
    first = int(motion.frame[0])
    numbered = np.array_equal(motion.frame - first, row) and 1 <= first <= MOST_FRAMES - frames
    room = frames * len(labels) * 16 <= (_LAST_START - _PARAMETER_BLOCKS) * _BLOCK
    dropped = []
    if not room:
        dropped.append(
            "ROTATION, the poses of bones and receivers: it would start beyond the 16-bit limit of C3D; the "
            "points still contain the receivers' poses, and with fewer --frames there is room for all"
        )
    if not numbered:
        dropped.append(f"frame numbers: frame 1 of the file is the tracker's frame {first}")
    if error_s > _NOTABLE_S:
        dropped.append(
            f"device times, which differ by up to {error_s * 1000:.1f} ms from the constant rate of "
            f"{rate_hz:.6g} Hz; --fps resamples over device time"
        )
    places = [f"child of {motion.names[j.parent]}" if j.parent >= 0 else "the root" for j in motion.joints]
    descriptions = [f"joint {name}, {place}" for name, place in zip(motion.names, places, strict=True)]
    descriptions += [what for _, what in described]
    file = ezc3d.c3d()
    file["header"]["points"]["first_frame"] = first - 1 if numbered else 0
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"], point["LABELS"]["value"] = [rate_hz], ["mm"], labels
    point["DESCRIPTIONS"]["value"] = [_escape(text)[:LONGEST_LABEL] for text in descriptions]
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file.add_parameter("MANUFACTURER", "SOFTWARE", [PROGRAM])
    file.add_parameter("MANUFACTURER", "VERSION_LABEL", [VERSION])
    file.add_parameter("SHUKOTSU", "NOTE", _note(motion, dropped))
    points = np.tile(NO_POINT, (frames, len(labels), 1))
    points[row] = _points(motion)
    residuals, points[..., 3] = points[..., 3].copy(), 1.0
    file["data"]["points"] = points.transpose(2, 1, 0)
    file["data"]["meta_points"]["residuals"] = residuals.T[None]
    if room:
        file.add_parameter("ROTATION", "LABELS", posed)
        file.add_parameter("ROTATION", "RATE", [rate_hz])
        poses = np.full((frames, len(posed), 4, 4), np.nan)
        poses[row] = _poses(motion)
        file["data"]["rotations"] = poses.transpose(2, 3, 1, 0)
    with replacing(path) as temporary:
        file.write(f"{temporary}.c3d")  # an ending that ezc3d would add by itself
        Path(f"{temporary}.c3d").replace(temporary)
    return (*unseen, *dropped)


def _labels(names: Sequence[str]) -> list[str]:
    """Return labels in ASCII of at most LONGEST_LABEL characters that are unique even if case is ignored."""
    labels: dict[str, str] = {}
    for name in names:
        label = plain = exported_motion.ascii_name(name)[:LONGEST_LABEL]
        count = 2
        while label.upper() in labels:
            label, count = f"{plain[: LONGEST_LABEL - len(str(count)) - 1]}-{count}", count + 1
        labels[label.upper()] = label
    return [*labels.values()]


def _receiver_points(motion: PosedRecording) -> Iterator[tuple[str, str]]:
    """Yield the name and description of each receiver's four points."""
    for segment in motion.receivers.segments:
        yield f"{segment}_receiver", f"origin of the receiver on {segment}"
        for axis in "xyz":
            yield f"{segment}_receiver_{axis}", f"{ARM_MM:g} mm along {axis} of the receiver on {segment}"


def _escape(text: str) -> str:
    r"""Return text in ASCII, with other characters as \uXXXX like in Python and JSON."""
    return text.encode("ascii", "backslashreplace").decode("ascii")


def _timing(motion: PosedRecording, path: Path) -> tuple[Index, float, float]:
    """Return each frame's row in the file (T,), the rate, Hz, and the largest deviation of times from it, s.

    Rows are left empty for lost frames, which frame numbers and, if known, times show. The rate is the
    nominal one if times agree with it, else the mean rate. Raises InputError if a time is more than half a
    frame off or if the rate is unknown.
    """
    frames, time_s = motion.frame, motion.time_s
    if len(frames) == 1:
        return np.zeros(1, np.int64), exported_motion.ALONE_HZ, 0.0
    exported_motion.require_rate(motion, path, "C3D")
    step = np.diff(frames)
    steps = step // max(1, int(np.median(step)))
    timed = np.isfinite(time_s).all()
    if timed:
        steps = np.minimum(steps, np.rint(np.diff(time_s) * motion.rate_hz).astype(np.int64))
    row = np.concatenate([[0], np.cumsum(np.maximum(steps, 1))])
    if not timed:
        return row, motion.rate_hz, 0.0
    span_s = float(time_s[-1] - time_s[0])
    rates = [motion.rate_hz, *([float(row[-1]) / span_s] if span_s > 0 else [])]
    errors = [float(np.abs(time_s - time_s[0] - row / rate).max()) for rate in rates]
    best = 0 if errors[0] <= _NOTABLE_S else int(np.argmin(errors))
    if errors[best] > 0.5 / rates[best]:
        raise InputError(
            f"{path}: frames are up to {errors[best] * 1000:.1f} ms off a constant {rates[best]:.6g} Hz, "
            "more than half a frame, and C3D has only one rate; resample with --fps"
        )
    return row, rates[best], errors[best]


def _note(motion: PosedRecording, dropped: Sequence[str]) -> list[str]:
    """Return a description of the motion as lines of text."""
    start = f"{motion.time_s[0]:.9g} s" if np.isfinite(motion.time_s[0]) else "not known"
    lines = [
        *_escape(exported_motion.facts_text(motion, "mm", "z", dropped)).splitlines(),
        f"points: joints; each receiver's origin and the points {ARM_MM:g} mm along its x, y and z axes",
        "rotations: bones, named by the joint at which they start, in the bone frame above; receivers",
        f"first frame: the tracker's {motion.frame[0]}, device time {start}",
    ]
    return [part for line in lines for part in wrap(line, _NOTE_WIDTH, subsequent_indent="  ")]


def _points(motion: PosedRecording) -> Array:
    """Return the points (n, P, 4) of n frames: x, y, z in mm, and residual."""
    receivers = motion.receivers
    origin = receivers.position_mm[:, :, None]
    axes = np.swapaxes(matrix(receivers.quaternion), -1, -2)
    four = np.concatenate([origin, origin + ARM_MM * axes], 2).reshape(len(origin), -1, 3)
    position = np.concatenate([motion.position_mm, four], 1)
    out = np.concatenate([position, np.zeros((*position.shape[:2], 1))], -1)
    return np.where(np.isfinite(out).all(-1, keepdims=True), out, NO_POINT)


def _poses(motion: PosedRecording) -> Array:
    """Return the poses of bones and receivers as matrices (n, R, 4, 4), NaN if any number is missing."""
    bones = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    receivers = motion.receivers
    position = np.concatenate([motion.position_mm[:, bones], receivers.position_mm], 1)
    out = np.zeros((*position.shape[:2], 4, 4))
    out[..., :3, :3] = matrix(np.concatenate([motion.quaternion[:, bones], receivers.quaternion], 1))
    out[..., :3, 3] = position
    out[..., 3, 3] = 1.0
    return np.where(np.isfinite(out).all((-2, -1), keepdims=True), out, np.nan)
