"""A posed hand as solid shapes: tapered capsules of flesh around bones, one part a segment, and the palm.

Radii and the palm's outline are by eye: nothing is computed from them but pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from anatomy import average_hand as average
from guide.average_joints import average_joints
from skeleton.rotations import Array, rotate
from stages.simulate.random_hand import BONES, DIGITS, JOINTS

SKIN_MM = 2.0
"""Over the back of a bone."""

RADII_MM: Mapping[str, tuple[float, ...]] = {
    "thumb": (12.0, 11.0, 10.4, 8.2),
    "index": (12.5, 10.2, 8.9, 7.9, 6.6),
    "middle": (12.0, 10.2, 9.0, 8.0, 6.8),
    "ring": (12.0, 9.7, 8.5, 7.6, 6.4),
    "little": (12.5, 8.9, 7.4, 6.6, 5.7),
}
"""Of a digit's flesh at its joints from the first metacarpal's base outward, and at its tip."""

_FOREARM_MM, _FOREARM_HALF_MM = 48.0, (10.5, 15.0)
_PALM_MM, _THENAR_MM = (13.5, 12.2), (14.5, 11.0)


@dataclass(frozen=True)
class Capsule:
    """Two balls and what lies between them: ends (T, 3) in mm, radii in mm, the first not the smaller."""

    first_mm: Array
    second_mm: Array
    radii_mm: tuple[float, float]


@dataclass(frozen=True)
class Part:
    """A part of the hand: capsules and polygons (T, n, 3) that make one shape.

    bones : their names with lines (T, 2, 3) from joint to joint. nails : outlines (T, n, 3), and which way
    they face (T, 3).
    """

    name: str
    capsules: tuple[Capsule, ...]
    polygons: tuple[Array, ...] = ()
    bones: tuple[tuple[str, Array], ...] = ()
    nails: tuple[tuple[Array, Array], ...] = ()

    @property
    def points_mm(self) -> Array:
        """Ends of all capsules (T, n, 3)."""
        return np.stack([end for one in self.capsules for end in (one.first_mm, one.second_mm)], 1)


@dataclass(frozen=True)
class Joined:
    """Where two parts pass into each other, and no line should be: a ball at a joint, (T, 3) mm.

    joint : its name, and bone_mm : (T, 3) its centre, which need not be the flesh's middle. The directions
    (T, 3) lead from the joint to the other end of either part's bone.
    """

    joint: str
    parts: tuple[str, str]
    at_mm: Array
    bone_mm: Array
    towards: tuple[Array, Array]
    radius_mm: float

    def covered_bone(self, part: int) -> Array:
        """The piece (T, 2, 3) of one part's bone that lies within two and a half radii of the joint."""
        length_mm = np.linalg.norm(self.towards[part], axis=-1, keepdims=True)
        share = np.minimum(2.5 * self.radius_mm / length_mm, 1.0)
        return np.stack([self.bone_mm, self.bone_mm + share * self.towards[part]], 1)


@dataclass(frozen=True)
class Flesh:
    """All of a posed hand.

    origins_mm : (T, B, 3), quaternion : (T, B, 4) of its bones, whose lengths are length_mm (B,).
    """

    parts: tuple[Part, ...]
    joined: tuple[Joined, ...]
    origins_mm: Array
    quaternion: Array
    length_mm: Array

    def at(self, bone: str, place_mm: Array) -> Array:
        """A point of a bone's frame, (3,) mm, in the forearm's: (T, 3)."""
        index = BONES.index(bone)
        return np.asarray(self.origins_mm[:, index] + rotate(self.quaternion[:, index], place_mm))


def flesh_of(
    origins_mm: Array, quaternion: Array, digits: Sequence[str] = DIGITS, length_mm: Array | None = None
) -> Flesh:
    """The hand around posed bones, or just some digits of it with their part of the palm.

    length_mm : (B,) of the bones, where they are not the average hand's.
    """
    lengths = average_joints().length_mm if length_mm is None else length_mm
    bare = Flesh((), (), origins_mm, quaternion, lengths)
    parts, joined = [_palm(bare, digits)], []
    for digit in digits:
        before = "palm"
        for index, bone in _phalanges(digit):
            part = _phalanx(bare, digit, index, bone)
            start = part.capsules[0]
            joint, centre_mm = JOINTS[BONES.index(bone) - 1], bare.at(bone, np.zeros(3))
            ends_mm = bare.at(_bone_before(bone), np.zeros(3)), part.bones[0][1][:, 1]
            ways = (ends_mm[0] - centre_mm, ends_mm[1] - centre_mm)
            joined.append(Joined(joint, (before, bone), start.first_mm, centre_mm, ways, start.radii_mm[0]))
            parts.append(part)
            before = bone
    return Flesh(tuple(parts), tuple(joined), origins_mm, quaternion, lengths)


def _phalanges(digit: str) -> Iterator[tuple[int, str]]:
    """A digit's bones beyond its metacarpal, with their place in it."""
    own = [bone for bone in BONES if bone.startswith(f"{digit}_")]
    yield from enumerate(own[1:], start=1)


def _bone_before(bone: str) -> str:
    digit = bone.split("_")[0]
    own = [name for name in BONES if name.startswith(f"{digit}_")]
    return own[own.index(bone) - 1]


