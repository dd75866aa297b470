"""Bones, joints and axes of a simulated subject's hand.

Every bone has a frame with its origin at the centre of the proximal joint: x along the bone distally, z
dorsal, and y close to the joint's flexion axis in the source hand around which the person is drawn. The
person's axis is tilted relative to it. Positive flexion turns x towards the palm. The hand's frame has its
origin at the wrist centre. In a right hand y points towards the thumb; a left hand is the mirror image.

The source hands and the variation between people are in `shukotsu.hand.drawn_hands`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.arrays import Array, Integers
from shukotsu.hand import rotations
from shukotsu.hand.drawn_hands import CT, SOURCES, DrawnHand, blend_hands, drawn
from shukotsu.simulate.realism import Realism, generator

DIGITS = tuple(CT)
FINGERS = DIGITS[1:]

# Joint j moves bone j + 1. Joints are in levels outward from the body; a level is posed in one operation.
JOINTS = (
    "wrist",
    *(f"{digit}_cmc" for digit in DIGITS),
    *(f"{digit}_mcp" for digit in DIGITS),
    "thumb_ip",
    *(f"{digit}_pip" for digit in FINGERS),
    *(f"{digit}_dip" for digit in FINGERS),
)
BONES = (
    "forearm",
    "hand",
    *(f"{digit}_metacarpal" for digit in DIGITS),
    *(f"{digit}_proximal" for digit in DIGITS),
    "thumb_distal",
    *(f"{digit}_middle" for digit in FINGERS),
    *(f"{digit}_distal" for digit in FINGERS),
)
LEVELS = (slice(0, 1), slice(1, 6), slice(6, 11), slice(11, 16), slice(16, 20))
PARENT = np.array([0, *[1] * 5, *range(2, 7), *range(7, 12), *range(13, 17)])
"""Index of the parent bone of each joint's bone, (J,)."""

FLEXION, ABDUCTION, AXIAL = range(3)
WRIST = JOINTS.index("wrist")
FINGER_CMC = np.array([JOINTS.index(f"{digit}_cmc") for digit in FINGERS])
TIP_BONES = np.array([BONES.index(f"{digit}_distal") for digit in DIGITS])

OPEN_DEG = {"mcp": 12.0, "pip": 14.0, "dip": 6.0}
"""Flexion of the finger joints in the open hand, in which every movement starts."""


@dataclass(frozen=True)
class RandomHand:
    """Geometry of a hand with J = len(JOINTS) joints and B = len(BONES) bones, at neutral.

    Attributes
    ----------
    side : str
        right or left.
    origin_mm : array, shape (J, 3)
        Joint centre in the parent bone's frame, mm.
    rest : array, shape (J, 4)
        Quaternion of the child bone, child to parent frame.
    axes : array, shape (J, 3, 3)
        Unit axes of flexion, abduction and axial rotation in the parent's frame.
    order : array of int, shape (J, 2)
        Which of flexion and abduction comes first and carries the other.
    skew_mm : array, shape (J, 3)
        Offset from the first axis to the second, mm.
    relaxed_rad : array, shape (J,)
        Flexion of the relaxed hand.
    glide_mm : array, shape (J, 2, 3)
        Motion of the centre with the flexion f from the relaxed hand: (1 - cos f) times the first vector,
        across the axis, plus sin f times the second, along it.
    length_mm : array, shape (B,)
        Bone lengths, 0 for forearm and hand.
    soft_tip_mm : array, shape (5,)
        Soft tissue beyond the tip of the distal bone.
    pad_mm : array, shape (5, 3)
        Contact point of the finger pad in the distal bone's frame, mm.
    coupling : array, shape (J, 4)
        Axial rotation per abduction and per flexion; abduction and axial rotation of a hinge's wobble at 90
        deg, rad.
    scale : float
        Size relative to the source hand.

    """

    side: str
    origin_mm: Array
    rest: Array
    axes: Array
    order: Integers
    skew_mm: Array
    relaxed_rad: Array
    glide_mm: Array
    length_mm: Array
    soft_tip_mm: Array
    pad_mm: Array
    coupling: Array
    scale: float


