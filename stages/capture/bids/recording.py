"""One recording as Motion-BIDS: its columns, what channels.tsv says of them, and its JSON sidecars."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from kinematics.rotations import Array
from schemas import PROGRAM, VERSION
from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.poses import RecordingName, recording_name
from schemas.tables import column_array, read_metadata, read_table
from stages.capture.bids.decimals import text_of
from stages.capture.bids.labels import tracking_system
from stages.capture.bids.sidecars import OWN_KEY

FRAME_OF_REFERENCE = "transmitter"

_MM_TO_M = -3

_POSE = (
    ("x_mm", "pos_x", "x", "POS", "m"),
    ("y_mm", "pos_y", "y", "POS", "m"),
    ("z_mm", "pos_z", "z", "POS", "m"),
    ("qw", "quat_w", "quat_w", "ORNT", "n/a"),
    ("qx", "quat_x", "quat_x", "ORNT", "n/a"),
    ("qy", "quat_y", "quat_y", "ORNT", "n/a"),
    ("qz", "quat_z", "quat_z", "ORNT", "n/a"),
)
"""A pose's columns: in the poses table, end of the channel's name, component, type, unit."""

_OTHER_TYPES = ("ACCEL", "ANGACCEL", "GYRO", "JNTANG", "MAGN", "VEL")


@dataclass(frozen=True)
class Grid:
    """A poses table of S segments and T frames.

    frame : (T,); time_s, valid and flag_bits : (S, T); columns : name in the poses table -> (S, T), gaps NaN.
    flag_names : the flags that occur; bit i of flag_bits stands for the i-th.
    """

    name: RecordingName
    parameters: Mapping[str, Any]
    segments: tuple[str, ...]
    frame: npt.NDArray[np.int64]
    time_s: Array
    columns: Mapping[str, Array]
    valid: npt.NDArray[np.bool_]
    flag_bits: npt.NDArray[np.int64]
    flag_names: tuple[str, ...]


def read_grid(path: Path) -> Grid:
    """Read a poses table whole; InputError where it is none, is empty or records a failure."""
    name = recording_name(path)
    table = read_table(path, POSES)
    if not table.num_rows:
        raise InputError(f"{path}: has no rows; there is nothing to export")
    segments = tuple(dict.fromkeys(table.column("segment").unique().to_pylist()))
    shape = (len(segments), -1)
    bits, names = _flag_bits(table)
    return Grid(
        name,
        read_metadata(path)["parameters"],
        segments,
        column_array(table, "frame").reshape(shape)[0],
        column_array(table, "time_s").astype(float).reshape(shape),
        {column: column_array(table, column).astype(float).reshape(shape) for column, *_ in _POSE},
        column_array(table, "valid").astype(bool).reshape(shape),
        bits.reshape(shape),
        names,
    )


def _flag_bits(table: pa.Table) -> tuple[npt.NDArray[np.int64], tuple[str, ...]]:
    encoded = table.column("flags").combine_chunks().dictionary_encode()
    texts = [text.split(";") if text else [] for text in encoded.dictionary.to_pylist()]
    names = tuple(sorted({flag for flags in texts for flag in flags}))
    bits = np.array([sum(1 << names.index(flag) for flag in flags) for flags in texts], np.int64)
    return bits[np.asarray(encoded.indices)], names


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

    @property
    def row(self) -> dict[str, str]:
        """The row of channels.tsv."""
        posed = self.type in ("POS", "ORNT")
        return {
            "name": self.name,
            "component": self.component,
            "type": self.type,
            "tracked_point": self.tracked_point,
            "units": self.units,
            "placement": self.tracked_point,
            "reference_frame": FRAME_OF_REFERENCE if posed else "n/a",
            "description": self.description,
            "status": self.status,
            "status_description": self.status_description,
        }


@dataclass(frozen=True)
class Timing:
    """How a recording ran: nominal and effective rate in Hz, duration in s, NaN where it has no times."""

    rate_hz: float
    effective_hz: float
    duration_s: float


def timing(path: Path, grid: Grid, rate_hz: float | None) -> Timing:
    """Tell the timing from the times, the nominal rate only where none is given.

    Raises InputError where the rate is neither given nor to be told.
    """
    times = np.array([column[np.isfinite(column)][:1].sum() for column in grid.time_s.T])
    known = np.isfinite(grid.time_s).any(0)
    steps = np.diff(times[known]) / np.diff(grid.frame[known])
    step_s = float(np.median(steps)) if len(steps) else 0.0
    if rate_hz is None and step_s <= 0:
        raise InputError(f"{path}: has no times to tell the sampling frequency from; give --rate-hz")
    nominal = rate_hz or round(1 / step_s, 6)
    span_s = float(times[known][-1] - times[known][0]) if known.any() else 0.0
    if span_s <= 0:
        return Timing(nominal, float("nan"), len(grid.frame) / nominal)
    return Timing(nominal, round((known.sum() - 1) / span_s, 6), round(span_s + 1 / nominal, 6))


def motion_columns(grid: Grid) -> list[Column]:
    """The columns of motion.tsv in their order: the frame, times, then every segment's."""
    frame = pa.array(grid.frame).cast(pa.string())
    found = [Column(frame, "frame", "n/a", "MISC", "n/a", "n/a", "frame number of the tracker")]
    shared = _shared_times(grid)
    if shared is not None:
        found += _time_columns(shared, "", "n/a")
    for index, segment in enumerate(grid.segments):
        if shared is None:
            found += _time_columns(grid.time_s[index], f"{segment}_", segment)
        found += _segment_columns(grid, index)
    return found


