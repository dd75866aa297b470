"""The hand of a subject: bones, joints and axes.

Frames: one per bone, origin at the centre of its proximal joint, x along the bone distally, z dorsal, y
the flexion axis made perpendicular to x, so that a positive flexion turns x towards the palm. The hand's
frame has its origin at the wrist centre. Right hand: y towards the thumb; the left hand is the mirror image.

Sources: lengths Buryanov & Kotiuk 2010; bases of the metacarpals Buchholz 1992; directions and axes of the
joints MyoHand (Apache-2.0; the numbers only, its frame turned into ours); thumb CMC axes skew, Chang &
Pollard 2008; CMC motion El-shennawy 2001.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from kinematics import rotations
from stages.simulate.randomness import generator
from stages.simulate.realism import Realism

Array = npt.NDArray[np.float64]

DIGITS = ("thumb", "index", "middle", "ring", "little")
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

_LENGTHS_MM = {  # from each joint to the next, or to the bone's tip
    "thumb": (46.22, 31.57, 21.67),
    "index": (68.12, 39.78, 22.38, 15.82),
    "middle": (64.60, 44.63, 26.33, 17.40),
    "ring": (58.00, 41.37, 25.65, 17.30),
    "little": (53.69, 32.74, 18.11, 15.96),
}
_SOFT_TIP_MM = (5.67, 3.84, 3.95, 3.95, 3.73)
_PAD_DEPTH_MM = (8.0, 6.5, 6.5, 6.5, 6.0)

_BASES_MM = {  # CMC joints in the hand's frame, average right hand
    "thumb": (25.0, 26.5, -10.5),
    "index": (13.5, 10.6, 2.0),
    "middle": (13.5, 0.0, 3.0),
    "ring": (13.5, -10.8, 2.0),
    "little": (13.5, -18.7, -1.0),
}
_POINTS_MM = {  # the joints after the CMC and the tip; only the directions between them are used
    "thumb": ((54.2, 43.0, -23.2), (80.1, 57.0, -33.3), (100.1, 67.0, -41.3)),
    "index": ((80.9, 22.2, 11.0), (122.2, 29.7, 18.3), (147.1, 33.0, 19.5), (165.1, 35.0, 19.5)),
    "middle": ((80.6, 4.7, 11.5), (124.8, 6.4, 17.7), (153.8, 7.7, 19.7), (172.8, 9.7, 18.7)),
    "ring": ((79.3, -9.9, 5.7), (119.5, -13.4, 7.0), (144.3, -15.7, 7.6), (162.3, -16.7, 8.6)),
    "little": ((71.2, -19.5, -3.4), (106.7, -24.8, -6.3), (127.4, -27.7, -8.5), (144.4, -28.7, -11.5)),
}
_FLEXION_AXES = {  # CMC, MCP, PIP, DIP (thumb: CMC, MCP, IP), hand's frame, right hand
    "thumb": ((-0.732, 0.496, 0.468), (-0.203, 0.084, -0.975), (-0.480, 0.050, -0.876)),
    "index": ((-0.10, 0.995, 0.0),) * 4,
    "middle": ((0.0, 1.0, 0.0),) * 4,
    "ring": ((0.0, 0.90, 0.43),) * 4,
    "little": ((0.0, 0.825, 0.565),) * 3 + ((0.227, 0.643, 0.731),),
}
_WRIST_AXES = ((0.10, 0.97, 0.22), (-0.10, 0.0, 1.0), (1.0, 0.0, 0.0))
_THUMB_ABDUCTION_AXIS = (0.665, -0.042, 0.745)
_THUMB_SKEW_MM, _THUMB_SKEW_DEG = 4.6, 87.0

_SCALE_SD, _BONE_SD, _SIDE_SD, _SIDE_LIMIT = 0.08, 0.05, 0.0012, 0.0024
_AXIS_SD_RAD, _DIRECTION_SD_RAD, _BASE_SD_MM = 0.05, 0.03, 1.0


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
    abduction and axial rotation in rad at 90 deg. scale : the hand's size, 1 for the average.
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
    scale = float(np.exp(_SCALE_SD * _clipped(rng, ())))
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
        lengths[np.array(_chain(digit)) + 1] = _LENGTHS_MM[digit]
    return np.asarray(lengths * scale * (1.0 + _BONE_SD * _clipped(rng, (len(BONES),))))


def _side_factors(subject: str, side: str, seed: int) -> Array:
    numbers = generator(seed, "side", subject, side).standard_normal(len(BONES))
    return np.asarray(1.0 + np.clip(_SIDE_SD * numbers, -_SIDE_LIMIT, _SIDE_LIMIT))


def _centres_mm(rng: np.random.Generator, lengths_mm: Array, scale: float) -> Array:
    """Ends of every bone at neutral, right hand, in the hand's frame: (B, 2, 3), proximal and distal."""
    centres = np.zeros((len(BONES), 2, 3))
    for digit in DIGITS:
        here = np.array(_BASES_MM[digit]) * scale + _BASE_SD_MM * _clipped(rng, (3,))
        points = np.vstack([_BASES_MM[digit], _POINTS_MM[digit]])
        directions = rotations.unit(np.diff(points, axis=0))
        # one tilt for the whole digit keeps it straight
        directions = rotations.unit(directions + _DIRECTION_SD_RAD * _clipped(rng, (3,)))
        for joint, direction in zip(_chain(digit), directions, strict=True):
            there = here + lengths_mm[joint + 1] * direction
            centres[joint + 1] = here, there
            here = there
    return centres