def _phalanx(hand: Flesh, digit: str, index: int, bone: str) -> Part:
    length_mm = _length_mm(hand, bone)
    radii_mm, last = RADII_MM[digit], index == len(RADII_MM[digit]) - 2
    heights_mm = average.DIGITS[digit].bone_heights_mm + SKIN_MM
    near, far = heights_mm[index] - radii_mm[index], heights_mm[index] - radii_mm[index + 1]
    if index > 1:  # where the bone before left it
        near = (near + heights_mm[index - 1] - radii_mm[index]) / 2
    end_mm = length_mm
    if last:
        end_mm += float(average.DIGITS[digit].soft_tip_mm) - radii_mm[index + 1]
    else:
        far = (far + heights_mm[index + 1] - radii_mm[index + 1]) / 2
    capsule = Capsule(
        hand.at(bone, np.array([0.0, 0.0, near])),
        hand.at(bone, np.array([end_mm, 0.0, far])),
        (radii_mm[index], radii_mm[index + 1]),
    )
    nails = (_nail(hand, bone, end_mm, far, radii_mm[index + 1]),) if last else ()
    return Part(bone, (capsule,), bones=(_bone_line(hand, bone, length_mm),), nails=nails)


def _nail(hand: Flesh, bone: str, end_mm: float, centre_mm: float, radius_mm: float) -> tuple[Array, Array]:
    """A nail's outline and direction: it lies on the back of the last ball of flesh."""
    around = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    x = end_mm - 0.5 + 0.78 * radius_mm * np.sign(np.cos(around)) * np.abs(np.cos(around)) ** 0.7
    y = 0.66 * radius_mm * np.sign(np.sin(around)) * np.abs(np.sin(around)) ** 0.7
    z = centre_mm + np.sqrt(radius_mm**2 - y**2)
    corners = [hand.at(bone, place) for place in np.stack([x, y, z], -1)]
    dorsal = hand.at(bone, np.array([0.0, 0.0, 1.0])) - hand.at(bone, np.zeros(3))
    return np.stack(corners, 1), dorsal


def _bone_line(hand: Flesh, bone: str, length_mm: float) -> tuple[str, Array]:
    ends = [hand.at(bone, np.array([along, 0.0, 0.0])) for along in (0.0, length_mm)]
    return bone, np.stack(ends, 1)


def _palm(hand: Flesh, digits: Sequence[str]) -> Part:
    """Forearm, palm and the ball of the thumb, with the metacarpals in them."""
    lines = {digit: _metacarpal_line(hand, digit) for digit in digits}
    fingers = [digit for digit in digits if digit != "thumb"]
    capsules = [Capsule(*lines[digit], _THENAR_MM if digit == "thumb" else _PALM_MM) for digit in digits]
    polygons = [np.stack([*lines[one], *reversed(lines[other])], 1) for one, other in pairwise(fingers)]
    if "thumb" in digits:
        thumb, index = lines["thumb"], lines["index"]
        web = 0.15 * thumb[0] + 0.85 * thumb[1], 0.3 * index[0] + 0.7 * index[1]
        polygons.append(np.stack([thumb[0], *web, index[0]], 1))
    forearm = [_forearm_edge(hand, side) for side in (-1.0, 1.0)]
    capsules += forearm
    capsules += [
        Capsule(edge.second_mm, lines[finger][0], (_FOREARM_HALF_MM[1], _PALM_MM[0]))
        for edge, finger in zip(forearm, (fingers[-1], fingers[0]), strict=True)
    ]
    elbow_mm = forearm[0].radii_mm[0]
    capsules.append(Capsule(forearm[0].first_mm, forearm[1].first_mm, (elbow_mm, elbow_mm)))
    arm = [forearm[0].first_mm, forearm[0].second_mm, forearm[1].second_mm, forearm[1].first_mm]
    wrist = [forearm[1].second_mm, forearm[0].second_mm, lines[fingers[-1]][0], lines[fingers[0]][0]]
    polygons += [np.stack(arm, 1), np.stack(wrist, 1)]
    bones = tuple(
        _bone_line(hand, f"{digit}_metacarpal", _length_mm(hand, f"{digit}_metacarpal")) for digit in digits
    )
    return Part("palm", tuple(capsules), tuple(polygons), bones)


def _metacarpal_line(hand: Flesh, digit: str) -> tuple[Array, Array]:
    """Ends of the flesh around a metacarpal, which lies more on its palm's side."""
    bone, depth_mm = f"{digit}_metacarpal", -3.5 if digit == "thumb" else -3.0
    base, head = (hand.at(bone, np.array([along, 0.0, depth_mm])) for along in (0.0, _length_mm(hand, bone)))
    return base, head


def _forearm_edge(hand: Flesh, side: float) -> Capsule:
    """The forearm's half on the thumb's side (1) or the little finger's (-1), wider towards the elbow."""
    aside_mm, radius_mm = _FOREARM_HALF_MM
    elbow = hand.at("forearm", np.array([-_FOREARM_MM, 1.25 * side * aside_mm, -2.0]))
    wrist = hand.at("forearm", np.array([-4.0, side * aside_mm, -2.0]))
    return Capsule(elbow, wrist, (radius_mm + 1.5, radius_mm))


def _length_mm(hand: Flesh, bone: str) -> float:
    return float(hand.length_mm[BONES.index(bone)])
