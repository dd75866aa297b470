"""A person's hand as points and lines, flat on a table and seen from above.

Everything is defined once, in the table's axes (east, north, up; mm; a right hand with fingers to the north,
so that the thumb points west), and is then moved from there. Bones have no frames.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import count
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from shukotsu.arrays import Array

Skin = Literal["usual", "thin", "thick"]
Facing = Literal["nail", "hand", "between"]

FINGERS = ("index", "middle", "ring", "little")
_PHALANGES = ("proximal", "middle", "distal")
SKIN_SHARE = {"thin": 0.6, "usual": 1.0, "thick": 1.45}

# Base and head of the metacarpals of a right hand, mm (distal, radial, dorsal) from the capitate's head.
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
# Direction and axes of a finger, deg: fan angle and roll of the nail towards the thumb; obliquity of the PIP
# and DIP axes (+: the end at the thumb's side is distal); twist of the DIP axis; lean of the tip towards the
# thumb; and roll of the metacarpal per degree of its flexion.
_FINGER = {
    "index": (5.0, 2.0, -5.0, -1.3, 11.0, -3.2, 0.0),
    "middle": (0.0, 0.0, -2.1, -0.8, 8.0, -2.5, 0.0),
    "ring": (-5.0, -6.0, 3.0, 1.8, -1.0, 4.4, 0.8),
    "little": (-13.0, -14.0, 4.4, 3.3, -1.0, 8.0, 0.7),
}
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class DrawnJoint:
    """Motion of a bone relative to its parent: rotations about points, and glide of the joint.

    turns : pairs of a point (3,) and a matrix (3, D) from the joint's D angles to a rotation vector; each
    rotation is carried by the previous ones. glide_mm : (3, 2) glide per sin and per 1 - cos of the first
    angle.
    """

    name: str
    parent: str
    child: str
    turns: tuple[tuple[Array, Array], ...]
    glide_mm: Array

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of the joint's angles, flexion first."""
        kinds = ("bend", "sway")[: self.turns[0][1].shape[1]]
        return tuple(f"{self.name}.{kind}" for kind in kinds)


@dataclass(frozen=True)
class DrawnBone:
    """A bone on the table, from the joint centre at its base to the next one, or to the skin of the tip."""

    base: Array
    end: Array
    up: Array

    @property
    def along(self) -> Array:
        """Unit vector from the base to the end."""
        return unit(self.end - self.base)

    @property
    def length_mm(self) -> float:
        """Distance from the base to the end."""
        return float(np.linalg.norm(self.end - self.base))


@dataclass(frozen=True)
class Worn:
    """A taped receiver: its position, its axes and those of the skin there, as columns.

    All are for a right hand; a left hand is drawn as its mirror image.
    """

    bone: str
    position_mm: Array
    axes: Array
    skin_axes: Array


@dataclass(frozen=True)
class Person:
    """A person's bones, joints and habits and, for each hand, the receivers as they were put on."""

    seed: int
    skin: Skin
    bones: dict[str, DrawnBone]
    joints: tuple[DrawnJoint, ...]
    nail_deg: float
    habits: dict[str, float] = field(repr=False)
    worn: dict[str, tuple[Worn, ...]] = field(repr=False)


def unit(vector: Array) -> Array:
    """Return the vector with length 1."""
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))


def turn_about_axis(vector: Array, axis: Array, deg: float) -> Array:
    """Return the vectors rotated about an axis through the origin."""
    return np.asarray(Rotation.from_rotvec(np.deg2rad(deg) * axis).apply(vector))


