"""A person's hand as points and lines in one drawing: as it lies flat on a table, seen from above.

Everything is drawn once, in the table's own axes (east, north, up; mm; a right hand, fingers to the north,
so the thumb points west), and from there only carried about. No bone has a frame of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]
Skin = Literal["usual", "thin", "thick"]
Facing = Literal["nail", "hand", "between"]

FINGERS = ("index", "middle", "ring", "little")
DIGITS = ("thumb", *FINGERS)
SKIN_SHARE = {"thin": 0.6, "usual": 1.0, "thick": 1.45}

# Right hand, (distal, radial, dorsal) of the capitate's head; mm: base of the metacarpal, its head.
_BASE = {
    "thumb": (15.4, 20.8, -9.4),
    "index": (15.2, 10.2, 1.5),
    "middle": (15.3, -0.5, 4.2),
    "ring": (16.7, -9.4, 2.0),
    "little": (14.7, -15.6, -2.7),
}
_HEAD = {
    "index": (73.0, 20.0, 9.0),
    "middle": (72.0, 0.4, 10.9),
    "ring": (70.5, -16.2, 5.5),
    "little": (63.0, -27.0, -3.5),
}
_LENGTHS = {  # metacarpal, phalanges from the knuckle outward, soft tip; mm
    "thumb": (37.3, 33.8, 25.2, 5.7),
    "index": (59.0, 43.7, 24.9, 19.6, 3.8),
    "middle": (58.0, 48.2, 29.4, 21.1, 4.0),
    "ring": (52.0, 44.7, 28.2, 21.1, 4.0),
    "little": (48.0, 36.3, 20.4, 19.1, 3.7),
}
_FAN_DEG = {"index": 5.0, "middle": 0.0, "ring": -5.0, "little": -13.0}  # towards the thumb
_NAIL_ROLL_DEG = {"index": 2.0, "middle": 0.0, "ring": -6.0, "little": -14.0}  # nails turned to the thumb
_PIP_OBLIQUE_DEG = {"index": -5.0, "middle": -2.1, "ring": 3.0, "little": 4.4}
_DIP_OBLIQUE_DEG = {"index": -1.3, "middle": -0.8, "ring": 1.8, "little": 3.3}
_DIP_TWIST_DEG = {"index": 11.0, "middle": 8.0, "ring": -1.0, "little": -1.0}
_TIP_LEAN_DEG = {"index": -3.2, "middle": -2.5, "ring": 4.4, "little": 8.0}
_CUP_PRONATION = {"ring": 0.8, "little": 0.7}  # of the metacarpal's bending


@dataclass(frozen=True)
class Joint:
    """What moves a bone against the one before it: turns about points, and the wander of the joint.

    turns : pairs of a point (3,) and a (3, D) matrix that makes the joint's D angles a rotation vector, each
    carried by those before it; glide_mm : (3, 2), times sin and 1 - cos of the first angle.
    """

    name: str
    parent: str
    child: str
    turns: tuple[tuple[Array, Array], ...]
    glide_mm: Array

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of the joint's angles, the first of which bends."""
        kinds = ("bend", "sway")[: self.turns[0][1].shape[1]]
        return tuple(f"{self.name}.{kind}" for kind in kinds)


@dataclass(frozen=True)
class Bone:
    """A bone as it lies on the table: from the centre at its base to the next (or to the skin of the tip)."""

    base: Array
    end: Array
    up: Array

    @property
    def along(self) -> Array:
        """Unit vector to its far end."""
        return unit(self.end - self.base)


@dataclass(frozen=True)
class Worn:
    """A receiver where it was taped: place, turning (columns are its axes) and the skin's own axes there."""

    bone: str
    place: Array
    axes: Array
    skin_axes: Array
    height_mm: float


@dataclass(frozen=True)
class Person:
    """Somebody's bones, joints, habits and, for either hand, the receivers as they were put on."""

    seed: int
    skin: Skin
    bones: dict[str, Bone]
    joints: tuple[Joint, ...]
    nail_deg: float
    habits: dict[str, float] = field(repr=False)
    worn: dict[str, tuple[Worn, ...]] = field(repr=False)


def unit(vector: Array) -> Array:
    """Give it with length 1."""
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))


