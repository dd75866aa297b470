"""A layout: segments, joints and digits, and which of them carry a receiver.

A layout is not limited to hands: it is any tree of segments with chains that end in a tip.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.study.config_files import config_path, read_config
from shukotsu.tables.digests import file_state

Vector = tuple[float, float, float]
Entries = dict[str, dict[str, Any]]
"""Entries of a layout file by name."""

FINGER_MM, ARM_MM = 2.0, 10.0
"""Default accuracy required of a joint's centre: for a hand, a fifth of a finger's thickness; for thicker
limbs, whose skin moves by centimetres, a fifth of an arm's.
"""
FINGERS = frozenset({"thumb", "index", "middle", "ring", "little"})

_AXES: dict[str, Vector] = {"distal": (1.0, 0.0, 0.0), "lateral": (0.0, 1.0, 0.0), "dorsal": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Segment:
    """A bone's rigid body and how its receiver is mounted.

    receiver, left_receiver : station numbers at the tracker of this hand and of the other one. They are as
    in the file for a right hand and are exchanged for a left hand (`Layout.of_hand`).
    distal, lateral, dorsal : these directions of the bone as unit vectors in the receiver's frame.
    """

    name: str
    receiver: int | None
    measured: bool
    optional: bool
    distal: Vector
    lateral: Vector
    dorsal: Vector
    left_receiver: int | None = None

    @property
    def axes(self) -> npt.NDArray[np.float64]:
        """Rotation (3, 3) from the bone's frame (distal, lateral, dorsal) to the receiver's."""
        return np.stack([self.distal, self.lateral, self.dorsal], -1)


@dataclass(frozen=True)
class Plane:
    """The plane that cuts a joint's axis. frame : parent or child, in whose receiver's frame it is given."""

    frame: str
    point_mm: Vector
    normal: Vector


@dataclass(frozen=True)
class Joint:
    """A joint between two receivers.

    parent, child : segments of the anatomical tree. parent_receiver : the nearest segment towards the body
    that carries a receiver (the hand, for the MCP joints of the fingers). dof : degrees of freedom.
    compound : whether another moving joint lies between the two receivers (the CMC joints, for the MCP joints
    of the ring and the little finger).
    """

    name: str
    parent: str
    child: str
    parent_receiver: str
    dof: int
    plane: Plane
    compound: bool = False


@dataclass(frozen=True)
class Digit:
    """A chain from its base segment outward; joint i is the proximal end of segment i.

    base : the segment with a receiver that the chain is attached to. metacarpal : whether segment 0 is a
    metacarpal.
    """

    name: str
    base: str
    segments: tuple[str, ...]
    joints: tuple[str, ...]
    metacarpal: bool

    @property
    def tip(self) -> str:
        """The last segment, whose receiver's origin is taken as the tip."""
        return self.segments[-1]


@dataclass(frozen=True)
class Wrist:
    """The common start of digits whose first joint is not measured. Points are in mm, hand receiver's frame.

    nominal_mm : default position. point_mm : measured position, or None.
    """

    joint: str
    segment: str
    nominal_mm: Vector
    point_mm: Vector | None


