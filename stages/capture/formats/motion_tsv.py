"""Motion-BIDS: a `*_motion.tsv` and the sidecars that say what its columns are (BIDS, Motion)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from shukotsu.errors import InputError
from shukotsu.files.text_files import open_text
from shukotsu.motion_bids.dataset_files import OWN_KEY
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.mapping import FileMapping
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.capture.formats.cells import EMPTY, Cells
from shukotsu.stages.capture.formats.mapped import Track, implied_mapping, name_in_file, samples_of_tracks
from shukotsu.stages.capture.formats.motion_sidecars import (
    SHIFT_TO_MM,
    Channel,
    Point,
    Sidecars,
    check_frames,
    check_unit,
    find_point,
    read_sidecars,
)
from shukotsu.stages.capture.formats.orientation import quaternions
from shukotsu.stages.capture.formats.text_table import TextTable, file_is_ended
from shukotsu.stages.capture.poses_table import FLAGS
from shukotsu.stages.capture.samples import Samples

SECONDS_SHIFT = {"s": 0, "ms": -3, "us": -6}

_SEEN_AGAIN = ("missing", "time-missing", "time-not-increasing", "frozen")
"""Flags that follow from the numbers and times themselves: they are told anew when a file is read."""


def read_motion_bids(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read a motion.tsv with its channels.tsv, channels.json and motion.json.

    Without a mapping every tracked point must be a segment of the layout. Times are those of the LATENCY
    channel, else they are counted by SamplingFrequency; frames are counted from 0. A file that
    `shukotsu.stages.capture export-bids` wrote gives its frame numbers, device times and flags back.
    Raises InputError where anything is absent, inconsistent or in a unit that is not known.
    """
    sidecars = read_sidecars(path)
    where = str(sidecars.channels_path)
    known = sidecars.points()
    mapping = mapping or implied_mapping(where, "motion-bids", "tracked_point", known)
    names = [name_in_file(mapping, segment, "tracked_point", known, where) for segment in mapping.receivers]
    points = [find_point(sidecars, name, mapping) for name in names]
    check_frames(sidecars, points)
    exported = _ExportedChannels.of(path, sidecars, names)
    times = [exported.time.get(name) or _latency(sidecars, name) for name in names]
    used = [*itertools.chain(*(point.channels for point in points)), *times, *exported.flags.values()]
    wanted = [channel.title for channel in [*used, exported.frame] if channel is not None]
    titles = tuple(channel.title for channel in sidecars.channels)
    expected = f"{len(titles)}, one for each row of channels.tsv (motion.tsv has no header line)"
    empty = (*EMPTY, "n/a", *_missing_values(sidecars))
    text = TextTable(path, partial(open_text, path), "\t", titles, titles, 0, expected, empty, quoted=False)
    text = replace(text, ended=file_is_ended(path))
    cells = text.cells(wanted)
    rate_hz = 1.0 if all(times) else _rate_hz(path, sidecars, mapping)
    row = np.arange(cells.rows)
    frame = row if exported.frame is None else cells.wholes(exported.frame.title)
    tracks = []
    for name, point, channel in zip(names, points, times, strict=True):
        time_s = row / rate_hz if channel is None else _times(cells, channel, sidecars)
        track = Track(row, frame, time_s, _numbers(cells, point, mapping), oriented=bool(point.orientation))
        tracks.append(exported.track(cells, name, track))
    place, losses = cells.place, filter(None, [text.cut_off(wanted)])
    del cells, text  # more than the file, before all is put together
    pa.default_memory_pool().release_unused()
    samples = samples_of_tracks(tracks, mapping, layout, place, losses=losses)
    kind = "euler" if any(point.axes for point in points) else "quaternion"
    return replace(samples, tracker=sidecars.tracker(), orientation=kind)


def _latency(sidecars: Sidecars, name: str) -> Channel | None:
    channels = [c for c in sidecars.channels if c.type == "LATENCY" and c.tracked_point == name]
    channels = channels or [c for c in sidecars.channels if c.type == "LATENCY" and c.tracked_point == "n/a"]
    if len(channels) > 1:
        raise InputError(
            f"{sidecars.channels_path}: tracked point {name}: has {len(channels)} LATENCY channels; "
            "expected one"
        )
    return channels[0] if channels else None


def _times(cells: Cells, channel: Channel, sidecars: Sidecars) -> Array:
    check_unit(sidecars, channel, tuple(SECONDS_SHIFT))
    return cells.shifted_reals(channel.title, SECONDS_SHIFT[channel.units])