def draw_person(
    seed: int, *, scale: float | None = None, skin: Skin = "usual", thumb_facing: Facing = "between"
) -> Person:
    """Draw a person.

    scale : size of the hand relative to an average adult's (a child: 0.6 to 0.85); random if omitted.
    thumb_facing : direction of the receivers on the thumbs' metacarpals: that of the nail, that of the back
    of the hand, or between the two up to a few degrees beyond.
    """
    for again in count():
        rng = np.random.default_rng([seed, 31, again] if again else [seed, 31])
        size = float(np.clip(rng.normal(1.0, 0.065), 0.84, 1.16)) if scale is None else scale
        drawing = _Drawing(rng, size, float(rng.uniform(55, 90)))
        if drawing.possible():
            break
    habits = {
        "reach": float(rng.uniform(0.85, 1.05)),  # range of motion relative to the usual one
        "tip_share": float(rng.uniform(0.45, 0.75)),  # flexion of the DIP joint per flexion of the PIP joint
        "curl": float(rng.uniform(0.5, 1.5)),  # flexion of the resting hand relative to the usual one
        "thumb_out": float(rng.uniform(-8, 12)),
    }
    worn = {side: drawing.wear(thumb_facing) for side in ("right", "left")}
    return Person(seed, skin, drawing.bones, tuple(drawing.joints), drawing.nail_deg, habits, worn)


def _table(distal_radial_dorsal: tuple[float, float, float]) -> Array:
    """Convert anatomical directions to table coordinates, for a right hand."""
    distal, radial, dorsal = distal_radial_dorsal
    return np.array([-radial, distal, dorsal])


def _back_of_hand(along: Array) -> Array:
    """Return the unit vector perpendicular to a bone that is nearest to up."""
    return unit(_UP - (_UP @ along) * along)


# Skin at a receiver: height above the line of centres, half width, mm; distal slope, deg; share of length.
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


_SEGMENTS = (
    *("hand", "thumb_metacarpal", "thumb_proximal", "thumb_distal"),
    *(f"{digit}_{bone}" for digit in FINGERS for bone in _PHALANGES),
    "forearm",
)


