"""XDF: a stream of type MoCap as LabStreamingLayer records it (XDF's MoCap meta-data)."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from kinematics.rotations import Array
from schemas.errors import InputError
from schemas.layout import Layout
from schemas.mapping import MM_PER_UNIT, FileMapping
from stages.capture.formats.mapped import Track, did_you_mean, samples_of_tracks
from stages.capture.formats.naming import UNKNOWN, draft_receivers
from stages.capture.formats.orientation import quaternions
from stages.capture.formats.xdf_chunks import SAMPLE_BYTES, Channel, Stream, read_streams, whole_chunks_of
from stages.capture.samples import ReadingOptions, Samples

POSITION = ("positionx", "positiony", "positionz")
QUATERNION = ("orientationa", "orientationb", "orientationc", "orientationd")
"""A is the scalar; B, C and D are the axial components x, y and z."""

EULER = ("orientationp", "orientationh", "orientationr")

UNITS = {
    unit: short
    for short, words in {
        "mm": "mm millimeter millimeters millimetre millimetres",
        "cm": "cm centimeter centimeters centimetre centimetres",
        "m": "m meter meters metre metres",
        "inch": "inch inches",
    }.items()
    for unit in words.split()
}
"""What senders write of a unit, and the mapping's word for it."""


def read_xdf(path: Path, layout: Layout, options: ReadingOptions) -> Samples:
    """Read a MoCap stream: PositionX, Y, Z and OrientationA, B, C, D of every marker or object.

    Without a mapping each must be a segment of the layout. Time stamps are those of the file, corrected by
    its clock offsets where it has any, and not smoothed; samples are counted from 0 as frames; NaN is a gap.
    Raises InputError where the stream is not to be told, is damaged or has a unit that is not known.
    """
    stream = _chosen_stream(path, options.mapping)
    mapping = options.mapping or _implied_mapping(path, stream)
    if (mapping.orientation or {}).get("kind", "quaternion") != "quaternion":
        raise InputError(f"{mapping.where}: orientation.kind: must be quaternion; others of XDF are not read")
    channels = [_pose_channels(path, stream, mapping, segment) for segment in mapping.receivers]
    time_s, values, notes = _load(path, stream)

    def place(row: int) -> str:
        return f"{path}: stream {stream.name}, sample {row + 1}"

    frame = np.arange(len(time_s))
    tracks = [Track(frame, frame, time_s, _numbers(values, found, mapping, place)) for found in channels]
    return samples_of_tracks(tracks, mapping, layout, place, notes)


def describe(path: Path) -> list[str]:
    """Say what streams there are and which markers or objects those of type MoCap have, a line each."""
    lines = []
    for stream in read_streams(path):
        lines.append(
            f"XDF stream {stream.name!r} of type {stream.type or '(none)'}: {stream.channel_count} channels "
            f"of {stream.format}, {f'{stream.rate_hz:g} Hz' if stream.rate_hz else 'irregular'}"
        )
        for owner in _owners(stream) if _is_mocap(stream) else ():
            types = [f"{c.type} [{c.unit or 'no unit'}]" for c in stream.channels if c.owner == owner]
            lines.append(f"marker or object {owner}: {', '.join(types)}")
    return lines


def draft_mapping(path: Path) -> dict[str, Any]:
    """A mapping to edit, of the first MoCap stream; InputError where there is none."""
    stream = _mocap_streams(path, read_streams(path))[0]
    units = [UNITS[c.unit] for c in stream.channels if c.type in POSITION and c.unit in UNITS]
    return {
        "format": "xdf",
        "position_unit": next(iter(units), UNKNOWN),
        "orientation": {"kind": "quaternion", "order": "wxyz"},
        "receivers": draft_receivers(_owners(stream), "value"),
        "xdf": {"stream": stream.name},
    }


def _is_mocap(stream: Stream) -> bool:
    return stream.type.lower() == "mocap"


def _mocap_streams(path: Path, streams: Sequence[Stream]) -> list[Stream]:
    found = [stream for stream in streams if _is_mocap(stream)]
    if not found:
        have = ", ".join(f"{s.name} ({s.type or 'no type'})" for s in streams) or "no stream at all"
        raise InputError(f"{path}: has no stream of type MoCap; it has {have}")
    return found


def _owners(stream: Stream) -> list[str]:
    """The markers and objects that have a position or an orientation, in the order of the channels."""
    posed = (*POSITION, *QUATERNION, *EULER)
    return list(dict.fromkeys(c.owner for c in stream.channels if c.type in posed and c.owner))


def _chosen_stream(path: Path, mapping: FileMapping | None) -> Stream:
    """The stream that the mapping names, else the only one of type MoCap; its header checked."""
    streams = read_streams(path)
    wanted = None if mapping is None else mapping.details.get("stream")
    if wanted is None:
        found = _mocap_streams(path, streams)
        if len(found) > 1:
            raise InputError(
                f"{path}: has {len(found)} streams of type MoCap ({', '.join(s.name for s in found)}); "
                "say which in a mapping as xdf.stream"
            )
    else:
        found = [stream for stream in streams if stream.name == wanted]
        if len(found) != 1:
            names = [stream.name for stream in streams]
            raise InputError(
                f"{path}: has {len(found) or 'no'} streams named {wanted!r}; it has "
                f"{', '.join(names) or 'none'}{did_you_mean(str(wanted), names)}"
            )
    _check_header(path, found[0])
    return found[0]