@dataclass(frozen=True)
class Layout:
    """The content of a layout file.

    wanted_mm : largest 1-sigma error in 3-D at which a joint's centre is believed. receiver_height_mm :
    height of a receiver's tracked point above its base, or None if the file does not state it.
    """

    name: str
    description: str
    segments: Mapping[str, Segment]
    joints: Mapping[str, Joint]
    digits: Mapping[str, Digit]
    wrist: Wrist | None
    wanted_mm: float = FINGER_MM
    receiver_height_mm: float | None = None

    @property
    def is_hand(self) -> bool:
        """Whether the layout describes a hand: it has a wrist, or a digit with the name of a hand's digit."""
        return self.wrist is not None or bool(FINGERS & {*self.digits})

    @property
    def measured(self) -> tuple[str, ...]:
        """Segments that carry a receiver, including optional ones, in the layout's order."""
        return tuple(s.name for s in self.segments.values() if s.measured)

    @property
    def expected(self) -> tuple[str, ...]:
        """Segments whose poses every recording should contain: measured and not optional."""
        return tuple(name for name in self.measured if not self.segments[name].optional)

    def of_hand(self, hand: str) -> Layout:
        """Return the layout with the station numbers of the given hand (right or left)."""
        if hand != "left":
            return self
        segments = {
            name: replace(s, receiver=s.left_receiver or s.receiver, left_receiver=s.receiver)
            for name, s in self.segments.items()
        }
        return replace(self, segments=segments)

    def matches(self, other: Layout) -> bool:
        """Return whether both have the same segments, joints, digits and wrist.

        They may differ in station numbers and in which receivers are optional.
        """
        bodies, others = (
            {s.name: (s.measured, *(s.axes.ravel() if s.measured else ())) for s in layout.segments.values()}
            for layout in (self, other)
        )
        joined = (self.joints, self.digits, self.wrist) == (other.joints, other.digits, other.wrist)
        return joined and list(bodies.items()) == list(others.items())

    @property
    def solvable(self) -> tuple[Joint, ...]:
        """Joints that Eq. 1-7 can solve because a receiver is worn on both sides of them."""
        return tuple(j for j in self.joints.values() if self.segments[j.child].measured)


def read_layout(name: str | Path, folder: Path = Path()) -> Layout:
    """Read a layout by name or path (relative to `folder`). Raises InputError if it is missing or invalid."""
    path = config_path(str(name), "layout", folder)
    return _read(path, *file_state(path))


@lru_cache(maxsize=16)
def _read(path: Path, *_: int) -> Layout:
    return layout_from_config(read_config(path, "layout"), str(path))


def layout_from_config(config: dict[str, Any], where: str) -> Layout:
    """Build a layout from the content of a file that matches its schema.

    where : name of the file for messages. Raises InputError if the content contradicts itself.
    """
    axes = _AXES | {k: _vector(v) for k, v in config.get("receiver_axes", {}).items()}
    segments = {name: _segment(name, part, axes, where) for name, part in config["segments"].items()}
    _check_receivers(segments, where)
    joint_to = _tree(config, segments, where)
    joints = {name: _joint(name, part, segments, joint_to, where) for name, part in config["joints"].items()}
    by_child = {joint.child: joint for joint in joints.values()}
    digits = {name: _digit(name, part, segments, by_child, where) for name, part in config["digits"].items()}
    wrist = _wrist(config["wrist"], joints, where) if "wrist" in config else None
    if wrist is None and any(not segments[d.segments[0]].measured for d in digits.values()):
        raise InputError(f"{where}: a digit starts with an unmeasured segment, so the layout needs a wrist")
    layout = Layout(config["layout"], config["description"], segments, joints, digits, wrist)
    wanted_mm = config["wanted_mm"] or (FINGER_MM if layout.is_hand else ARM_MM)
    return replace(layout, wanted_mm=wanted_mm, receiver_height_mm=config["receiver_height_mm"])


