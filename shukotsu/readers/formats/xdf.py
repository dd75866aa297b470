"""Read a stream of type MoCap from an XDF file, as LabStreamingLayer records it (XDF's MoCap metadata)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError, nearest
from shukotsu.readers.formats import mapped
from shukotsu.readers.samples import Samples
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping
from shukotsu.tables import xdf_streams
from shukotsu.tables.limits import MM_PER_UNIT, UNIT_NAMES


def read_xdf(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read a MoCap stream: PositionX, Y, Z and OrientationA, B, C, D of every marker or object.

    Without a mapping each of them must be a segment of the layout. Time stamps are the file's, corrected by
    its clock offsets if it has any, but not smoothed; frames are samples counted from 0; NaN is a gap. Raises
    InputError if the choice of stream is ambiguous, or the stream is damaged or has an unknown unit.
    """
    stream = _chosen_stream(path, mapping)
    where = f"{path}: stream {stream.name}"
    if stream.format not in xdf_streams.NUMBERS:
        raise InputError(f"{where}: has format {stream.format or 'none'}; expected numbers")
    read = xdf_streams.load_stream(path, stream)
    if len(read.channels) != stream.channel_count:
        raise InputError(
            f"{where}: has {stream.channel_count} channels, but its header describes {len(read.channels)}; "
            "the sender must describe each (label, marker or object, type, unit)"
        )
    posed = xdf_streams.owners(read.channels)
    kind = "" if mapping else "quaternion"
    mapping = mapping or mapped.implied_mapping(where, "xdf", posed)
    usual = {"kind": "quaternion", "order": "wxyz", "rotates": "receiver-to-transmitter"}
    declared = {**usual, **(mapping.orientation or {})}
    if declared["kind"] != "quaternion":
        raise InputError(f"{mapping.where}: orientation.kind: must be quaternion in a mapping for XDF")
    names = [mapped.name_in_file(mapping, key, posed, where) for key in mapping.receivers]
    values, frame, tracks = np.asarray(read.values, float), np.arange(len(read.time_s)), []

    def locate(row: int) -> str:
        return f"{where}, sample {row + 1}"

    for name in names:
        channels = xdf_streams.pose_channels(where, read.channels, name)
        mm = [_mm_per_unit(f"{where}, {name}", channel, mapping) for channel in channels[:3]]
        pose = values[:, [channel.index for channel in channels]]
        with np.errstate(over="ignore"):
            position_mm = pose[:, :3] * mm
        numbers = np.concatenate([position_mm, mapped.quaternions(pose[:, 3:], declared, locate)], -1)
        tracks.append(mapped.Track(frame, frame, read.time_s, numbers))
    return replace(mapped.samples_of_tracks(tracks, mapping, layout, locate, read.notes), orientation=kind)


def _chosen_stream(path: Path, mapping: FileMapping | None) -> xdf_streams.Stream:
    """Return the stream that the mapping names, or else the only stream of type MoCap."""
    streams = xdf_streams.read_streams(path)
    wanted = None if mapping is None else mapping.details.get("stream")
    chosen = [stream for stream in streams if wanted in (stream.name, stream.number)]
    if wanted is None:
        chosen = [stream for stream in streams if stream.type.lower() == "mocap"]
    if len(chosen) == 1:
        return chosen[0]
    if wanted is None and not chosen:
        have = ", ".join(f"{s.name} ({s.type or 'no type'})" for s in streams) or "no stream at all"
        raise InputError(f"{path}: has no stream of type MoCap; it has {have}")
    numbered = ", ".join(f"{s.name}, number {s.number}" for s in (streams if wanted else chosen)) or "none"
    if wanted is None:
        raise InputError(
            f"{path}: has {len(chosen)} streams of type MoCap ({numbered}); select one in a "
            "mapping with xdf.stream, by its name or its number"
        )
    say = "; give its number" if chosen else nearest(str(wanted), [s.name for s in streams])
    raise InputError(f"{path}: has {len(chosen) or 'no'} streams of {wanted!r}; it has {numbered}{say}")


def _mm_per_unit(where: str, channel: xdf_streams.StreamChannel, mapping: FileMapping) -> float:
    """Return a channel's unit in mm. Raises InputError if it is missing, unknown or not the mapping's."""
    unit = UNIT_NAMES.get(channel.unit)
    if channel.unit and unit is None:
        raise InputError(
            f"{where}: channel {channel.label}: unit: is {channel.unit!r}; expected meters, centimeters, "
            "millimeters or inches"
        )
    mapped_unit = mapping.config.get("position_unit")
    if unit is None and mapped_unit is None:
        raise InputError(f"{where}: channel {channel.label}: has no unit; set position_unit in a mapping")
    if None not in (unit, mapped_unit) and unit != mapped_unit:
        raise InputError(
            f"{mapping.where}: position_unit: is {mapped_unit}, but {where} has {channel.unit}; find out "
            "which is right"
        )
    return mapping.mm_per_unit or MM_PER_UNIT[str(unit)]