@dataclass(frozen=True)
class _Straight:
    """A person's hand at neutral, in the hand's frame; other attributes as in `RandomHand`.

    centres_mm : (B, 2, 3) ends of every bone. facing : (J, 3) flexion axes without tilt, which orient the
    bone frames. second_axis : (3,) second axis of the thumb's CMC joint, which carries the first.
    """

    centres_mm: Array
    axes: Array
    facing: Array
    second_axis: Array
    lengths_mm: Array
    soft_tip_mm: Array
    coupling: Array
    glide_mm: Array
    relaxed_rad: Array
    scale: float

    def mirrored(self) -> _Straight:
        """Return the mirror image: points change the sign of y, axes (pseudo-vectors) those of x and z."""
        axis = np.array([-1.0, 1.0, -1.0])
        return replace(
            self,
            centres_mm=self.centres_mm * [1.0, -1.0, 1.0],
            axes=self.axes * axis,
            facing=self.facing * axis,
            second_axis=self.second_axis * axis,
            glide_mm=self.glide_mm * [1.0, -1.0, 1.0],
        )


def hand_of(subject: str, side: str, seed: int, realism: Realism) -> RandomHand:
    """Draw the hand of a subject.

    A hand in which bones of different digits intersect is replaced by that of another person.

    Parameters
    ----------
    subject, side : str
        Subject, and right or left.
    seed : int
        Seed of the simulation.
    realism : Realism
        Source anatomy, and which of the paper's assumptions hold.

    Returns
    -------
    RandomHand
        The hand, mirrored for the left side.

    """
    people = itertools.chain([subject], (f"{subject}, drawn again {again}" for again in itertools.count(1)))
    person = next(person for person in people if _possible(_straight(person, "right", seed, realism)))
    straight = _straight(person, side, seed, realism)
    return _assemble(side, straight.mirrored() if side == "left" else straight, realism)


def _straight(subject: str, side: str, seed: int, realism: Realism) -> _Straight:
    """Draw a subject's hand at neutral, as a right hand, whether it is plausible or not."""
    average = SOURCES.get(realism.anatomy)
    if average is None:  # an individual blend of the sources
        weights = generator(seed, "sources", subject).dirichlet(drawn.BLEND_SHARES)
        average = blend_hands(list(SOURCES.values()), weights)
    rng = generator(seed, "anatomy", subject)
    scale = float(np.exp(drawn.SCALE_SD * _clipped_normal(rng, ())))
    depth_mm = drawn.CENTRES_SD_MM * float(_clipped_normal(generator(seed, "joint depth", subject), ()))
    sides = drawn.SIDE_SD * generator(seed, "side", subject, side).standard_normal(len(BONES))
    sides = 1.0 + np.clip(sides, -drawn.SIDE_LIMIT, drawn.SIDE_LIMIT)
    lengths, sd = np.zeros(len(BONES)), np.zeros(len(BONES))
    for digit in DIGITS:  # centres deeper in the heads shorten metacarpals and lengthen distal bones
        bones = np.array(_chain(digit)) + 1
        lengths[bones], sd[bones] = average[digit].lengths_mm, average[digit].length_sd_mm
        lengths[bones[[0, -1]]] += depth_mm * np.array([-1.0, 1.0])
    lengths = scale * (lengths + sd * _clipped_normal(rng, (len(BONES),))) * sides
    centres = _centres_mm(rng, average, lengths, scale)
    axes, facing = _flexion_axes(rng, average, centres, realism)
    soft_tip = scale * np.array([digit.soft_tip_mm for digit in average.values()])
    soft_tip += drawn.SOFT_TIP_SD_MM * _clipped_normal(generator(seed, "soft tip", subject), (len(DIGITS),))
    second = average["thumb"].second_axis
    assert second is not None  # every source has one
    coupling, relaxed = _coupling(rng), _relaxed_rad(generator(seed, "relaxed", subject))
    glide = realism.glide * _glide_mm(generator(seed, "glide", subject), axes)
    return _Straight(centres, axes, facing, second, lengths, soft_tip, coupling, glide, relaxed, scale)


def _possible(straight: _Straight) -> bool:
    """Return whether metacarpals and, in the open hand, fingers do not cross (right hand)."""
    lines = np.zeros((len(FINGERS), 4, 12, 3))  # finger, bone, from its base to its end
    for finger, digit in enumerate(FINGERS):
        joints, turn = _chain(digit), np.array([1.0, 0.0, 0.0, 0.0])
        start = straight.centres_mm[joints[0] + 1, 0]
        for bone, (joint, flexion_deg) in enumerate(zip(joints, (0.0, *OPEN_DEG.values()), strict=True)):
            bend = rotations.about_axis(straight.axes[joint], np.radians(flexion_deg))
            turn = rotations.multiply(turn, bend)
            along = rotations.rotate(turn, np.subtract(*straight.centres_mm[joint + 1, ::-1]))
            lines[finger, bone] = start + np.linspace(0.0, 1.0, 12)[:, None] * along
            start = lines[finger, bone, -1]

    def apart_mm(lines: Array) -> float:
        points = lines.reshape(len(FINGERS), -1, 3)
        distances_mm = np.linalg.norm(points[1:, :, None] - points[:-1, None], axis=-1)
        return float(distances_mm.min()) / straight.scale

    return bool(
        (np.diff(lines[:, 0, :, 1], axis=0) < 0).all()
        and apart_mm(lines[:, 0, -1]) > drawn.KNUCKLES_MM
        and apart_mm(lines[:, 0]) > drawn.METACARPALS_MM
        and apart_mm(lines[:, 1:]) > drawn.FINGERS_MM
    )