def _vector(values: list[float]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _segment(name: str, part: dict[str, Any], axes: dict[str, Vector], where: str) -> Segment:
    worn = axes | {k: _vector(v) for k, v in part.get("receiver_axes", {}).items()}
    for first, second in combinations_with_replacement(worn, 2):
        dot = sum(a * b for a, b in zip(worn[first], worn[second], strict=True))
        if abs(dot - (first == second)) > 1e-6:
            odd = f"{first} and {second} are not"
            if first == second:
                odd = f"{first} has length {math.sqrt(dot):.4g}"
            raise InputError(
                f"{where}: segments.{name}: receiver_axes distal, lateral and dorsal must be unit "
                f"vectors at right angles; {odd}"
            )
    receiver, left = part.get("receiver"), part.get("left_receiver")
    return Segment(name, receiver, part["measured"], part["optional"], **worn, left_receiver=left)


def _check_receivers(segments: dict[str, Segment], where: str) -> None:
    seen: dict[int, str] = {}
    for segment in segments.values():
        for number in (segment.receiver, segment.left_receiver):
            if number is not None:
                if number in seen:
                    raise InputError(
                        f"{where}: segments {seen[number]} and {segment.name} both name receiver {number}"
                    )
                seen[number] = segment.name


def _tree(config: dict[str, Any], segments: dict[str, Segment], where: str) -> Entries:
    """Return each child segment's joint. Raises InputError unless the joints form a tree."""
    joint_to: Entries = {}
    for name, part in config["joints"].items():
        for end in ("parent", "child"):
            if part[end] not in segments:
                raise InputError(f"{where}: joints.{name}.{end}: no segment is called {part[end]!r}")
        if part["child"] in joint_to:
            raise InputError(f"{where}: joints.{name}: segment {part['child']} has two parents")
        joint_to[part["child"]] = part
    for start in joint_to:
        seen, above = {start}, start
        while above in joint_to:
            above = joint_to[above]["parent"]
            if above in seen:
                raise InputError(f"{where}: joints: segment {start} is among its own parents")
            seen.add(above)
    return joint_to


def _joint(
    name: str, part: dict[str, Any], segments: dict[str, Segment], joint_to: Entries, where: str
) -> Joint:
    above, compound = part["parent"], False
    while not segments[above].measured:
        if above not in joint_to:
            raise InputError(f"{where}: joints.{name}: no segment above {part['child']} carries a receiver")
        compound |= joint_to[above]["dof"] > 0
        above = joint_to[above]["parent"]
    plane = part.get("plane", {})
    frame = plane.get("frame", "child")
    normal = _vector(plane["normal"]) if "normal" in plane else None
    if normal is not None and not any(normal):
        raise InputError(f"{where}: joints.{name}.plane.normal: has no length")
    segment = segments[above if frame == "parent" else part["child"]]
    point = _vector(plane.get("point_mm", [0, 0, 0]))
    cut = Plane(frame, point, normal or segment.lateral)
    return Joint(name, part["parent"], part["child"], above, part["dof"], cut, compound)


def _digit(
    name: str, part: dict[str, Any], segments: dict[str, Segment], by_child: dict[str, Joint], where: str
) -> Digit:
    chain = part["segments"]
    for above, segment in zip([None, *chain[:-1]], chain, strict=True):
        if segment not in by_child:
            raise InputError(f"{where}: digits.{name}: no joint has {segment!r} as its child")
        if above is not None and by_child[segment].parent != above:
            raise InputError(f"{where}: digits.{name}: {segment} does not hang from {above}")
        if segment != chain[0] and not segments[segment].measured:
            raise InputError(f"{where}: digits.{name}: {segment} carries no receiver; only the first may")
    if not segments[chain[0]].measured and not part["metacarpal"]:
        raise InputError(
            f"{where}: digits.{name}: {chain[0]} carries no receiver, so metacarpal must be true"
        )
    if len(chain) < 2 and part["metacarpal"]:
        raise InputError(f"{where}: digits.{name}: a metacarpal needs a phalanx after it")
    base = by_child[chain[0]].parent_receiver
    return Digit(name, base, tuple(chain), tuple(by_child[s].name for s in chain), part["metacarpal"])


def _wrist(part: dict[str, Any], joints: dict[str, Joint], where: str) -> Wrist:
    if part["joint"] not in joints:
        raise InputError(f"{where}: wrist.joint: no joint is called {part['joint']!r}")
    point = _vector(part["point_mm"]) if "point_mm" in part else None
    return Wrist(part["joint"], joints[part["joint"]].child, _vector(part["nominal_mm"]), point)
