"""The hand of a subject: bones, joints and axes.

Frames: one per bone, origin at the centre of its proximal joint, x along the bone distally, z dorsal, y
the flexion axis made perpendicular to x, so that a positive flexion turns x towards the palm. The hand's
frame has its origin at the wrist centre. Right hand: y towards the thumb; the left hand is the mirror image.

The numbers that hands are drawn around are those of `anatomy.drawn_hands`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anatomy import drawn_hands as drawn
from skeleton import rotations
from skeleton.rotations import Array
from stages.simulate.randomness import generator
from stages.simulate.realism import Realism

DIGITS = tuple(drawn.MIXED_TABLE)
FINGERS = DIGITS[1:]

# Joint j moves bone j + 1. Joints stand in levels outward from the body, so that a level is posed at once.
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
"""Bone from which each joint's own bone hangs."""

FLEXION, ABDUCTION, AXIAL = range(3)
WRIST = JOINTS.index("wrist")
FINGER_CMC = np.array([JOINTS.index(f"{digit}_cmc") for digit in FINGERS])
TIP_BONES = np.array([BONES.index(f"{digit}_distal") for digit in DIGITS])


@dataclass(frozen=True)
class Hand:
    """A hand: how each bone hangs from its parent, and about what it turns.

    Everything is given in the parent bone's frame at neutral (all joint angles 0). J = len(JOINTS),
    B = len(BONES). origin_mm : (J, 3) the joint's centre. rest : (J, 4) child bone to parent bone.
    axes : (J, 3, 3) unit axes of flexion, abduction (carried by flexion) and axial rotation (by both).
    skew_mm : (J, 3) from the flexion axis to the abduction axis, zero but at the thumb's CMC.
    length_mm : (B,) to the next joint, or to the bone's tip; 0 for forearm and hand.
    pad_mm : (5, 3) where each digit's pad touches, in its distal bone's frame.
    coupling : (J, 4) involuntary motion: axial per abduction, axial per flexion, and the wobble of the hinge,
    abduction and axial rotation in rad at 90 deg. scale : the hand's size, 1 for the drawn.
    """

    side: str
    origin_mm: Array
    rest: Array
    axes: Array
    skew_mm: Array
    length_mm: Array
    pad_mm: Array
    coupling: Array
    scale: float


def hand_of(subject: str, side: str, seed: int, realism: Realism) -> Hand:
    """Give the hand of a subject; the two sides' bones differ by less than 0.5 % in length."""
    rng = generator(seed, "anatomy", subject)
    scale = float(np.exp(drawn.SCALE_SD * _clipped(rng, ())))
    lengths = _lengths_mm(rng, scale) * _side_factors(subject, side, seed)
    centres = _centres_mm(rng, lengths, scale)
    axes = _flexion_axes(rng, centres, realism)
    coupling = _coupling(rng)
    if side == "left":  # a mirror image: points lose the sign of y, axes (pseudo-vectors) those of x and z
        centres = centres * [1.0, -1.0, 1.0]
        axes = axes * [-1.0, 1.0, -1.0]
    return _assemble(side, centres, axes, lengths, coupling, scale, realism)


