"""Motion-BIDS: a `*_motion.tsv` and the sidecars that say what its columns are (BIDS, Motion)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Array
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.mapping import FileMapping
from stages.capture.bids.columns import MotionColumns, read_columns
from stages.capture.bids.own_channels import OwnChannels
from stages.capture.bids.points import (
    SHIFT_TO_MM,
    XYZ,
    Point,
    channels_of,
    check_frames,
    check_unit,
    find_point,
)
from stages.capture.bids.sidecars import Channel, Sidecars, read_sidecars
from stages.capture.formats.mapped import Track, did_you_mean, samples_of_tracks
from stages.capture.formats.naming import UNKNOWN, draft_receivers
from stages.capture.formats.orientation import quaternions
from stages.capture.samples import ReadingOptions, Samples

SECONDS_SHIFT = {"s": 0, "ms": -3, "us": -6}


def read_motion_bids(path: Path, layout: Layout, options: ReadingOptions) -> Samples:
    """Read a motion.tsv with its channels.tsv, channels.json and motion.json.

    Without a mapping every tracked point must be a segment of the layout. Times are those of the LATENCY
    channel, else they are counted by SamplingFrequency; frames are counted from 0. A file that
    `stages.capture export-bids` wrote gives its frame numbers, device times and flags back.
    Raises InputError where anything is absent, inconsistent or in a unit that is not known.
    """
    sidecars = read_sidecars(path)
    mapping = options.mapping or _implied_mapping(sidecars)
    names = [_point_name(mapping, segment, sidecars) for segment in mapping.receivers]
    points = [find_point(sidecars, name, mapping) for name in names]
    check_frames(sidecars, points)
    own = OwnChannels.of(path, sidecars, names)
    times = [own.time.get(name) or _latency(sidecars, name) for name in names]
    wanted = {c.index: c for point in points for c in point.channels}
    wanted |= {c.index: c for c in [own.frame, *times, *own.flags.values()] if c is not None}
    text, sentinel = _missing_values(sidecars)
    columns = read_columns(path, len(sidecars.channels), list(wanted.values()), text)
    rate_hz = 1.0 if all(times) else _rate_hz(path, sidecars, mapping)
    frame = np.arange(columns.rows) if own.frame is None else columns.wholes(own.frame)
    tracks = []
    for name, point, channel in zip(names, points, times, strict=True):
        time_s = np.arange(columns.rows) / rate_hz if channel is None else _times(columns, channel, sidecars)
        numbers = _numbers(columns, point, mapping, sentinel)
        tracks.append(own.track(columns, name, Track(np.arange(columns.rows), frame, time_s, numbers)))
    return samples_of_tracks(tracks, mapping, layout, columns.place)


def describe(path: Path) -> list[str]:
    """Say what the sidecars of a motion.tsv say, a line each."""
    sidecars = read_sidecars(path)
    rate_hz = sidecars.sampling_frequency_hz()
    latency = [channel.name for channel in sidecars.channels if channel.type == "LATENCY"]
    timing = f"times in the channel {', '.join(latency)}" if latency else "no LATENCY channel"
    lines = [
        f"Motion-BIDS, {len(sidecars.channels)} channels described by {sidecars.channels_path.name}",
        f"{timing}; SamplingFrequency {'absent' if rate_hz is None else f'{rate_hz:g} Hz'}",
    ]
    for name in sidecars.points():
        parts = [
            f"{kind} {' '.join(c.component for c in found)} in {', '.join(sorted({c.units for c in found}))}"
            for kind in ("POS", "ORNT")
            if (found := channels_of(sidecars, name, kind))
        ]
        lines.append(f"tracked point {name}: {'; '.join(parts)}")
    return lines


def draft_mapping(path: Path) -> dict[str, Any]:
    """A mapping to edit: every tracked point, under a segment name made from its own."""
    sidecars = read_sidecars(path)
    units = [channel.units for channel in sidecars.channels if channel.type == "POS"]
    angles = [c for c in sidecars.channels if c.type == "ORNT" and c.component in XYZ]
    draft: dict[str, Any] = {
        "format": "motion-bids",
        "position_unit": next((unit for unit in units if unit in SHIFT_TO_MM), UNKNOWN),
    }
    if any("RotationOrder" not in sidecars.frame_levels(channel.reference_frame) for channel in angles):
        draft["orientation"] = {"kind": "euler", "axes": UNKNOWN, "unit": angles[0].units}
    return {**draft, "receivers": draft_receivers(sidecars.points(), "tracked_point")}


def _implied_mapping(sidecars: Sidecars) -> FileMapping:
    receivers = {name: {"tracked_point": name} for name in sidecars.points()}
    if not receivers:
        raise InputError(f"{sidecars.channels_path}: names no tracked point with a POS or ORNT channel")
    return FileMapping(str(sidecars.channels_path), "motion-bids", 0.0, None, None, receivers, (), {})


def _point_name(mapping: FileMapping, segment: str, sidecars: Sidecars) -> str:
    where = f"{mapping.where}: receivers.{segment}"
    name = mapping.receivers[segment].get("tracked_point")
    if name is None:
        raise InputError(f"{where}: has no tracked_point; say which of the file's it is")
    known = sidecars.points()
    if name not in known:
        raise InputError(
            f"{where}: tracked point {name!r} is not in {sidecars.channels_path}, which has "
            f"{', '.join(known) or 'none'}{did_you_mean(name, known)}"
        )
    return str(name)


def _latency(sidecars: Sidecars, name: str) -> Channel | None:
    found = [c for c in sidecars.channels if c.type == "LATENCY" and c.tracked_point == name]
    found = found or [c for c in sidecars.channels if c.type == "LATENCY" and c.tracked_point == "n/a"]
    if len(found) > 1:
        raise InputError(
            f"{sidecars.channels_path}: tracked point {name}: has {len(found)} LATENCY channels; expected one"
        )
    return found[0] if found else None


def _times(columns: MotionColumns, channel: Channel, sidecars: Sidecars) -> Array:
    check_unit(sidecars, channel, tuple(SECONDS_SHIFT))
    return columns.reals(channel, SECONDS_SHIFT[channel.units])


def _rate_hz(path: Path, sidecars: Sidecars, mapping: FileMapping) -> float:
    found = sidecars.sampling_frequency_hz()
    if found is None and mapping.rate_hz is None:
        raise InputError(
            f"{path}: has no LATENCY channel and its motion.json no SamplingFrequency above 0; "
            "add SamplingFrequency there, or rate_hz in a mapping"
        )
    if found is not None and mapping.rate_hz not in (None, found):
        raise InputError(
            f"{mapping.where}: rate_hz: is {mapping.rate_hz:g}, but motion.json has the SamplingFrequency "
            f"{found:g}; find out which is right"
        )
    return float(found or mapping.rate_hz or 0)


def _missing_values(sidecars: Sidecars) -> tuple[list[str], float | None]:
    """What motion.json's MissingValues adds to the usual "no value": a text, or a number."""
    told = sidecars.motion.get("MissingValues")
    if not isinstance(told, str | int | float) or isinstance(told, bool):
        return [], None
    try:
        number = float(told)
    except (ValueError, OverflowError):
        return [str(told)], None
    return ([str(told)], None) if np.isnan(number) else ([], number)


def _numbers(columns: MotionColumns, point: Point, mapping: FileMapping, sentinel: float | None) -> Array:
    """Poses as Samples have them, shape (T, 7); a pose that is the sentinel throughout is missing."""
    position = [columns.reals(channel, SHIFT_TO_MM[channel.units]) for channel in point.position]
    turning = [columns.reals(channel) for channel in point.orientation]
    rotates = (mapping.orientation or {}).get("rotates", "receiver-to-transmitter")
    if point.axes is None:
        orientation = {"kind": "quaternion", "order": "wxyz", "rotates": rotates}
    else:
        unit = point.orientation[0].units
        orientation = {"kind": "euler", "axes": point.axes, "unit": unit, "rotates": rotates}
    found = quaternions(np.stack(turning, -1), orientation, columns.place)
    numbers = np.concatenate([np.stack(position, -1), found], -1)
    if sentinel is not None:
        raw = np.stack([columns.reals(channel) for channel in point.channels], -1)
        numbers[(raw == sentinel).all(-1)] = np.nan
    return np.asarray(numbers)