def turned(vector: Array, axis: Array, deg: float) -> Array:
    """Give it turned about an axis through the origin."""
    return np.asarray(Rotation.from_rotvec(np.deg2rad(deg) * axis).apply(vector))


def draw_person(
    seed: int, *, scale: float | None = None, skin: Skin = "usual", thumb_facing: Facing = "between"
) -> Person:
    """Draw a person. `scale` is the hand's size as a share of an average adult's (a child: 0.6 to 0.85).

    thumb_facing : which way the receivers on both thumbs' metacarpals face: as the nail, as the back of the
    hand, or anywhere between and a few degrees past either.
    """
    rng = np.random.default_rng([seed, 31])
    size = float(np.clip(rng.normal(1.0, 0.065), 0.84, 1.16))
    size = size if scale is None else scale
    bones: dict[str, Bone] = {}
    joints: list[Joint] = [_wrist(rng, size)]
    nail_deg = float(rng.uniform(55, 90))
    for digit in DIGITS:
        _draw_digit(rng, digit, size, nail_deg, bones, joints)
    bones["hand"] = Bone(
        bones["middle_metacarpal"].base, bones["middle_metacarpal"].end, np.array([0.0, 0.0, 1.0])
    )
    bones["forearm"] = Bone(np.array([0.0, -240.0 * size, 4.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    habits = {
        "reach": float(rng.uniform(0.85, 1.05)),  # how much of a usual range this person has
        "tip_share": float(rng.uniform(0.45, 0.75)),  # of the PIP joint's bending that the DIP follows
        "curl": float(rng.uniform(0.5, 1.5)),  # of the hand at rest
        "thumb_out": float(rng.uniform(-8, 12)),
    }
    worn = {side: _wear(rng, bones, size, thumb_facing, nail_deg) for side in ("right", "left")}
    return Person(seed, skin, bones, tuple(joints), nail_deg, habits, worn)


def _table(distal_radial_dorsal: tuple[float, ...] | Array) -> Array:
    """Words of anatomy to a place on the table, for a right hand."""
    distal, radial, dorsal = distal_radial_dorsal
    return np.array([-radial, distal, dorsal])


def _still(n_angles: int) -> Array:
    return np.zeros((3, n_angles))


def _wrist(rng: np.random.Generator, size: float) -> Joint:
    """Two crossing lines: bending through the capitate's head, swaying a few mm farther out."""
    bend = turned(np.array([-1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), rng.normal(0, 5))
    sway = turned(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), rng.normal(0, 5))
    zero = np.zeros(3)
    farther = np.array([0.0, rng.uniform(1, 4) * size, 0.0])
    turns = ((zero, np.column_stack([bend, zero])), (farther, np.column_stack([zero, sway])))
    return Joint("wrist", "forearm", "hand", turns, rng.normal(0, 0.5, (3, 2)))


def _draw_digit(
    rng: np.random.Generator,
    digit: str,
    size: float,
    nail_deg: float,
    bones: dict[str, Bone],
    joints: list[Joint],
) -> None:
    lengths = np.array(_LENGTHS[digit]) * size * rng.normal(1.0, 0.035, len(_LENGTHS[digit]))
    base = _table(_BASE[digit]) * size + rng.normal(0, 0.8, 3)
    if digit == "thumb":
        along = unit(_table((0.81, 0.35, -0.465)) + rng.normal(0, 0.07, 3))
        back = unit(np.cross(np.cross(along, [0.0, 0.0, 1.0]), along))  # of the hand, seen along the thumb
        up = turned(back, along, -nail_deg)
        _draw_thumb(rng, lengths, base, along, up, bones, joints)
        return
    head = base + lengths[0] * unit(_table(_HEAD[digit]) - _table(_BASE[digit]) + rng.normal(0, 1.2, 3))
    fan = np.deg2rad(_FAN_DEG[digit] + rng.normal(0, 2))
    along = unit(np.array([-np.sin(fan), np.cos(fan), -np.sin(np.deg2rad(rng.normal(4, 3)))]))
    up = unit(np.array([0.0, 0.0, 1.0]) - along[2] * along)
    up = turned(up, along, -(_NAIL_ROLL_DEG[digit] + rng.normal(0, 3)))
    _draw_finger(rng, digit, lengths, (base, head), along, up, bones, joints)


def _hinge(
    rng: np.random.Generator, name: str, bones: tuple[str, str], at: Array, axis: Array, glide_mm: float
) -> Joint:
    """One line, of which the point wanders a little as a cam's does."""
    return Joint(name, *bones, ((at, axis[:, None]),), rng.normal(0, glide_mm, (3, 2)))


def _draw_thumb(
    rng: np.random.Generator,
    lengths: Array,
    base: Array,
    along: Array,
    up: Array,
    bones: dict[str, Bone],
    joints: list[Joint],
) -> None:
    """A saddle of two skew lines, the first in the trapezium, the second in the metacarpal; then hinges."""
    knuckle = base + lengths[0] * along
    middle = knuckle + lengths[1] * along
    tip = middle + (lengths[2] + lengths[3]) * turned(along, up, rng.normal(0, 2))
    across = np.cross(up, along)  # turning about it carries the tip away from the nail
    apart = rng.uniform(2.5, 6.5)
    bend = turned(turned(across, along, rng.normal(0, 8)), up, rng.normal(0, 6))
    sway = turned(turned(up, along, rng.normal(0, 8)), across, rng.normal(0, 6))
    with_it = np.outer(along, rng.uniform(0.0, [0.15, 0.35]))  # the thumb rolls as it opposes
    zero = np.zeros(3)
    lines = (
        (base - 0.7 * apart * along, np.column_stack([bend, zero])),
        (base + 0.3 * apart * along, np.column_stack([zero, sway]) - with_it),
    )
    centre = np.asarray((lines[0][0] + lines[1][0]) / 2)
    bones["thumb_metacarpal"] = Bone(centre, knuckle, up)
    bones["thumb_proximal"] = Bone(knuckle, middle, up)
    bones["thumb_distal"] = Bone(middle, tip, up)
    joints.append(Joint("thumb_cmc", "hand", "thumb_metacarpal", lines, rng.normal(0, 0.3, (3, 2))))
    oblique = turned(across, up, rng.normal(0, 4))
    turn = (knuckle, np.column_stack([oblique, up + rng.normal(0, 0.05, 3)]))
    glide = rng.normal(0, 0.5, (3, 2))
    joints.append(Joint("thumb_mcp", "thumb_metacarpal", "thumb_proximal", (turn,), glide))
    tip_axis = turned(turned(across, up, rng.normal(1.5, 2)), along, rng.normal(0, 4))
    joints.append(_hinge(rng, "thumb_ip", ("thumb_proximal", "thumb_distal"), middle, tip_axis, 0.25))


def _draw_finger(
    rng: np.random.Generator,
    digit: str,
    lengths: Array,
    metacarpal: tuple[Array, Array],
    along: Array,
    up: Array,
    bones: dict[str, Bone],
    joints: list[Joint],
) -> None:
    base, knuckle = metacarpal
    names = [f"{digit}_{bone}" for bone in ("metacarpal", "proximal", "middle", "distal")]
    shaft = unit(knuckle - base)
    if digit in _CUP_PRONATION:
        base = base + rng.uniform(2, 4) * shaft  # it turns within the metacarpal's base
    across = np.cross(up, along)
    cup = turned(across, shaft, rng.normal(0, 8)) + _CUP_PRONATION.get(digit, 0.0) * shaft
    middle = knuckle + lengths[1] * along
    last = middle + lengths[2] * along
    tip = last + (lengths[3] + lengths[4]) * turned(along, up, _TIP_LEAN_DEG[digit] + rng.normal(0, 1))
    for name, ends in zip(
        names, ((base, knuckle), (knuckle, middle), (middle, last), (last, tip)), strict=True
    ):
        bones[name] = Bone(*ends, up)
    joints.append(_hinge(rng, f"{digit}_cmc", ("hand", names[0]), base, cup, 0.2))
    bend = turned(across, up, rng.normal(0, 3)) + rng.normal(0, 0.04) * along
    sway = up + rng.normal(0, 0.15) * along  # a swaying finger rolls a little, too
    cam = np.column_stack([along, -up]) @ (rng.uniform(0.3, 1.4, 2) * rng.choice([-1, 1], 2) * np.eye(2))
    turns = ((knuckle, np.column_stack([bend, sway])),)
    joints.append(Joint(f"{digit}_mcp", names[0], names[1], turns, cam))
    pip = turned(across, up, -_PIP_OBLIQUE_DEG[digit] + rng.normal(0, 1.5))
    joints.append(_hinge(rng, f"{digit}_pip", (names[1], names[2]), middle, pip, 0.25))
    dip = turned(across, up, -_DIP_OBLIQUE_DEG[digit] + rng.normal(0, 1.5))
    dip = turned(dip, along, _DIP_TWIST_DEG[digit] + rng.normal(0, 3))
    joints.append(_hinge(rng, f"{digit}_dip", (names[2], names[3]), last, dip, 0.15))


# Skin over the line of centres: height and half width, mm; by how many deg it falls outward; share of length.
_SURFACE = {
    "hand": (9.5, 32.0, 1.0, 0.27),
    "forearm": (19.0, 28.0, 3.0, 0.70),
    "thumb_metacarpal": (9.5, 10.0, -2.0, 0.52),
    "thumb_proximal": (7.0, 10.0, 2.0, 0.5),
    "thumb_distal": (4.2, 9.0, 4.0, 0.62),
    "proximal": (8.6, 8.5, 3.0, 0.5),
    "middle": (5.6, 7.5, 3.0, 0.5),
    "distal": (3.8, 6.8, 4.0, 0.63),
}


def _wear(
    rng: np.random.Generator, bones: dict[str, Bone], size: float, facing: Facing, nail_deg: float
) -> tuple[Worn, ...]:
    segments = ["hand", *(f"thumb_{bone}" for bone in ("metacarpal", "proximal", "distal"))]
    segments += [f"{digit}_{bone}" for digit in FINGERS for bone in ("proximal", "middle", "distal")]
    worn = []
    for segment in [*segments, "forearm"]:
        bone = bones[segment]
        up = bone.up
        if segment == "thumb_metacarpal":
            turns = {"nail": (nail_deg - 8, nail_deg + 8), "hand": (-8, 12), "between": (-8, nail_deg + 8)}
            back = unit(np.cross(np.cross(bone.along, [0.0, 0.0, 1.0]), bone.along))
            up = turned(back, bone.along, -rng.uniform(*turns[facing]))
        worn.append(_tape(rng, segment, bone, up, size))
    return tuple(worn)


def _tape(rng: np.random.Generator, segment: str, bone: Bone, up: Array, size: float) -> Worn:
    """Where a receiver aimed at the middle of a bone's back comes to lie: on the skin, and flat on it."""
    height, half_width, fall_deg, share = _SURFACE.get(segment) or _SURFACE[segment.split("_")[1]]
    height, half_width = height * size, half_width * size
    along = bone.along
    side = unit(np.cross(up, along))
    up = np.cross(along, side)
    long_mm = float(np.linalg.norm(bone.end - bone.base))
    nail = segment.endswith("distal")
    off_mm = np.clip(rng.normal(0, 1.2 if nail else 2.5), -0.2 * long_mm, 0.2 * long_mm)
    round_deg = rng.uniform(-18, 18)
    if nail or segment in ("hand", "forearm", "thumb_metacarpal"):
        round_deg *= 0.2 if segment == "thumb_metacarpal" else 0.45
    sine, cosine = np.sin(np.deg2rad(round_deg)), np.cos(np.deg2rad(round_deg))
    foot = bone.base + (share * long_mm + off_mm) * along
    skin = foot + half_width * sine * side + height * cosine * up
    flat = unit(sine / half_width * side + cosine / height * up)
    z = unit(turned(flat, side, fall_deg))
    x = unit(along - (along @ z) * z)
    skin_axes = np.column_stack([x, np.cross(z, x), z])
    slips_deg = np.clip(rng.normal(0, [2.5, 3.5, 4.0]), -8, 8)
    axes = skin_axes @ Rotation.from_rotvec(np.deg2rad(slips_deg)).as_matrix()
    above_mm = rng.uniform(2.2, 3.2)  # the coils lie within the housing
    return Worn(segment, skin + above_mm * z, axes, skin_axes, height + above_mm)