def _clipped_normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw standard normal numbers clipped at 2.2 sd, so that no bone is implausibly short or long."""
    return np.clip(rng.standard_normal(shape), -2.2, 2.2)


def _chain(digit: str) -> list[int]:
    """Return the indices of a digit's joints from the base outward."""
    return [j for j, joint in enumerate(JOINTS) if joint.startswith(f"{digit}_")]


def _centres_mm(rng: np.random.Generator, average: DrawnHand, lengths_mm: Array, scale: float) -> Array:
    """Draw the ends (B, 2, 3), proximal then distal, of a right hand's bones at neutral, mm in its frame."""
    centres = np.zeros((len(BONES), 2, 3))
    for digit, drawn_digit in average.items():
        base_sd_mm = drawn.THUMB_BASE_SD_MM if digit == "thumb" else drawn.BASE_SD_MM
        here = drawn_digit.base_mm * scale + base_sd_mm * _clipped_normal(rng, (3,))
        tilt = drawn.DIRECTION_SD_RAD * _clipped_normal(rng, (3,))  # of all bones: the digit stays straight
        directions = rotations.unit(drawn_digit.directions + tilt)
        for joint, direction in zip(_chain(digit), directions, strict=True):
            there = here + lengths_mm[joint + 1] * direction
            centres[joint + 1] = here, there
            here = there
    return centres


def _flexion_axes(
    rng: np.random.Generator, average: DrawnHand, centres_mm: Array, realism: Realism
) -> tuple[Array, Array]:
    """Draw flexion axes (J, 3) of a right hand at neutral; return them with tilt and without."""
    axes = np.zeros((len(JOINTS), 3))
    axes[WRIST] = drawn.WRIST_AXES[FLEXION]
    for digit, drawn_digit in average.items():
        axes[_chain(digit)] = drawn_digit.flexion_axes
    off = drawn.AXIS_SD_RAD * _clipped_normal(rng, (len(JOINTS), 3))
    untilted = rotations.unit(axes)
    axes = rotations.unit(untilted + off)
    if realism.paper_joints:
        for digit in DIGITS:
            cmc, mcp = _chain(digit)[:2]
            base = centres_mm[cmc + 1, 0] if digit == "thumb" else np.zeros(3)
            along = centres_mm[cmc + 1, 1] - base
            axes[mcp] = _perpendicular(axes[mcp], along)
            if digit == "thumb":
                axes[cmc] = _perpendicular(axes[cmc], along)
    return axes, axes if realism.paper_joints else untilted


def _perpendicular(vector: Array, to: Array) -> Array:
    """Return the unit vector along the component of `vector` (3,) perpendicular to `to` (3,)."""
    along = rotations.unit(to)
    return rotations.unit(vector - (vector @ along) * along)


def _coupling(rng: np.random.Generator) -> Array:
    """Draw the involuntary motion (J, 4) of the joints (`RandomHand.coupling`)."""
    numbers = _clipped_normal(rng, (len(JOINTS), 4))
    coupling = np.zeros((len(JOINTS), 4))
    for j, joint in enumerate(JOINTS):
        if joint == "thumb_cmc" or joint.endswith("_mcp"):
            per_abduction, sd, flexion_sd = drawn.AXIAL_COUPLING
            coupling[j] = (per_abduction + sd * numbers[j, 0], flexion_sd * numbers[j, 1], 0.0, 0.0)
        elif joint.endswith("_cmc"):  # pro-supination comes with flexion
            sd = drawn.PRO_SUPINATION_SD
            coupling[j] = (0.0, drawn.PRO_SUPINATION + sd * numbers[j, 1], 0.0, 0.0)
        elif joint != "wrist":
            coupling[j, 2:] = drawn.WOBBLE_SD_RAD * numbers[j, 2:]
    return coupling


