"""The files beside a `*_motion.tsv` that say what its columns are, found by BIDS's inheritance principle.

A tracked point's channels are found among them, and checked against what else is said.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError, listed
from shukotsu.files.limits import RATES_HZ, check_regular
from shukotsu.files.text_files import reading
from shukotsu.motion_bids.dataset_files import OWN_KEY, read_rows, read_text
from shukotsu.schemas.mapping import FileMapping
from shukotsu.schemas.units import MM_PER_UNIT

MOTION_ENDING = "_motion.tsv"

_ROOT = "dataset_description.json"
"""What a dataset's own folder holds."""

_REQUIRED = ("name", "component", "type", "tracked_point", "units")

_LEVELS = 4
"""motion, session, subject and dataset folder: where a sidecar may lie."""

SHIFT_TO_MM = {"mm": 0, "cm": 1, "m": 3}
"""By how many places the decimal point moves from that unit to mm."""

XYZ = ("x", "y", "z")
WXYZ = ("quat_w", "quat_x", "quat_y", "quat_z")

_DIRECTIONS = dict(zip("APLRSI", np.kron(np.eye(3), [[1], [-1]]), strict=True))
"""SpatialAxes: anterior, posterior, left, right, superior, inferior, in right-handed coordinates."""


@dataclass(frozen=True)
class Channel:
    """One row of channels.tsv, which describes the column of motion.tsv at its `index` from 0."""

    index: int
    name: str
    component: str
    type: str
    tracked_point: str
    units: str
    reference_frame: str

    @property
    def title(self) -> str:
        """Return the title of the column, which has no header and whose name may be another's too."""
        return f"{self.index + 1} ({self.name})"


@dataclass(frozen=True)
class Sidecars:
    """Hold what the files beside a motion.tsv say; both JSON objects are empty where there is no file."""

    channels_path: Path
    channels: tuple[Channel, ...]
    motion: Mapping[str, Any]
    channels_json: Mapping[str, Any]

    def of_type(self, kind: str, point: str) -> list[Channel]:
        """Channels of a type and a tracked point, in the order of the columns."""
        return [c for c in self.channels if c.type == kind and c.tracked_point == point]

    def points(self) -> tuple[str, ...]:
        """The tracked points that have a position or an orientation, in the order of the columns."""
        posed = [c.tracked_point for c in self.channels if c.type in ("POS", "ORNT")]
        return tuple(dict.fromkeys(point for point in posed if point != "n/a"))

    def own(self) -> Mapping[str, Any]:
        """Return this program's own entries, by its exporter; empty in a file of others."""
        content = self.motion.get(OWN_KEY, {})
        return content if isinstance(content, dict) else {}

    def frame_levels(self, frame: str) -> Mapping[str, Any]:
        """Return the entry of a reference frame in channels.json; empty where there is none."""
        content: Any = self.channels_json
        for key in ("reference_frame", "Levels", frame):
            content = content.get(key) if isinstance(content, dict) else None
        return content if isinstance(content, dict) else {}

    def tracker(self) -> str:
        """Manufacturer and model as motion.json has them; empty where it says neither."""
        words = (self.motion.get(key) for key in ("Manufacturer", "ManufacturersModelName"))
        return " ".join(word for word in words if isinstance(word, str) and word.lower() != "n/a")

    def sampling_frequency_hz(self) -> float | None:
        """SamplingFrequency of motion.json; None where there is none that any recording has."""
        value = self.motion.get("SamplingFrequency")
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        if not RATES_HZ[0] <= value <= RATES_HZ[1]:
            return None
        return float(value)


def read_sidecars(path: Path) -> Sidecars:
    """Read what lies beside a motion.tsv, or above it where it is inherited.

    Raises InputError where the file has another ending, channels.tsv is absent, or a sidecar is none.
    """
    if not path.name.endswith(MOTION_ENDING):
        raise InputError(
            f"{path}: is not named as Motion-BIDS has it; expected a name that ends in {MOTION_ENDING}"
        )
    with reading(path):
        check_regular(path, "a recording")
    tables = list(_inherited(path, "channels", ".tsv"))
    if not tables:
        expected = path.name.removesuffix(MOTION_ENDING) + "_channels.tsv"
        raise InputError(
            f"{path}: no {expected} lies beside it; it says what the columns are, so copy it too"
        )
    return Sidecars(tables[-1], _channels(tables[-1]), _merged(path, "motion"), _merged(path, "channels"))