def _check_header(path: Path, stream: Stream) -> None:
    where = f"{path}: stream {stream.name}"
    if stream.format not in SAMPLE_BYTES:
        raise InputError(f"{where}: holds {stream.format or 'no format'}; expected numbers")
    if len(stream.channels) != stream.channel_count:
        raise InputError(
            f"{where}: has {stream.channel_count} channels, but its header describes {len(stream.channels)}; "
            "the sender must describe each (label, marker or object, type, unit)"
        )


def _implied_mapping(path: Path, stream: Stream) -> FileMapping:
    receivers = {owner: {"value": owner} for owner in _owners(stream)}
    if not receivers:
        raise InputError(
            f"{path}: stream {stream.name}: no channel names a marker or object and a pose's type"
        )
    return FileMapping(f"{path}: stream {stream.name}", "xdf", 0.0, None, None, receivers, (), {})


def _pose_channels(path: Path, stream: Stream, mapping: FileMapping, segment: str) -> list[Channel]:
    """The channels of x, y, z and A, B, C, D of a segment's marker or object, in this order."""
    owner = mapping.receivers[segment].get("value")
    if owner is None:
        raise InputError(
            f"{mapping.where}: receivers.{segment}: has no value; say which marker or object it is"
        )
    known = _owners(stream)
    if str(owner) not in known:
        raise InputError(
            f"{mapping.where}: receivers.{segment}: {owner!r} is no marker or object of stream {stream.name} "
            f"in {path}, which has {', '.join(known) or 'none'}{did_you_mean(str(owner), known)}"
        )
    where = f"{path}: stream {stream.name}, {owner}"
    own = [channel for channel in stream.channels if channel.owner == str(owner)]
    if any(c.type in EULER for c in own) and not any(c.type in QUATERNION for c in own):
        raise InputError(
            f"{where}: has angles (OrientationP, H, R), whose order XDF does not say; record quaternions"
        )
    found = []
    for kind in (*POSITION, *QUATERNION):
        fitting = [channel for channel in own if channel.type == kind]
        if len(fitting) != 1:
            spelled = kind.capitalize()[:-1] + kind[-1].upper()
            raise InputError(f"{where}: has {len(fitting) or 'no'} channels of type {spelled}; expected one")
        found.append(fitting[0])
    for channel in found[:3]:
        _check_unit(where, channel, mapping)
    return found


def _check_unit(where: str, channel: Channel, mapping: FileMapping) -> None:
    unit = UNITS.get(channel.unit)
    if channel.unit and unit is None:
        raise InputError(
            f"{where}: channel {channel.label}: unit: is {channel.unit!r}; expected meters, centimeters, "
            "millimeters or inches"
        )
    told = mapping.config.get("position_unit")
    if unit is None and told is None:
        raise InputError(f"{where}: channel {channel.label}: has no unit; say position_unit in a mapping")
    if None not in (unit, told) and unit != told:
        raise InputError(
            f"{mapping.where}: position_unit: is {told}, but {where} has {channel.unit}; find out "
            "which is right"
        )


def _load(path: Path, stream: Stream) -> tuple[Array, Array, tuple[str, ...]]:
    """Time stamps (T,), values (T, C) and notes of a stream, read by pyxdf without its smoothing of time."""
    import pyxdf

    file, cut_off = whole_chunks_of(path, stream)
    try:
        with _quiet():
            streams, _ = pyxdf.load_xdf(file, dejitter_timestamps=False)
    except Exception as error:  # pyxdf raises whatever its code runs into
        what = f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: stream {stream.name}: pyxdf cannot read it ({what})") from error
    time_s = np.asarray(streams[0]["time_stamps"], float)
    values = np.asarray(streams[0]["time_series"], float)
    if not len(time_s):
        raise InputError(f"{path}: stream {stream.name}: has no samples")
    notes = []
    if cut_off is not None:
        notes.append(f"the file is cut off in the chunk at byte {cut_off}; what comes before it is read")
    return time_s, values, tuple(notes)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep pyxdf from writing to stderr: what a reader must know is a sentence of its own."""
    logger = logging.getLogger("pyxdf.pyxdf")
    before = logger.disabled
    logger.disabled = True
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.disabled = before


def _numbers(
    values: Array, channels: Sequence[Channel], mapping: FileMapping, place: Callable[[int], str]
) -> Array:
    """Poses as Samples have them, shape (T, 7)."""
    found = values[:, [channel.index for channel in channels]]
    mm = [mapping.mm_per_unit or MM_PER_UNIT[UNITS[channel.unit]] for channel in channels[:3]]
    orientation = {
        "kind": "quaternion",
        "order": "wxyz",
        "rotates": "receiver-to-transmitter",
        **(mapping.orientation or {}),
    }
    with np.errstate(over="ignore"):
        position_mm = found[:, :3] * mm
    return np.concatenate([position_mm, quaternions(found[:, 3:], orientation, place)], -1)