def _shared_times(grid: Grid) -> Array | None:
    """The times of the frames, shape (T,), where all segments that have one agree; else None."""
    known = np.isfinite(grid.time_s)
    first = np.take_along_axis(grid.time_s, known.argmax(0)[None], 0)
    return first[0] if ((grid.time_s == first) | ~known).all() else None


def _time_columns(time_s: Array, prefix: str, point: str) -> Iterator[Column]:
    """LATENCY as BIDS wants it, to a microsecond from the first sample, and the device's own time exactly."""
    known = time_s[np.isfinite(time_s)]
    if not len(known):
        return
    latency = [f"{value:.6f}" if np.isfinite(value) else None for value in time_s - known[0]]
    told = "time since the first sample"
    yield Column(pa.array(latency, pa.string()), f"{prefix}latency", "n/a", "LATENCY", point, "s", told)
    yield Column(text_of(time_s), f"{prefix}time", "n/a", "MISC", point, "s", "time of the tracker")


def _segment_columns(grid: Grid, index: int) -> Iterator[Column]:
    segment, valid, bits = grid.segments[index], grid.valid[index], grid.flag_bits[index]
    status = ("good", "n/a") if valid.any() else ("bad", "no pose of this receiver may be used")
    for column, ending, component, kind, unit in _POSE:
        text = text_of(grid.columns[column][index], _MM_TO_M if kind == "POS" else 0)
        told = POSES.column(column).description
        yield Column(text, f"{segment}_{ending}", component, kind, segment, unit, told, *status)
    usable = pa.array(valid.astype(np.int8)).cast(pa.string())
    told = "1 where the pose may be used, else 0"
    yield Column(usable, f"{segment}_valid", "n/a", "MISC", segment, "n/a", told, *status)
    if bits.any():
        text = pa.array(bits).cast(pa.string())
        told = f"what was seen of the pose, bit by bit as {OWN_KEY}.FlagBits in motion.json says"
        yield Column(text, f"{segment}_flags", "n/a", "MISC", segment, "n/a", told, *status)


def motion_json(
    grid: Grid, columns: list[Column], timed: Timing, inputs: Mapping[str, str]
) -> dict[str, Any]:
    """The content of motion.json; what nobody knows is "n/a". inputs : file name -> SHA-256."""
    types = [column.type for column in columns]
    notes = [*grid.parameters.get("notes", []), grid.parameters.get("doubt", "")]
    name = grid.name
    return {
        "TaskName": name.task,
        "TaskDescription": f"Task {name.task} of {name}.",
        "SamplingFrequency": timed.rate_hz,
        **({} if np.isnan(timed.effective_hz) else {"SamplingFrequencyEffective": timed.effective_hz}),
        "RecordingDuration": timed.duration_s,
        "TrackingSystemName": tracking_system(name.hand),
        "Manufacturer": "n/a",
        "ManufacturersModelName": "n/a",
        "DeviceSerialNumber": "n/a",
        "SoftwareVersions": f"{PROGRAM} {VERSION}",
        "SubjectArtefactDescription": "; ".join(filter(None, notes)) or "n/a",
        "MissingValues": "n/a",
        "TrackedPointsCount": len(grid.segments),
        "MotionChannelCount": len(columns),
        "POSChannelCount": types.count("POS"),
        "ORNTChannelCount": types.count("ORNT"),
        "LATENCYChannelCount": types.count("LATENCY"),
        "MISCChannelCount": types.count("MISC"),
        "MiscChannelCount": types.count("MISC"),  # BIDS spells it in both ways
        **{f"{kind}ChannelCount": 0 for kind in _OTHER_TYPES},
        OWN_KEY: _own_json(grid, columns, inputs),
    }


def _own_json(grid: Grid, columns: list[Column], inputs: Mapping[str, str]) -> dict[str, Any]:
    names = {column.name for column in columns}
    time = {s: name for s in grid.segments for name in (f"{s}_time", "time") if name in names}
    flags = {s: f"{s}_flags" for s in grid.segments if f"{s}_flags" in names}
    return {
        "Version": VERSION,
        "Subject": grid.name.subject,
        "Hand": grid.name.hand,
        "Task": grid.name.task,
        "Trial": grid.name.trial,
        "Layout": grid.parameters.get("layout", "n/a"),
        "Inputs": dict(inputs),
        "FrameChannel": "frame",
        "TimeChannels": time,
        "FlagChannels": flags,
        "FlagBits": list(grid.flag_names),
    }


def channels_json() -> dict[str, Any]:
    """The content of channels.json: what the reference frame is, as far as poses alone can tell."""
    return {
        "reference_frame": {
            "Description": "The frame that positions and orientations are given in.",
            "Levels": {
                FRAME_OF_REFERENCE: {
                    "SpatialAxes": "n/a",
                    "RotationRule": "right-hand",
                    "RotationOrder": "n/a",
                    "Description": "The transmitter's own frame, right-handed. Orientations are unit "
                    "quaternions that take coordinates of the receiver to this frame. How the frame lies in "
                    "the room or to the subject is not recorded.",
                }
            },
        }
    }
