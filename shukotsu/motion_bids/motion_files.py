"""The four files of a tracking system of Motion-BIDS: motion.tsv with its channels, and their sidecars.

A tracking system is what shares a clock: the receivers of a hand, or its skeleton. Positions are in metres,
orientations unit quaternions, joint angles in degrees.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.csv as pa_csv

from shukotsu.files.whole_files import replacing, write_text
from shukotsu.motion_bids.dataset_files import OWN_KEY, json_text, tsv_text
from shukotsu.motion_bids.decimals import text_of
from shukotsu.motion_bids.labels import motion_folder, recording_stem, tracking_system
from shukotsu.schemas import PROGRAM, VERSION
from shukotsu.schemas.poses import RecordingName

Array = npt.NDArray[np.float64]

ENDINGS = ("_motion.tsv", "_motion.json", "_channels.tsv", "_channels.json")
"""Of a tracking system's files, the main one first."""

TRANSMITTER, PARENT_BONE = "transmitter", "parent_bone"
"""Reference frames: of poses, and of joint angles."""

TYPES = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL")

ALONE_HZ = 60.0
"""SamplingFrequency of one frame, whose rate nobody knows: the validator takes no n/a there."""

_MM_TO_M = -3

_UNKNOWN = (
    *("Instructions", "Manufacturer", "ManufacturersModelName", "DeviceSerialNumber"),
    *("InstitutionName", "InstitutionAddress", "InstitutionalDepartmentName", "SubjectArtefactDescription"),
)
"""Keys of motion.json that BIDS recommends and no table tells."""


@dataclass(frozen=True)
class Column:
    """A column of motion.tsv as text, null where there is no value, and its row of channels.tsv."""

    text: pa.Array
    name: str
    component: str
    type: str
    tracked_point: str
    units: str
    description: str
    status: str = "good"
    status_description: str = "n/a"

    def row(self, rate_hz: str) -> dict[str, str]:
        """Give the row of channels.tsv."""
        posed = self.type in ("POS", "ORNT")
        return {
            "name": self.name,
            "component": self.component,
            "type": self.type,
            "tracked_point": self.tracked_point,
            "units": self.units,
            "placement": self.tracked_point,
            "reference_frame": TRANSMITTER if posed else PARENT_BONE if self.type == "JNTANG" else "n/a",
            "description": self.description,
            "status": self.status,
            "status_description": self.status_description,
            "sampling_frequency": rate_hz,
        }


@dataclass(frozen=True)
class TrackingSystem:
    """A tracking system of a recording, without its numbers.

    model : the skeleton model of one that holds joints and bones, empty of receivers. points : names of what
    is tracked. bone_frame : what a bone's own frame is, in words. facts : what BIDS has no key for.
    """

    recording: RecordingName
    model: str
    points: tuple[str, ...]
    facts: Mapping[str, Any]
    bone_frame: str = ""

    @property
    def label(self) -> str:
        """The tracksys label."""
        return tracking_system(self.recording.hand, self.model)

    def file(self, folder: Path, ending: str) -> Path:
        """Give the path of one of its files in a dataset."""
        stem = recording_stem(self.recording, self.model)
        return folder / motion_folder(self.recording) / f"{stem}{ending}"


def write_tracking_system(
    folder: Path,
    system: TrackingSystem,
    rates: Mapping[str, float],
    first: Sequence[Column],
    blocks: Iterable[Sequence[Column]],
) -> None:
    """Write the four files, motion.tsv last.

    rates : see `sampling_rates`. first : the columns, with any frames. blocks : some frames of every column
    at a time.
    """
    known = "RecordingDuration" in rates
    rate = f"{rates['SamplingFrequency']:.6f}".rstrip("0").rstrip(".") if known else "n/a"
    rows = [column.row(rate) for column in first]
    types = [column.type for column in first]
    what = f"Skeleton by the model {system.model}" if system.model else "Receivers"
    motion_json = {
        "TaskName": system.recording.task,
        "TaskDescription": f"Task {system.recording.task}, {system.recording.hand} hand. {what}.",
        **rates,
        "TrackingSystemName": system.label,
        "SoftwareVersions": f"{PROGRAM} {VERSION}",
        **dict.fromkeys(_UNKNOWN, "n/a"),
        "MissingValues": "n/a",
        "TrackedPointsCount": len(system.points),
        "MotionChannelCount": len(types),
        **{f"{kind}ChannelCount": types.count(kind) for kind in TYPES},
        OWN_KEY: {"FrameChannel": "frame", "TimeChannels": _time_channels(system, first), **system.facts},
    }
    cells = [list(rows[0]), *(list(row.values()) for row in rows)]
    write_text(system.file(folder, "_channels.tsv"), tsv_text(cells))
    write_text(system.file(folder, "_channels.json"), json_text(_reference_frames(system, types)))
    write_text(system.file(folder, "_motion.json"), json_text(motion_json))
    options = pa_csv.WriteOptions(include_header=False, delimiter="\t", quoting_style="none")
    with replacing(system.file(folder, "_motion.tsv")) as temporary, temporary.open("wb") as stream:
        for columns in blocks:
            texts = [column.text.fill_null("n/a") for column in columns]
            pa_csv.write_csv(pa.table(texts, [str(i) for i in range(len(texts))]), stream, options)