class _Drawing:
    """Builder of a hand, from the wrist outward, each joint with the bone distal to it."""

    def __init__(self, rng: np.random.Generator, size: float, nail_deg: float) -> None:
        self.rng, self.size, self.nail_deg = rng, size, nail_deg
        self.bones: dict[str, DrawnBone] = {}
        self.joints: list[DrawnJoint] = []
        # two crossing axes: flexion through the capitate's head, deviation a few mm distal to it
        west, north, zero = np.array([-1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3)
        bend, sway = self._off(west, (_UP, 5)), self._off(_UP, (north, 5))
        farther = self.rng.uniform(1, 4) * self.size * north
        turns = ((zero, np.column_stack([bend, zero])), (farther, np.column_stack([zero, sway])))
        self.joints.append(DrawnJoint("wrist", "forearm", "hand", turns, self.rng.normal(0, 0.5, (3, 2))))
        self._thumb()
        for digit in FINGERS:
            self._finger(digit)
        palm = self.bones["middle_metacarpal"]
        self.bones["hand"] = DrawnBone(palm.base, palm.end, _UP)
        self.bones["forearm"] = DrawnBone(np.array([0.0, -240.0 * size, 4.0]), np.zeros(3), _UP)

    def _off(self, vector: Array, *turns: tuple[Array, float]) -> Array:
        """Return a direction rotated about other ones by random angles with these sd, deg."""
        for axis, sd_deg in turns:
            vector = turn_about_axis(vector, axis, self.rng.normal(0, sd_deg))
        return vector

    def _join(self, name: str, bones: tuple[str, str], at: Array, axes: list[Array], glide_mm: float) -> None:
        """Add a joint that turns about one point, which glides a little."""
        glide = self.rng.normal(0, glide_mm, (3, 2))
        self.joints.append(DrawnJoint(name, *bones, ((at, np.column_stack(axes)),), glide))

    def _start(self, digit: str) -> tuple[Array, Array]:
        """Draw the digit's lengths and its base, mm."""
        usual = np.array(_LENGTHS[digit])
        lengths = usual * self.size * self.rng.normal(1.0, 0.035, len(usual))
        return lengths, _table(_BASE[digit]) * self.size + self.rng.normal(0, 0.8, 3)

    def _thumb(self) -> None:
        """Add the thumb: a CMC joint with two skew axes, an MCP joint with two axes, and a hinge."""
        lengths, base = self._start("thumb")
        along = unit(_table((0.81, 0.35, -0.465)) + self.rng.normal(0, 0.07, 3))
        up = turn_about_axis(_back_of_hand(along), along, -self.nail_deg)
        across = np.cross(up, along)  # turning about it carries the tip away from the nail
        knuckle = base + lengths[0] * along
        middle = knuckle + lengths[1] * along
        tip = middle + (lengths[2] + lengths[3]) * self._off(along, (up, 2))
        apart_mm, zero = self.rng.uniform(2.5, 6.5), np.zeros(3)
        bend, sway = self._off(across, (along, 8), (up, 6)), self._off(up, (along, 8), (across, 6))
        rolls = np.outer(along, self.rng.uniform(0.0, [0.15, 0.35]))  # axial rotation in opposition
        lines = (
            (base - 0.7 * apart_mm * along, np.column_stack([bend, zero])),
            (base + 0.3 * apart_mm * along, np.column_stack([zero, sway]) - rolls),
        )
        ends = [(lines[0][0] + lines[1][0]) / 2, knuckle, middle, tip]
        names = [f"thumb_{bone}" for bone in ("metacarpal", "proximal", "distal")]
        self.bones |= {name: DrawnBone(ends[i], ends[i + 1], up) for i, name in enumerate(names)}
        self.joints.append(DrawnJoint("thumb_cmc", "hand", names[0], lines, self.rng.normal(0, 0.3, (3, 2))))
        axes = [self._off(across, (up, 4)), self._off(up, (along, 3), (across, 3))]
        self._join("thumb_mcp", (names[0], names[1]), knuckle, axes, 0.5)
        self._join("thumb_ip", (names[1], names[2]), middle, [self._off(across, (up, 2), (along, 4))], 0.25)

    def _finger(self, digit: str) -> None:
        """Add a finger: a CMC joint that moves a little, a two-axis MCP joint and two oblique hinges."""
        rng = self.rng
        variation = rng.normal(0, [2, 3, 1.5, 1.5, 3, 1])
        fan, nail, *oblique, twist, lean, cups = _FINGER[digit] + np.append(variation, 0)
        lengths, base = self._start(digit)
        shaft = unit(_table(_HEAD[digit]) - _table(_BASE[digit]) + rng.normal(0, 1.2, 3))
        along = unit(turn_about_axis(np.array([0.0, 1.0, np.sin(np.deg2rad(rng.normal(-4, 3)))]), _UP, fan))
        up = turn_about_axis(_back_of_hand(along), along, -nail)
        across = np.cross(up, along)
        ends = [base + (rng.uniform(2, 4) if cups else 0.0) * shaft, base + lengths[0] * shaft]
        for length_mm in lengths[1:3]:
            ends.append(ends[-1] + length_mm * along)
        ends.append(ends[-1] + (lengths[3] + lengths[4]) * turn_about_axis(along, up, lean))
        names = [f"{digit}_{bone}" for bone in ("metacarpal", *_PHALANGES)]
        self.bones |= {name: DrawnBone(ends[i], ends[i + 1], up) for i, name in enumerate(names)}
        cup = self._off(across, (shaft, 8)) + cups * shaft
        self._join(f"{digit}_cmc", ("hand", names[0]), ends[0], [cup], 0.2)
        axes = [self._off(across, (up, 3), (along, 2)), up + rng.normal(0, 0.15) * along]  # rolls slightly
        self._join(f"{digit}_mcp", (names[0], names[1]), ends[1], axes, 0.6)
        pip = turn_about_axis(across, up, -oblique[0])
        self._join(f"{digit}_pip", (names[1], names[2]), ends[2], [pip], 0.25)
        dip = turn_about_axis(turn_about_axis(across, up, -oblique[1]), along, twist)
        self._join(f"{digit}_dip", (names[2], names[3]), ends[3], [dip], 0.15)

    def possible(self) -> bool:
        """Return whether knuckles, metacarpals and the fingers of a resting hand are side by side."""
        axes = {joint.name: joint.turns[0][1][:, 0] for joint in self.joints}
        palm = [self.bones[f"{finger}_metacarpal"] for finger in FINGERS]
        shafts = np.array([[bone.base, bone.end] for bone in palm])
        fingers, shares = [], np.linspace(0.0, 1.0, 12)[:, None]
        for digit, (_, at) in zip(FINGERS, shafts, strict=True):
            turning, points = Rotation.identity(), [at]
            for joint, name, deg in zip(("mcp", "pip", "dip"), _PHALANGES, (18, 24, 10), strict=True):
                turning = turning * Rotation.from_rotvec(np.deg2rad(deg) * axes[f"{digit}_{joint}"])
                bone = self.bones[f"{digit}_{name}"]
                points.extend(points[-1] + shares * turning.apply(bone.end - bone.base))
            fingers.append(points)
        lines = np.array(fingers) / self.size
        apart = np.linalg.norm(lines[1:, :, None] - lines[:-1, None], axis=-1)
        steps = np.diff(shafts, axis=0) / self.size
        knuckles = np.linalg.norm(steps[:, 1], axis=-1)
        return bool((steps[..., 0] > 0).all() and knuckles.min() > 12.5 and apart.min() > 10)

    def wear(self, facing: Facing) -> tuple[Worn, ...]:
        """Tape receivers flat on the skin of one hand, aiming at the middle of the bones' backs."""
        rng, most = self.rng, {"nail": (self.nail_deg - 8, self.nail_deg + 8), "hand": (-8.0, 12.0)}
        worn = []
        for segment in _SEGMENTS:
            bone, up = self.bones[segment], self.bones[segment].up
            along = bone.along
            if segment == "thumb_metacarpal":
                turn = rng.uniform(*most.get(facing, (-8.0, self.nail_deg + 8)))
                up = turn_about_axis(_back_of_hand(along), along, -turn)
            height, half_width, fall_deg, share = _SURFACE.get(segment) or _SURFACE[segment.split("_")[1]]
            height, half_width = height * self.size, half_width * self.size
            side = unit(np.cross(up, along))
            up = np.cross(along, side)
            nail = segment.endswith("distal")
            off_mm = np.clip(rng.normal(0, 1.2 if nail else 2.5), -0.2 * bone.length_mm, 0.2 * bone.length_mm)
            round_deg = rng.uniform(-18, 18)
            if nail or segment in ("hand", "forearm", "thumb_metacarpal"):
                round_deg *= 0.2 if segment == "thumb_metacarpal" else 0.45
            sine, cosine = np.sin(np.deg2rad(round_deg)), np.cos(np.deg2rad(round_deg))
            foot = bone.base + (share * bone.length_mm + off_mm) * along
            skin = foot + half_width * sine * side + height * cosine * up
            flat = unit(sine / half_width * side + cosine / height * up)
            z = unit(turn_about_axis(flat, side, fall_deg))
            x = unit(along - (along @ z) * z)
            skin_axes = np.column_stack([x, np.cross(z, x), z])
            slips_deg = np.clip(rng.normal(0, [2.5, 3.5, 4.0]), -8, 8)
            axes = skin_axes @ Rotation.from_rotvec(np.deg2rad(slips_deg)).as_matrix()
            above_mm = rng.uniform(2.2, 3.2)  # height of the coils within the housing
            worn.append(Worn(segment, skin + above_mm * z, axes, skin_axes))
        return tuple(worn)
