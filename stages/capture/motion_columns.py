"""One recording's poses as Motion-BIDS: the columns of its motion.tsv, and its motion.json."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schemas import PROGRAM, VERSION
from schemas.bids.channels import OWN_KEY, Column, channel_counts, frame_column, time_columns
from schemas.bids.decimals import text_of
from schemas.bids.labels import tracking_system
from schemas.catalogue import POSES
from schemas.errors import InputError
from schemas.poses import RecordingName, recording_name
from schemas.tables import column_array, read_metadata, read_table
from skeleton.rotations import Array

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
class Timing:
    """How a recording ran: nominal and effective rate in Hz, duration in s, NaN where it has no times."""

    rate_hz: float
    effective_hz: float
    duration_s: float


def timing(path: Path, grid: Grid, rate_hz: float | None) -> Timing:
    """Tell the timing from the times, the nominal rate only where none is given.

    Raises InputError where the rate is neither given nor follows from times.
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
    columns = [frame_column(grid.frame)]
    shared = _shared_times(grid)
    if shared is not None:
        columns += time_columns(shared, _first_known(shared))
    for index, segment in enumerate(grid.segments):
        if shared is None:
            own = grid.time_s[index]
            columns += time_columns(own, _first_known(own), f"{segment}_", segment)
        columns += _segment_columns(grid, index)
    return columns


def _shared_times(grid: Grid) -> Array | None:
    """The times of the frames, shape (T,), where all segments that have one agree; else None."""
    known = np.isfinite(grid.time_s)
    first = np.take_along_axis(grid.time_s, known.argmax(0)[None], 0)
    return first[0] if ((grid.time_s == first) | ~known).all() else None


def _first_known(time_s: Array) -> float:
    return next((float(value) for value in time_s if np.isfinite(value)), float("nan"))


def _segment_columns(grid: Grid, index: int) -> Iterator[Column]:
    segment, valid, bits = grid.segments[index], grid.valid[index], grid.flag_bits[index]
    status = ("good", "n/a") if valid.any() else ("bad", "no pose of this receiver may be used")
    for column, ending, component, kind, unit in _POSE:
        text = text_of(grid.columns[column][index], _MM_TO_M if kind == "POS" else 0)
        what = POSES.column(column).description
        yield Column(text, f"{segment}_{ending}", component, kind, segment, unit, what, *status)
    usable = pa.array(valid.astype(np.int8)).cast(pa.string())
    what = "1 where the pose may be used, else 0"
    yield Column(usable, f"{segment}_valid", "n/a", "MISC", segment, "n/a", what, *status)
    if bits.any():
        text = pa.array(bits).cast(pa.string())
        what = f"what was seen of the pose, bit by bit as {OWN_KEY}.FlagBits in motion.json says"
        yield Column(text, f"{segment}_flags", "n/a", "MISC", segment, "n/a", what, *status)


def motion_json(
    grid: Grid, columns: list[Column], timed: Timing, inputs: Mapping[str, str]
) -> dict[str, Any]:
    """The content of motion.json; what nobody knows is "n/a". inputs : file name -> SHA-256."""
    counts = channel_counts(columns)
    notes = grid.parameters.get("notes", [])
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
        **counts,
        "MiscChannelCount": counts["MISCChannelCount"],  # BIDS spells it in both ways
        OWN_KEY: _own_json(grid, columns, inputs),
    }


def _own_json(grid: Grid, columns: list[Column], inputs: Mapping[str, str]) -> dict[str, Any]:
    names = {column.name for column in columns}
    time = {s: name for s in grid.segments for name in (f"{s}_time", "time") if name in names}
    flags = {s: f"{s}_flags" for s in grid.segments if f"{s}_flags" in names}
    return {
        "Version": VERSION,
        "Subject": grid.name.subject,
        **({"Session": grid.name.session} if grid.name.session else {}),
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