def _time_channels(system: TrackingSystem, columns: Sequence[Column]) -> dict[str, str]:
    """The channel of device time of each tracked point."""
    names = {column.name for column in columns}
    return {p: name for p in system.points for name in (f"{p}_time", "time") if name in names}


def _reference_frames(system: TrackingSystem, types: Sequence[str]) -> dict[str, Any]:
    """The content of channels.json: what the reference frames are, as far as poses alone can tell."""
    turned = (
        f"bone to this frame. A bone's own frame: {system.bone_frame}"
        if system.model
        else ("receiver to this frame")
    )
    where = "How the transmitter lies" if system.model else "How the frame lies"
    levels = {
        TRANSMITTER: {
            "SpatialAxes": "n/a",
            "RotationRule": "right-hand",
            "RotationOrder": "n/a",
            "Description": "The transmitter's own frame, right-handed. Orientations are unit quaternions "
            f"that take coordinates of the {turned}. {where} in the room or to the subject is not recorded.",
        }
    }
    if "JNTANG" in types:
        levels[PARENT_BONE] = {
            "SpatialAxes": "n/a",
            "RotationRule": "n/a",
            "RotationOrder": "n/a",
            "Description": "Angles of a bone against the bone before it by the joint coordinate system (Wu "
            "et al. 2005, J Biomech 38:981): flexion about the lateral axis of the bone before, abduction "
            "about the floating axis, rotation about the bone's own long axis. Flexion, ulnar deviation and "
            "pronation are positive, in right and left hands. Zero is the straight digit.",
        }
    return {
        "reference_frame": {
            "Description": "The frame that positions and orientations are given in.",
            "Levels": levels,
        }
    }


def sampling_rates(rate_hz: float, time_s: Array) -> dict[str, float]:
    """Give SamplingFrequency and what the times (T,), NaN where unknown, tell; one frame may have no rate."""
    if not np.isfinite(rate_hz):
        return {"SamplingFrequency": ALONE_HZ}
    rate_hz, known = round(rate_hz, 6), time_s[np.isfinite(time_s)]
    span_s = float(known[-1] - known[0]) if len(known) else 0.0
    timed = span_s > 0
    return {
        "SamplingFrequency": rate_hz,
        "SamplingFrequencyEffective": round((len(known) - 1) / span_s, 6) if timed else rate_hz,
        "RecordingDuration": round((span_s if timed else (len(time_s) - 1) / rate_hz) + 1 / rate_hz, 6),
    }


def frame_column(frame: npt.NDArray[np.int64]) -> Column:
    """Give the tracker's frame numbers (T,)."""
    text = pa.array(frame).cast(pa.string())
    return Column(text, "frame", "n/a", "MISC", "n/a", "n/a", "frame number of the tracker")


def time_columns(time_s: Array, start_s: float, point: str = "") -> list[Column]:
    """Give LATENCY as BIDS wants it, to a microsecond from start_s, and device time in all its digits.

    time_s : (T,), NaN where there is none. Nothing where start_s is NaN. point : that has times of its own.
    """
    if not np.isfinite(start_s):
        return []
    latency = [f"{value:.6f}" if np.isfinite(value) else None for value in time_s - start_s]
    prefix, point = (f"{point}_", point) if point else ("", "n/a")
    what = "time since the first sample"
    return [
        Column(pa.array(latency, pa.string()), f"{prefix}latency", "n/a", "LATENCY", point, "s", what),
        Column(text_of(time_s), f"{prefix}time", "n/a", "MISC", point, "s", "time of the tracker"),
    ]


def place_columns(point: str, kind: str, position: Array, shift: int = 0, *status: str) -> list[Column]:
    """Give positions (T, 3) of a point, metres times 10**-shift; kind : what it is, in words."""
    columns = []
    for axis, own in zip(("x", "y", "z"), position.T, strict=True):
        text, what = text_of(own + 0.0, shift), f"position of the {kind}, {axis}"
        columns.append(Column(text, f"{point}_pos_{axis}", axis, "POS", point, "m", what, *status))
    return columns


def turn_columns(point: str, kind: str, quaternion: Array, *status: str) -> list[Column]:
    """Give rotations (T, 4) of what is at a point; kind : what that is, in words."""
    columns = []
    for part, own in zip(("quat_w", "quat_x", "quat_y", "quat_z"), quaternion.T, strict=True):
        what = f"{kind} to transmitter frame, {part}"
        text = text_of(own + 0.0)
        columns.append(Column(text, f"{point}_{part}", part, "ORNT", point, "n/a", what, *status))
    return columns


def receiver_columns(segment: str, position_mm: Array, quaternion: Array, *status: str) -> list[Column]:
    """Give the pose (T, 3), (T, 4) of a receiver in all digits, NaN in gaps."""
    return [
        *place_columns(segment, "receiver", position_mm, _MM_TO_M, *status),
        *turn_columns(segment, "receiver", quaternion, *status),
    ]
