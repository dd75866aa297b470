"""A tracked point's channels, found among those of channels.tsv and checked against what else is said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schemas.errors import InputError
from schemas.mapping import MM_PER_UNIT, FileMapping
from stages.capture.formats.motion_sidecars import Channel, Sidecars

SHIFT_TO_MM = {"mm": 0, "cm": 1, "m": 3}
"""By how many places the decimal point moves from that unit to mm."""

XYZ = ("x", "y", "z")
WXYZ = ("quat_w", "quat_x", "quat_y", "quat_z")

_DIRECTIONS = dict(zip("APLRSI", np.kron(np.eye(3), [[1], [-1]]), strict=True))
"""SpatialAxes: anterior, posterior, left, right, superior, inferior, in right-handed coordinates."""


@dataclass(frozen=True)
class Point:
    """The channels of a tracked point.

    position : of x, y and z; orientation : of w, x, y and z, or of the three angles in the order of `axes`,
    which is None for quaternions.
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