def _relaxed_rad(rng: np.random.Generator) -> Array:
    """Draw the flexion (J,), rad, of the relaxed hand: 0 for wrist and palm."""
    relaxed = np.zeros(len(JOINTS))
    for j, joint in enumerate(JOINTS):
        digit, _, kind = joint.partition("_")
        limits_deg = drawn.RELAXED_DEG.get("thumb" if digit == "thumb" else kind)
        if limits_deg is not None:
            relaxed[j] = np.radians(rng.uniform(*limits_deg))
    return relaxed


def _glide_mm(rng: np.random.Generator, axes: Array) -> Array:
    """Draw glides (J, 2, 3), mm, of a right hand's centres, on arcs about the flexion axes (J, 3)."""
    glide = np.zeros((len(JOINTS), 2, 3))
    for j, joint in enumerate(JOINTS):
        limits = drawn.GLIDE_MM.get(joint) or drawn.GLIDE_MM.get(joint.partition("_")[2])
        if limits is not None:
            least, most, over_deg = limits
            radius_mm = rng.uniform(least, most) / (2.0 * np.sin(np.radians(over_deg) / 2.0))
            glide[j, 0] = radius_mm * _perpendicular(rng.standard_normal(3), axes[j])
            glide[j, 1] = radius_mm * drawn.GLIDE_ALONG * rng.uniform(-1.0, 1.0) * axes[j]
    return glide


def _assemble(side: str, straight: _Straight, realism: Realism) -> RandomHand:
    """Convert the neutral hand from the hand's frame to joints in the frames of their parents."""
    centres, axes = straight.centres_mm, straight.axes
    frames = np.tile(np.eye(3), (len(BONES), 1, 1))
    for bone in range(2, len(BONES)):
        x = rotations.unit(centres[bone, 1] - centres[bone, 0])
        y = _perpendicular(straight.facing[bone - 1], x)
        frames[bone] = np.stack([x, y, np.cross(x, y)], -1)
    to_parent = np.swapaxes(frames[PARENT], -1, -2)
    triples = np.stack([axes, *_second_and_third_axes(side, frames, straight)], 1)
    thumb, skew = JOINTS.index("thumb_cmc"), np.zeros((len(JOINTS), 3))
    if not realism.paper_joints:
        # The offset points towards the metacarpal. It is a true vector, whereas axes mirror as
        # pseudo-vectors, so their cross product has the wrong sign in a left hand.
        across = rotations.unit(np.cross(triples[thumb, FLEXION], triples[thumb, ABDUCTION]))
        skew[thumb] = drawn.SKEW_MM * (-across if side == "left" else across)
    order = np.tile([FLEXION, ABDUCTION], (len(JOINTS), 1))
    order[thumb] = ABDUCTION, FLEXION
    origin = centres[1:, 0] - centres[PARENT, 0]
    pads = np.zeros((len(DIGITS), 3))  # under the distal third of the last bones
    pads[:, 0] = 0.7 * straight.lengths_mm[TIP_BONES] + 0.3 * straight.soft_tip_mm
    pads[:, 2] = [-drawn.PAD_DEPTH_MM[digit] * straight.scale for digit in DIGITS]
    return RandomHand(
        side=side,
        origin_mm=np.einsum("jab,jb->ja", to_parent, origin),
        rest=rotations.from_matrix(to_parent @ frames[1:]),
        axes=np.einsum("jab,jib->jia", to_parent, triples),
        order=order,
        skew_mm=np.einsum("jab,jb->ja", to_parent, skew),
        relaxed_rad=straight.relaxed_rad,
        glide_mm=np.einsum("jab,jkb->jka", to_parent, straight.glide_mm),
        length_mm=straight.lengths_mm,
        soft_tip_mm=straight.soft_tip_mm,
        pad_mm=pads,
        coupling=straight.coupling,
        scale=straight.scale,
    )


def _second_and_third_axes(side: str, frames: Array, straight: _Straight) -> tuple[Array, Array]:
    """Return abduction and axial axes (J, 3) at neutral in the hand's frame, mirrored for a left hand."""
    mirror = np.array([-1.0, 1.0, -1.0]) if side == "left" else np.ones(3)
    sign = -1.0 if side == "left" else 1.0
    abduction, axial = sign * frames[1:, :, 2], sign * frames[1:, :, 0]
    abduction[WRIST] = rotations.unit(np.array(drawn.WRIST_AXES[ABDUCTION])) * mirror
    thumb = JOINTS.index("thumb_cmc")
    flexion = straight.axes[thumb]
    across = _perpendicular(straight.second_axis, flexion)
    skew = np.radians(drawn.SKEW_DEG)
    abduction[thumb] = np.cos(skew) * flexion + np.sin(skew) * across
    return abduction, axial
