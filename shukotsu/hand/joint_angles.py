"""Joint angles with names and signs: flexion, ab-/adduction and axial rotation of a bone relative to its
parent.

The joint coordinate system of Grood & Suntay (1983) in the order that the International Society of
Biomechanics recommends for wrist and hand (Wu et al. 2005, J Biomech 38:981, section 4): e1, fixed in the
proximal bone, is the axis of flexion; e3, fixed in the distal bone, is its long axis; e2, at right angles to
both, is the floating axis of ab-/adduction. As intrinsic rotations: about y, z, x of our frames.

Frames: ours have x distal, z towards the back of the bone (of a thumb, the nail's side), y = z x x, which
points to the thumb on a right hand and away from it on a left one. ISB's for the right hand are X palmar,
Y proximal, Z radial: our -z, -x and y. It turns flexion about Z, deviation about the floating X and axial
rotation about Y, so that flexion, ulnar deviation and pronation are positive (pronation turns a bone's radial
edge towards its palmar side). A left hand's angles are those of its mirror image, which is equivalent to
X dorsal, Y distal, Z ulnar on the left, our z, x and y: mirrored movements have the same three angles.

ISB calls the second angle ab-/adduction or radial/ulnar deviation. The name alone does not define the sign of
a finger's abduction, as the middle finger abducts to both sides. So `abduction_deg` is positive towards the
ulna in every joint: it is negative for an index finger spread away from the middle finger, positive for a
spread little finger, and negative for a thumb in palmar abduction. docs/movement.md has a table by joint.
"""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Float
from shukotsu.errors import InputError
from shukotsu.hand.rotations import Array, about_axis, conjugate, matrix, multiply

_SIGN = {"right": -1.0, "left": 1.0}
"""Sign of deviation and rotation relative to turns about z and x; mirroring changes these, but not
flexion."""

_LOCKED = 1e-9


def joint_angles(
    parent: Float[Array, "*#n 4"],
    child: Float[Array, "*#n 4"],
    hand: str,
    rest: Float[Array, " 4"] | None = None,
    axes: Float[Array, " 4"] | None = None,
) -> Float[Array, "*n 3"]:
    """Compute flexion, deviation and axial rotation of a joint from the poses of its two bones.

    Beyond a deviation of 85 deg, errors of pose are amplified more than elevenfold in the other two angles,
    whose axes are nearly parallel. At a deviation of exactly +-90 deg, axial rotation is set to 0 and flexion
    is the whole rotation, so that the angles still reproduce the pose.

    Parameters
    ----------
    parent, child : array, shape (..., 4)
        Unit quaternions (w, x, y, z), bone to transmitter frame, or to any frame common to both; the shapes
        broadcast. NaN gives NaN.
    hand : str
        right or left.
    rest : array, shape (4,), optional
        Rotation from child to parent in the neutral pose, in which all angles are zero, in this hand's frames
        (`mirror_rotations` converts a right hand's to a left hand's). If omitted, the bones' frames are
        parallel in the neutral pose. A thumb's metacarpal, which is oblique to the hand, needs it: otherwise
        its flexion would be about the hand's axis, and its angles would contain a large constant.
    axes : array, shape (4,), optional
        Rotation from the joint's axes to the child's frame; if omitted, the axes are those of that frame. e1
        is the direction of the joint's y axis in the neutral pose, fixed in the parent.

    Returns
    -------
    array, shape (..., 3)
        Angles, deg, with signs as in the module's description; flexion and rotation within (-180, 180], not
        unwrapped, deviation within [-90, 90].

    Raises
    ------
    InputError
        If hand is neither right nor left.

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
    """Compute rotations of a child relative to its parent from joint angles, the inverse of `joint_angles`.

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
        If hand is neither right nor left.

    """
    signed_rad = np.radians(angles_deg) * np.array([1.0, _sign(hand), _sign(hand)])
    about_y, about_z, about_x = (
        about_axis(np.eye(3)[axis], signed_rad[..., part]) for part, axis in enumerate((1, 2, 0))
    )
    turn = multiply(about_y, multiply(about_z, about_x))
    turn = turn if axes is None else multiply(multiply(axes, turn), conjugate(axes))
    return turn if rest is None else multiply(rest, turn)


def mirror_rotations(quaternion: Float[Array, "*n 4"]) -> Float[Array, "*n 4"]:
    """Convert rotations of one hand's bones to those of the other hand in the mirrored posture.

    The mirror plane contains x and z, so that x remains distal, z dorsal, and y changes sides.

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Quaternions (w, x, y, z).

    Returns
    -------
    array, shape (..., 4)
        Mirrored quaternions.

    """
    return np.asarray(quaternion * np.array([1.0, -1.0, 1.0, -1.0]))


def _sign(hand: str) -> float:
    if hand not in _SIGN:
        raise InputError(f"hand is {hand!r}; expected right or left, on which signs of joint angles depend")
    return _SIGN[hand]


def _half_open_deg(angle_rad: Array) -> Array:
    """Convert to degrees within (-180, 180]; arctan2 returns -pi for half a turn if a zero is negative."""
    angle_deg = np.degrees(angle_rad)
    return np.asarray(np.where(angle_deg <= -180.0, 180.0, angle_deg))