def sidecar_files(path: Path) -> list[Path]:
    """Give every file beside or above a motion.tsv on which depends what it holds."""
    kinds = [("channels", ".tsv"), ("motion", ".json"), ("channels", ".json")]
    folders = _dataset_folders(path)
    return [
        *(sidecar for kind in kinds for sidecar in _inherited(path, *kind)),
        *(folder / _ROOT for folder in folders if (folder / _ROOT).is_file()),
    ]


def _dataset_folders(path: Path) -> list[Path]:
    """Give the folders that sidecars may lie in, from the motion.tsv's own up to the dataset's."""
    folders = [path.parent, *path.absolute().parent.parents[: _LEVELS - 1]]
    root = next((i for i, folder in enumerate(folders) if (folder / _ROOT).is_file()), 0)
    return folders[: root + 1]


def _inherited(path: Path, suffix: str, ending: str) -> Iterator[Path]:
    """Give the sidecars that apply to a motion.tsv, the nearest and most specific last."""
    entities = set(path.name.removesuffix(MOTION_ENDING).split("_"))
    for folder in reversed(_dataset_folders(path)):
        sidecars = []
        for candidate in sorted(folder.glob(f"*{suffix}{ending}")):
            *own, last = candidate.name.removesuffix(ending).split("_")
            if last == suffix and set(own) <= entities and candidate.exists():
                sidecars.append((len(own), candidate))
        yield from (candidate for _, candidate in sorted(sidecars))


def _merged(path: Path, suffix: str) -> dict[str, Any]:
    """The keys of the JSON sidecars that apply; InputError where one holds no object."""
    merged: dict[str, Any] = {}
    for sidecar in _inherited(path, suffix, ".json"):
        try:
            loaded = json.loads(read_text(sidecar))
        except (ValueError, RecursionError) as error:
            raise InputError(f"{sidecar}: is not valid JSON ({error}); expected an object") from error
        if not isinstance(loaded, dict):
            raise InputError(f"{sidecar}: holds no JSON object; expected one, in braces")
        merged |= loaded
    return merged


def _channels(path: Path) -> tuple[Channel, ...]:
    header, rows = read_rows(path)
    missing = [name for name in _REQUIRED if name not in header]
    if missing:
        raise InputError(f"{path}: column {', '.join(missing)} is missing; found {listed(header)}")
    if not rows:
        raise InputError(f"{path}: has a header but no rows; expected one row a column of motion.tsv")
    return tuple(
        Channel(
            index,
            cells["name"],
            cells["component"].lower(),
            cells["type"].upper(),
            cells["tracked_point"],
            cells["units"],
            cells.get("reference_frame", "n/a"),
        )
        for index, cells in enumerate(dict(zip(header, row, strict=True)) for row in rows)
    )


@dataclass(frozen=True)
class Point:
    """The channels of a tracked point.

    position : of x, y and z; orientation : of w, x, y and z, or of the three angles in the order of `axes`,
    which is None for quaternions; none of a point.
    """

    position: tuple[Channel, ...]
    orientation: tuple[Channel, ...]
    axes: str | None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """All of them."""
        return self.position + self.orientation