def _flexion_axes(rng: np.random.Generator, centres_mm: Array, realism: Realism) -> Array:
    """Flexion axes at neutral, right hand, in the hand's frame, (J, 3)."""
    axes = np.zeros((len(JOINTS), 3))
    axes[WRIST] = _WRIST_AXES[FLEXION]
    for digit in DIGITS:
        axes[_chain(digit)] = _FLEXION_AXES[digit]
    axes = rotations.unit(rotations.unit(axes) + _AXIS_SD_RAD * _clipped(rng, (len(JOINTS), 3)))
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
            coupling[j] = (0.10 + 0.05 * numbers[j, 0], 0.05 * numbers[j, 1], 0.0, 0.0)
        elif joint.endswith("_cmc"):  # pro-supination comes with flexion; ratio 27/20 .. 22/27
            coupling[j] = (0.0, 0.8 + 0.15 * numbers[j, 1], 0.0, 0.0)
        elif joint != "wrist":  # the helical axis of a hinge varies by about 5 deg
            coupling[j] = (0.0, 0.0, 0.05 * numbers[j, 2], 0.05 * numbers[j, 3])
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
        skew[thumb] = _THUMB_SKEW_MM * (-across if side == "left" else across)
    origin = centres[1:, 0] - centres[PARENT, 0]
    pads = np.array([_pad_mm(i, lengths[bone], scale) for i, bone in enumerate(TIP_BONES)])
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
    abduction[WRIST] = rotations.unit(np.array(_WRIST_AXES[ABDUCTION])) * mirror
    thumb = JOINTS.index("thumb_cmc")
    flexion = axes[thumb]
    across = _perpendicular(np.array(_THUMB_ABDUCTION_AXIS) * mirror, flexion)
    skew = np.radians(_THUMB_SKEW_DEG)
    abduction[thumb] = np.cos(skew) * flexion + np.sin(skew) * across
    return abduction, axial


def _pad_mm(digit: int, length_mm: float, scale: float) -> tuple[float, float, float]:
    """Where the digit's pad touches: under the distal third of its last bone."""
    return (0.7 * length_mm + 0.3 * _SOFT_TIP_MM[digit] * scale, 0.0, -_PAD_DEPTH_MM[digit] * scale)
