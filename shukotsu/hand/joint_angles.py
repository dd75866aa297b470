"""Joint angles with names and signs: flexion, ab-/adduction and axial rotation of a bone against its parent.

The joint coordinate system of Grood & Suntay (1983) in the order that the International Society of
Biomechanics recommends for wrist and hand (Wu et al. 2005, J Biomech 38:981, section 4): e1, fixed in the
proximal bone, is the axis of flexion; e3, fixed in the distal bone, is its long axis; e2, at right angles to
both, is the floating axis of ab-/adduction. As turns carried one by the other: about y, z, x of our frames.

Frames: ours have x distal, z towards the back of the bone (of a thumb, the nail's side), y = z x x, which
points to the thumb on a right hand and away from it on a left one. ISB's for the right hand are X palmar,
Y proximal, Z radial: our -z, -x and y. It turns flexion about Z, deviation about the floating X and axial
rotation about Y, so that flexion, ulnar deviation and pronation are positive (pronation turns a bone's radial
edge towards its palmar side). A left hand's angles are those of its mirror image, which comes to the same as
X dorsal, Y distal, Z ulnar on the left, our z, x and y: mirrored movements give the same three numbers.

ISB calls the second angle ab-/adduction or radial/ulnar deviation, and the name alone leaves the sign of a
finger's abduction open: the middle finger abducts to both sides. So `abduction_deg` is signed by radius and
ulna in every joint: an index spread away from the middle finger has a negative one, a little finger that is
spread a positive one, a thumb in palmar abduction a negative one. The table by joints: docs/movement.md.
"""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Float
from shukotsu.errors import InputError
from shukotsu.hand.rotations import Array, about_axis, conjugate, matrix, multiply

_SIGN = {"right": -1.0, "left": 1.0}
"""Sign of deviation and rotation against turns about z and x; mirroring changes these, not flexion."""

_LOCKED = 1e-9


def joint_angles(
    parent: Float[Array, "*#n 4"],
    child: Float[Array, "*#n 4"],
    hand: str,
    rest: Float[Array, " 4"] | None = None,
    axes: Float[Array, " 4"] | None = None,
) -> Float[Array, "*n 3"]:
    """Compute flexion, deviation and axial rotation of a joint from the poses of its two bones.

    Beyond a deviation of 85 deg errors of pose come out more than eleven times larger in the other two
    angles, which turn about nearly the same axis. At a deviation of exactly +-90 deg axial rotation is set to
    0 and flexion takes the whole rotation, so that the angles still reproduce the pose.

    Parameters
    ----------
    parent, child : array, shape (..., 4)
        Unit quaternions (w, x, y, z), bone to transmitter frame, or to any frame common to both; the shapes
        broadcast. NaN gives NaN.
    hand : str
        right or left.
    rest : array, shape (4,), optional
        Child to parent at neutral, where all angles are zero, in this hand's own frames (`mirror_rotations`
        turns a right hand's into a left one's). Without it the bones' frames are parallel at neutral. A
        thumb's metacarpal, which stands across the hand, needs one: else its flexion would be about the
        hand's axis, and its angles would hold a large constant.
    axes : array, shape (4,), optional
        How the joint's axes stand in the child's frame; without it they are that frame's. e1 is where the
        child's y is at neutral, fixed in the parent.

    Returns
    -------
    array, shape (..., 3)
        Degrees, signed as the module says; flexion and rotation within (-180, 180], not unwrapped, deviation
        within [-90, 90].

    Raises
    ------
    InputError
        Where hand is neither right nor left.

    """
    sign = _sign(hand)
    relative = multiply(conjugate(parent), child)
    change = relative if rest is None else multiply(conjugate(rest), relative)
    turn = matrix(change if axes is None else multiply(multiply(conjugate(axes), change), axes))
    reach = np.hypot(turn[..., 0, 0], turn[..., 2, 0])
    flexion = np.arctan2(-turn[..., 2, 0], turn[..., 0, 0])
    rotation = sign * np.arctan2(-turn[..., 1, 2], turn[..., 1, 1])
    locked = reach < _LOCKED
    if locked.any():
        flexion = np.where(locked, np.arctan2(turn[..., 0, 2], turn[..., 2, 2]), flexion)
        rotation = np.where(locked, 0.0, rotation)
    abduction_deg = np.degrees(sign * np.arctan2(turn[..., 1, 0], reach))
    return np.stack([_half_open_deg(flexion), abduction_deg, _half_open_deg(rotation)], -1)


def joint_rotation(
    angles_deg: Float[Array, "*n 3"],
    hand: str,
    rest: Float[Array, " 4"] | None = None,
    axes: Float[Array, " 4"] | None = None,
) -> Float[Array, "*n 4"]:
    """Compute the rotations of a child against its parent from joint angles, the inverse of `joint_angles`.

    The child's pose is `multiply(parent, joint_rotation(...))`.

    Parameters
    ----------
    angles_deg : array, shape (..., 3)
        Flexion, deviation, axial rotation.
    hand, rest, axes
        As in `joint_angles`.

    Returns
    -------
    array, shape (..., 4)
        Unit quaternions (w, x, y, z), child to parent.

    Raises
    ------
    InputError
        Where hand is neither right nor left.

    """
    signed_rad = np.radians(angles_deg) * np.array([1.0, _sign(hand), _sign(hand)])
    about_y, about_z, about_x = (
        about_axis(np.eye(3)[axis], signed_rad[..., part]) for part, axis in enumerate((1, 2, 0))
    )
    turn = multiply(about_y, multiply(about_z, about_x))
    turn = turn if axes is None else multiply(multiply(axes, turn), conjugate(axes))
    return turn if rest is None else multiply(rest, turn)


def mirror_rotations(quaternion: Float[Array, "*n 4"]) -> Float[Array, "*n 4"]:
    """Mirror rotations of one hand's bones into those of the other hand in the mirrored posture.

    The mirror is the plane of x and z; x stays distal and z dorsal, so y goes from one side to the other.

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Quaternions (w, x, y, z).

    Returns
    -------
    array, shape (..., 4)
        The mirrored ones.

    """
    return np.asarray(quaternion * np.array([1.0, -1.0, 1.0, -1.0]))


def _sign(hand: str) -> float:
    if hand not in _SIGN:
        raise InputError(f"hand is {hand!r}, expected right or left, which joint angles are signed by")
    return _SIGN[hand]


def _half_open_deg(angle_rad: Array) -> Array:
    """Degrees within (-180, 180]: arctan2 tells the two halves of a half turn apart by the sign of a zero."""
    angle_deg = np.degrees(angle_rad)
    return np.asarray(np.where(angle_deg <= -180.0, 180.0, angle_deg))