def find_point(sidecars: Sidecars, name: str, mapping: FileMapping) -> Point:
    """Find a tracked point's channels; a quaternion goes before angles, where there are both."""
    where = f"{sidecars.channels_path}: tracked point {name}"
    position = _components(where, sidecars.of_type("POS", name), "POS", XYZ)
    for channel in position:
        check_unit(sidecars, channel, tuple(SHIFT_TO_MM))
    units = {channel.units for channel in position}
    if mapping.mm_per_unit and {MM_PER_UNIT[unit] for unit in units} != {mapping.mm_per_unit}:
        raise InputError(
            f"{mapping.where}: position_unit: is {mapping.config['position_unit']}, but "
            f"{where} has {', '.join(sorted(units))}; find out which is right"
        )
    turning = sidecars.of_type("ORNT", name)
    orientation = mapping.orientation or {}
    if not turning:
        return Point(position, (), None)
    quaternion = any(channel.component in WXYZ for channel in turning)
    kind = "quaternion" if quaternion else "euler"
    if orientation.get("kind", kind) != kind:
        raise InputError(
            f"{mapping.where}: orientation.kind: is {orientation['kind']}, but {where} has {kind} components"
        )
    if quaternion:
        return Point(position, _components(where, turning, "ORNT", WXYZ), None)
    angles = dict(zip(XYZ, _components(where, turning, "ORNT", XYZ), strict=True))
    for channel in angles.values():
        check_unit(sidecars, channel, (orientation["unit"],) if orientation else ("rad", "deg"))
    axes = _axes(sidecars, angles["x"], orientation, mapping)
    return Point(position, tuple(angles[axis.lower()] for axis in axes), axes)


def _components(
    where: str, channels: Sequence[Channel], kind: str, components: Sequence[str]
) -> tuple[Channel, ...]:
    known = [channel.component for channel in channels]
    for component in components:
        if known.count(component) != 1:
            count = known.count(component) or "no"
            raise InputError(f"{where}: has {count} {kind} channels of component {component}; expected one")
    return tuple(channels[known.index(component)] for component in components)


def check_unit(sidecars: Sidecars, channel: Channel, known: tuple[str, ...]) -> None:
    """Raise InputError where the channel's unit is none of those known."""
    if channel.units not in known:
        raise InputError(
            f"{sidecars.channels_path}: channel {channel.name}: units: is {channel.units!r}; "
            f"expected {' or '.join(known)}"
        )


def _axes(sidecars: Sidecars, channel: Channel, orientation: Mapping[str, Any], mapping: FileMapping) -> str:
    """The axes about which the receiver turns in turn: BIDS's RotationOrder, which is extrinsic, reversed."""
    order = sidecars.frame_levels(channel.reference_frame).get("RotationOrder")
    known = isinstance(order, str) and "".join(sorted(order)) == "XYZ"
    mapped_axes = orientation.get("axes")
    if not known and mapped_axes is None:
        raise InputError(
            f"{sidecars.channels_path}: tracked point {channel.tracked_point}: has Euler angles, but "
            f"channels.json gives the reference frame {channel.reference_frame!r} no RotationOrder such as "
            "XYZ; say orientation.axes in a mapping"
        )
    if known and mapped_axes is not None and mapped_axes != str(order)[::-1]:
        raise InputError(
            f"{mapping.where}: orientation.axes: is {mapped_axes}, but channels.json has the RotationOrder "
            f"{order} about fixed axes, which is {str(order)[::-1]} about the receiver's own; find out which "
            "is right"
        )
    axes = str(order)[::-1] if known else str(mapped_axes)
    if sorted(axes) != ["X", "Y", "Z"]:
        raise InputError(f"{mapping.where}: orientation.axes: is {axes}; expected X, Y and Z once each")
    return axes


def check_frames(sidecars: Sidecars, points: Sequence[Point]) -> None:
    """All poses must be in one right-handed frame, as far as anything says which it is."""
    frames = list(dict.fromkeys(c.reference_frame for point in points for c in point.channels))
    if len(frames) > 1:
        raise InputError(
            f"{sidecars.channels_path}: reference_frame: is {', '.join(frames)}; expected one for all poses, "
            "or a mapping that leaves the others out"
        )
    levels = sidecars.frame_levels(frames[0])
    axes = levels.get("SpatialAxes")
    known = isinstance(axes, str) and len(axes) == 3 and all(axis in _DIRECTIONS for axis in axes)
    left = known and np.linalg.det([_DIRECTIONS[axis] for axis in str(axes)]) < 0
    rule = levels.get("RotationRule", "n/a")
    if left or rule not in ("right-hand", "n/a"):
        what = f"SpatialAxes {axes}" if left else f"RotationRule {rule!r}"
        raise InputError(
            f"{sidecars.channels_path}: reference frame {frames[0]} is not right-handed ({what} in "
            "channels.json); export it again in right-handed coordinates"
        )
