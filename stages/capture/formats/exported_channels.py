"""What the exporter says in motion.json that BIDS has no key for, read back: frames, device times, flags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from schemas.bids.channels import OWN_KEY
from schemas.errors import InputError
from stages.capture.formats.cells import Cells
from stages.capture.formats.mapped import Track
from stages.capture.formats.motion_sidecars import Channel, Sidecars
from stages.capture.poses_table import FLAGS

_SEEN_AGAIN = ("missing", "time-missing", "time-not-increasing", "frozen")
"""Flags that follow from the numbers and times themselves: they are told anew when a file is read."""


@dataclass(frozen=True)
class ExportedChannels:
    """The channels that this program's exporter names in motion.json; none in a file of others.

    time, flags : tracked point -> channel. names : what bit i of the flags stands for.
    """

    frame: Channel | None
    time: Mapping[str, Channel]
    flags: Mapping[str, Channel]
    names: tuple[str, ...]

    @classmethod
    def of(cls, path: Path, sidecars: Sidecars, points: Sequence[str]) -> ExportedChannels:
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
        """Give a tracked point's flags as marks, and leave out the rows that it did not have."""
        if name not in self.flags:
            return track
        bits = cells.wholes(self.flags[name].title)
        marks = {flag: (bits >> bit) & 1 == 1 for bit, flag in enumerate(self.names)}
        absent: npt.NDArray[np.bool_] = marks.pop("no-row", np.zeros(len(bits), bool))
        time_s = np.where(marks.get("time-missing", absent), np.nan, track.time_s)
        marks = {flag: marked for flag, marked in marks.items() if flag not in _SEEN_AGAIN}
        return replace(track, time_s=time_s, marks=marks).of(~absent)
