"""A layout: segments, joints and digits, and which of them carry a receiver.

A layout is not limited to hands: it is any tree of segments with chains that end in a tip.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.study.config_files import config_path, read_config
from shukotsu.tables.whole_files import file_state

Vector = tuple[float, float, float]

FINGER_MM, ARM_MM = 2.0, 10.0
"""Default error wanted of a joint's centre: for a hand a fifth of a finger's thickness; for thicker limbs,
whose skin moves by centimetres, the same share of an arm's.
"""
FINGERS = frozenset({"thumb", "index", "middle", "ring", "little"})

_AXES: dict[str, Vector] = {"distal": (1.0, 0.0, 0.0), "lateral": (0.0, 1.0, 0.0), "dorsal": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Segment:
    """A bone's rigid body; its receiver's axes by what they point at.

    receiver, left_receiver : the tracker's station number, of a left hand where that has its own; of the
    layout of a left hand (`Layout.of_hand`) they are exchanged.
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
        """(3, 3) from the bone's axes (distal, lateral, dorsal) to the receiver's."""
        return np.stack([self.distal, self.lateral, self.dorsal], -1)


@dataclass(frozen=True)
class Plane:
    """The plane that cuts a joint's axis, in the frame of the parent's or the child's receiver; or none."""

    frame: str
    point_mm: Vector
    normal: Vector


@dataclass(frozen=True)
class Joint:
    """A joint between two receivers.

    `parent` and `child` are the segments of the anatomical tree; `parent_receiver` is the nearest
    segment towards the body that carries a receiver (for the MCP joints of the fingers the hand).
    compound : whether a joint that moves lies between the two receivers besides this one (for the MCP
    joints of the ring and the little finger their CMC joints).
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

    base : the measured segment that the chain hangs from. metacarpal : whether segment 0 is one.
    """

    name: str
    base: str
    segments: tuple[str, ...]
    joints: tuple[str, ...]
    metacarpal: bool

    @property
    def tip(self) -> str:
        """The segment whose receiver origin is the tip."""
        return self.segments[-1]


@dataclass(frozen=True)
class Wrist:
    """Where digits start that have no first joint of their own; mm in the hand receiver's frame."""

    joint: str
    segment: str
    nominal_mm: Vector
    point_mm: Vector | None


@dataclass(frozen=True)
class Layout:
    """One layout file, read and checked. wanted_mm : the largest 1-sigma error, in 3-D, of a joint's centre
    that is to be believed. receiver_height_mm : of the tracked point over its receiver's base; None where it
    is not named.
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
        """Return whether it is of a hand: it has a wrist, or digits that are named as a hand's."""
        return self.wrist is not None or bool(FINGERS & {*self.digits})

    @property
    def measured(self) -> tuple[str, ...]:
        """Segments that carry a receiver, optional ones among them, in the layout's order."""
        return tuple(s.name for s in self.segments.values() if s.measured)

    @property
    def expected(self) -> tuple[str, ...]:
        """Segments of which a recording should hold poses: measured and not optional."""
        return tuple(name for name in self.measured if not self.segments[name].optional)

    def of_hand(self, hand: str) -> Layout:
        """Return the layout with the station numbers of a right or left hand."""
        if hand != "left":
            return self
        segments = {
            name: replace(s, receiver=s.left_receiver or s.receiver, left_receiver=s.receiver)
            for name, s in self.segments.items()
        }
        return replace(self, segments=segments)

    def is_as(self, other: Layout) -> bool:
        """Return whether both have the same bodies, joints and digits, so that they may differ only in which
        receivers are worn and what their station numbers are.
        """
        bodies, others = (
            {s.name: (s.measured, *(s.axes.ravel() if s.measured else ())) for s in layout.segments.values()}
            for layout in (self, other)
        )
        joined = (self.joints, self.digits, self.wrist) == (other.joints, other.digits, other.wrist)
        return joined and list(bodies.items()) == list(others.items())

    @property
    def solvable(self) -> tuple[Joint, ...]:
        """Joints between two receivers: those that Eq. 1-7 can solve."""
        return tuple(j for j in self.joints.values() if self.segments[j.child].measured)


def read_layout(name: str | Path, folder: Path = Path()) -> Layout:
    """Read a layout by name or path (relative to `folder`); InputError where it is wrong."""
    path = config_path(str(name), "layout", folder)
    return _read(path, *file_state(path))


@lru_cache(maxsize=16)
def _read(path: Path, *_: int) -> Layout:
    return layout_from_config(read_config(path, "layout"), str(path))


def layout_from_config(config: dict[str, Any], where: str) -> Layout:
    """Make a layout of a checked file's content; `where` names it in the InputError of one that is wrong."""
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
    for i, first in enumerate(worn):
        for second in list(worn)[i:]:
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


def _tree(config: dict[str, Any], segments: dict[str, Segment], where: str) -> dict[str, dict[str, Any]]:
    """Return the joint above each segment, by that segment; refused unless together they are a tree."""
    joint_to: dict[str, dict[str, Any]] = {}
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
    name: str,
    part: dict[str, Any],
    segments: dict[str, Segment],
    joint_to: dict[str, dict[str, Any]],
    where: str,
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
    return Joint(
        name,
        part["parent"],
        part["child"],
        above,
        part["dof"],
        Plane(frame, point, normal or segment.lateral),
        compound,
    )


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