def _clipped(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Standard normal numbers, none beyond 2.2 sd: nobody's bone is half as long."""
    return np.clip(rng.standard_normal(shape), -2.2, 2.2)


def _chain(digit: str) -> list[int]:
    """Joints of a digit from the base outward."""
    return [j for j, joint in enumerate(JOINTS) if joint.startswith(f"{digit}_")]


def _lengths_mm(rng: np.random.Generator, scale: float) -> Array:
    lengths = np.zeros(len(BONES))
    for digit in DIGITS:
        lengths[np.array(_chain(digit)) + 1] = drawn.MIXED_TABLE[digit].lengths_mm
    return np.asarray(lengths * scale * (1.0 + drawn.LENGTH_SD * _clipped(rng, (len(BONES),))))


def _side_factors(subject: str, side: str, seed: int) -> Array:
    numbers = generator(seed, "side", subject, side).standard_normal(len(BONES))
    limit = drawn.SIDE_LIMIT
    return np.asarray(1.0 + np.clip(drawn.SIDE_SD * numbers, -limit, limit))


def _centres_mm(rng: np.random.Generator, lengths_mm: Array, scale: float) -> Array:
    """Ends of every bone at neutral, right hand, in the hand's frame: (B, 2, 3), proximal and distal."""
    centres = np.zeros((len(BONES), 2, 3))
    for digit in DIGITS:
        own = drawn.MIXED_TABLE[digit]
        here = own.base_mm * scale + drawn.BASE_SD_MM * _clipped(rng, (3,))
        # one tilt for the whole digit keeps it straight
        directions = rotations.unit(own.directions + drawn.DIRECTION_SD_RAD * _clipped(rng, (3,)))
        for joint, direction in zip(_chain(digit), directions, strict=True):
            there = here + lengths_mm[joint + 1] * direction
            centres[joint + 1] = here, there
            here = there
    return centres


def _flexion_axes(rng: np.random.Generator, centres_mm: Array, realism: Realism) -> Array:
    """Flexion axes at neutral, right hand, in the hand's frame, (J, 3)."""
    axes = np.zeros((len(JOINTS), 3))
    axes[WRIST] = drawn.WRIST_AXES[FLEXION]
    for digit in DIGITS:
        axes[_chain(digit)] = drawn.MIXED_TABLE[digit].flexion_axes
    off = drawn.AXIS_SD_RAD * _clipped(rng, (len(JOINTS), 3))
    axes = rotations.unit(rotations.unit(axes) + off)
    if realism.perpendicular_mcp:
        for digit in DIGITS:
            cmc, mcp = _chain(digit)[:2]
            base = centres_mm[cmc + 1, 0] if digit == "thumb" else np.zeros(3)
            along = centres_mm[cmc + 1, 1] - base
            axes[mcp] = _perpendicular(axes[mcp], along)
            if digit == "thumb":
                axes[cmc] = _perpendicular(axes[cmc], along)
    return axes


def _perpendicular(vector: Array, to: Array) -> Array:
    along = rotations.unit(to)
    return rotations.unit(vector - (vector @ along) * along)


def _coupling(rng: np.random.Generator) -> Array:
    """Involuntary motion of each joint (see Hand.coupling)."""
    numbers = _clipped(rng, (len(JOINTS), 4))
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


def _assemble(
    side: str, centres: Array, axes: Array, lengths: Array, coupling: Array, scale: float, realism: Realism
) -> Hand:
    """Turn the neutral hand, given in the hand's frame, into joints in their parents' frames."""
    frames = np.tile(np.eye(3), (len(BONES), 1, 1))
    for bone in range(2, len(BONES)):
        x = rotations.unit(centres[bone, 1] - centres[bone, 0])
        y = _perpendicular(axes[bone - 1], x)
        frames[bone] = np.stack([x, y, np.cross(x, y)], -1)
    to_parent = np.swapaxes(frames[PARENT], -1, -2)
    triples = np.stack([axes, *_second_and_third_axes(side, frames, axes)], 1)
    skew = np.zeros((len(JOINTS), 3))
    if not realism.hinges_only:
        thumb = JOINTS.index("thumb_cmc")
        across = rotations.unit(np.cross(triples[thumb, FLEXION], triples[thumb, ABDUCTION]))
        # an offset is a true vector: where axes mirror as pseudo-vectors, their product has the wrong sign
        skew[thumb] = drawn.SKEW_MM * (-across if side == "left" else across)
    origin = centres[1:, 0] - centres[PARENT, 0]
    pads = np.array([_pad_mm(*pair, scale) for pair in zip(DIGITS, lengths[TIP_BONES], strict=True)])
    return Hand(
        side=side,
        origin_mm=np.einsum("jab,jb->ja", to_parent, origin),
        rest=rotations.from_matrix(to_parent @ frames[1:]),
        axes=np.einsum("jab,jib->jia", to_parent, triples),
        skew_mm=np.einsum("jab,jb->ja", to_parent, skew),
        length_mm=lengths,
        pad_mm=pads,
        coupling=coupling,
        scale=scale,
    )


def _second_and_third_axes(side: str, frames: Array, axes: Array) -> tuple[Array, Array]:
    """Abduction and axial axes at neutral, in the hand's frame, each (J, 3); mirrored for a left hand."""
    mirror = np.array([-1.0, 1.0, -1.0]) if side == "left" else np.ones(3)
    sign = -1.0 if side == "left" else 1.0
    abduction, axial = sign * frames[1:, :, 2], sign * frames[1:, :, 0]
    abduction[WRIST] = rotations.unit(np.array(drawn.WRIST_AXES[ABDUCTION])) * mirror
    thumb = JOINTS.index("thumb_cmc")
    flexion, second = axes[thumb], drawn.MIXED_TABLE["thumb"].second_axis
    assert second is not None
    across = _perpendicular(second * mirror, flexion)
    skew = np.radians(drawn.SKEW_DEG)
    abduction[thumb] = np.cos(skew) * flexion + np.sin(skew) * across
    return abduction, axial


def _pad_mm(digit: str, length_mm: float, scale: float) -> tuple[float, float, float]:
    """Where the digit's pad touches: under the distal third of its last bone."""
    soft_tip_mm = drawn.MIXED_TABLE[digit].soft_tip_mm
    return (0.7 * length_mm + 0.3 * soft_tip_mm * scale, 0.0, -drawn.PAD_DEPTH_MM[digit] * scale)