def _rate_hz(path: Path, sidecars: Sidecars, mapping: FileMapping) -> float:
    stated_hz = sidecars.sampling_frequency_hz()
    if stated_hz is None and mapping.rate_hz is None:
        raise InputError(
            f"{path}: has no LATENCY channel and its motion.json no SamplingFrequency above 0; "
            "add SamplingFrequency there, or rate_hz in a mapping"
        )
    if stated_hz is not None and mapping.rate_hz not in (None, stated_hz):
        raise InputError(
            f"{mapping.where}: rate_hz: is {mapping.rate_hz:g}, but motion.json has the SamplingFrequency "
            f"{stated_hz:g}; find out which is right"
        )
    return float(stated_hz or mapping.rate_hz or 0)


def _missing_values(sidecars: Sidecars) -> list[str]:
    """Read what motion.json's MissingValues adds to the usual "no value": a text or a number, or several."""
    given = sidecars.motion.get("MissingValues")
    values = given if isinstance(given, list) else [given]
    return [str(one).strip() for one in values if isinstance(one, str | int | float)]


def _numbers(cells: Cells, point: Point, mapping: FileMapping) -> Array:
    """Poses as Samples have them, shape (T, 7)."""
    position = [cells.shifted_reals(channel.title, SHIFT_TO_MM[channel.units]) for channel in point.position]
    if not point.orientation:
        return np.concatenate([np.stack(position, -1), np.full((cells.rows, 4), np.nan)], -1)
    turning = [cells.shifted_reals(channel.title, 0) for channel in point.orientation]
    rotates = (mapping.orientation or {}).get("rotates", "receiver-to-transmitter")
    if point.axes is None:
        orientation = {"kind": "quaternion", "order": "wxyz", "rotates": rotates}
    else:
        unit = point.orientation[0].units
        orientation = {"kind": "euler", "axes": point.axes, "unit": unit, "rotates": rotates}
    turned = quaternions(np.stack(turning, -1), orientation, cells.place)
    return np.concatenate([np.stack(position, -1), turned], -1)


@dataclass(frozen=True)
class _ExportedChannels:
    """The channels that this program's exporter names in motion.json; none in a file of others.

    time, flags : tracked point -> channel. names : what bit i of the flags stands for.
    """

    frame: Channel | None
    time: Mapping[str, Channel]
    flags: Mapping[str, Channel]
    names: tuple[str, ...]

    @classmethod
    def of(cls, path: Path, sidecars: Sidecars, points: Sequence[str]) -> _ExportedChannels:
        """Look the channels up; InputError where motion.json names one that channels.tsv does not have."""
        own = sidecars.own()
        place = f"{path}: motion.json, {OWN_KEY}"

        def channel(name: object, key: str) -> Channel:
            for named in sidecars.channels:
                if named.name == name:
                    return named
            raise InputError(f"{place}.{key}: names the channel {name!r}, which channels.tsv does not have")

        def channels(key: str) -> dict[str, Channel]:
            named = own.get(key, {})
            if not isinstance(named, dict):
                raise InputError(
                    f"{place}.{key}: is {named!r}; expected an object of channels by tracked point"
                )
            return {point: channel(named[point], key) for point in points if point in named}

        names = own.get("FlagBits", [])
        if not isinstance(names, list) or not all(isinstance(name, str) and name in FLAGS for name in names):
            raise InputError(
                f"{place}.FlagBits: is {names!r}; expected a list of flags that this program knows"
            )
        frame = None if "FrameChannel" not in own else channel(own["FrameChannel"], "FrameChannel")
        return cls(frame, channels("TimeChannels"), channels("FlagChannels"), tuple(names))

    def track(self, cells: Cells, name: str, track: Track) -> Track:
        """Set a tracked point's flags, and leave out the rows that it did not have."""
        if name not in self.flags:
            return track
        bits = cells.wholes(self.flags[name].title)
        flags = {flag: (bits >> bit) & 1 == 1 for bit, flag in enumerate(self.names)}
        absent: npt.NDArray[np.bool_] = flags.pop("no-row", np.zeros(len(bits), bool))
        time_s = np.where(flags.get("time-missing", absent), np.nan, track.time_s)
        flags = {flag: marked for flag, marked in flags.items() if flag not in _SEEN_AGAIN}
        return replace(track, time_s=time_s, flags=flags).of(~absent)
