"""The tree of bodies and joints of an OpenSim model: coordinates of each joint, their axes and values over
time.

A joint's frame is fixed to the parent's bone, at the joint's rest offset, in the orientation of zero angles.
A pose is given by translations along this frame's axes, followed by R = R(axis 1, q1) R(axis 2, q2) R(axis 3,
q3). Three rotations and three translations describe every relative pose of two bones without loss.

- A joint of known anatomy rotates by the angles of `docs/movement.md`, in their order and with their signs:
  flexion, abduction, rotation.
- A joint with an estimated axis first rotates about this axis. Its zero is, among the rotations that align
the
  axis in both bones, the one nearest to the anatomical zero; abduction and rotation are about two axes at
  right angles to it. If these two stay zero, as in a true hinge, the joint has only flexion.
- A joint of unknown anatomy rotates from its mean about the axes of its largest, second and third rotation.
- A joint without a degree of freedom that moves nevertheless, such as a palm's, rotates from its mean about
  the axes of its bone; its coordinates are named like the angles.
- The root rotates about the ground's axes, in the order that keeps its second angle farthest from 90 deg.
- A bone without a degree of freedom that does not move relative to its parent is welded to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from shukotsu.arrays import Array
from shukotsu.export.exported_motion import BONE_TO_WEBXR, MOVES_MM, carrier, local_motion, plain_names
from shukotsu.hand import rotations
from shukotsu.hand.neutral_bones import angle_axes
from shukotsu.hand.posing import PosedRecording, SkeletonJoint

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
STILL_RAD = 1e-7
"""Rotations below this are treated as zero: they move the end of a 100 mm bone by 10 nm."""

_SIGN = {"right": -1.0, "left": 1.0}
_ANGLES = ("flexion", "abduction", "rotation")


@dataclass(frozen=True)
class Coordinate:
    """Coordinate of a joint over time; values : (T,), a continuous rotation, rad, or a translation, mm."""

    name: str
    values: Array


@dataclass(frozen=True)
class JointForm:
    """A joint of the OpenSim model and the body that it carries.

    Attributes
    ----------
    index
        Index of the joint in the motion.
    name, body
        Names of the joint and of the body.
    dof
        Degrees of freedom in the skeleton model.
    parent
        Index of the parent's form in the list, -1 for the ground.
    offset_mm, quaternion
        Joint's frame in the parent's bone frame, shapes (3,) and (4,).
    axes
        Rows of the (3, 3) array are the axes of rotation.
    turns
        Rotations about these axes: three, one (a hinge), or none.
    shifts
        Translations along the frame's axes: three or none.

    """

    index: int
    name: str
    body: str
    dof: int
    parent: int
    offset_mm: Array
    quaternion: Array
    axes: Array
    turns: tuple[Coordinate, ...]
    shifts: tuple[Coordinate, ...]

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Rotations, then translations."""
        return (*self.turns, *self.shifts)


def joint_forms(motion: PosedRecording) -> tuple[JointForm, ...]:
    """Return the forms of all joints except tips, parents first, of a motion with frames and without gaps."""
    local_mm, local = local_motion(motion)
    kept = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    places = {index: number for number, index in enumerate(kept)}
    names = plain_names(motion.names[index] for index in kept)
    bodies = plain_names(motion.joints[index].segment for index in kept)
    forms = []
    for index, name, body in zip(kept, names, bodies, strict=True):
        joint, turn = motion.joints[index], local[:, index]
        if joint.parent < 0:
            orders = [list(order) for order in permutations(range(3))]
            angles = [rotations.turn_angles(turn, np.eye(3)[order]) for order in orders]
            best = int(np.argmax([np.abs(np.cos(values[:, 1])).min() for values in angles]))
            zero, axes, values = IDENTITY, np.eye(3)[orders[best]], angles[best]
            labels = tuple(f"r{'xyz'[number]}" for number in orders[best])
        else:
            zero, axes, labels = _frame(motion, index, turn)
            values = rotations.turn_angles(rotations.multiply(rotations.conjugate(zero), turn), axes)
        offset = motion.rest_offset_mm[index]
        beyond = rotations.rotate(rotations.conjugate(zero), local_mm[:, index] - offset)
        turns = _turns(joint, name, labels, values)
        shifts: tuple[Coordinate, ...] = ()
        if joint.parent < 0 or np.abs(beyond).max() > MOVES_MM:
            shifts = tuple(Coordinate(f"{name}_t{axis}", beyond[:, n]) for n, axis in enumerate("xyz"))
        parent = places.get(joint.parent, -1)
        forms.append(JointForm(index, name, body, joint.dof, parent, offset, zero, axes, turns, shifts))
    return tuple(forms)


def fixed_points(
    motion: PosedRecording, forms: Sequence[JointForm], taken: Sequence[str]
) -> list[tuple[str, JointForm, Array]]:
    """Return the name, form and position (3,), mm, of each tip, which is a point fixed to a form's body.

    taken : names that are in use already.
    """
    places = {form.index: form for form in forms}
    tips = [index for index, joint in enumerate(motion.joints) if joint.tip]
    names = plain_names([*taken, *(motion.names[index] for index in tips)])[len(taken) :]
    carried = [carrier(motion, index) for index in tips]
    return [(name, places[above], at_mm) for name, (above, at_mm) in zip(names, carried, strict=True)]


def _turns(joint: SkeletonJoint, name: str, labels: Sequence[str], values: Array) -> tuple[Coordinate, ...]:
    """Return those of a joint's three rotations that it needs."""
    turns = tuple(Coordinate(f"{name}_{label}", value) for label, value in zip(labels, values.T, strict=True))
    if joint.parent < 0:
        return turns
    if joint.dof == 0 and np.abs(values).max() < STILL_RAD:
        return ()
    if joint.dof == 1 and np.abs(values[:, 1:]).max() < STILL_RAD:
        return turns[:1]
    return turns


def _frame(motion: PosedRecording, index: int, turn: Array) -> tuple[Array, Array, tuple[str, ...]]:
    """Return a joint's frame (4,) in its parent's bone, its axes (3, 3), and the names of its rotations."""
    joint, neutral, hinge = motion.joints[index], motion.neutral[index], motion.axis[index]
    mean = rotations.mean_rotation(turn)
    anatomical = bool(np.isfinite(neutral).all())
    zero = neutral if anatomical else mean
    change = rotations.multiply(rotations.conjugate(mean), turn)
    if joint.dof == 0 and rotations.angle(change).max() < STILL_RAD:
        zero = mean
    sign = _SIGN[motion.hand]
    axes = np.array([[-1.0, 0.0, 0.0], [0.0, sign, 0.0], [0.0, 0.0, -sign]])
    turned = rotations.multiply(angle_axes(joint, motion.hand), BONE_TO_WEBXR)
    axes = rotations.rotate(rotations.multiply(rotations.conjugate(BONE_TO_WEBXR), turned), axes)
    labels = _ANGLES
    if not anatomical and joint.dof:
        vector = change[:, 1:] * np.where(change[:, :1] < 0, -1.0, 1.0)
        about = np.linalg.eigh(vector.T @ vector)[1].T[::-1]  # axes by the amount of rotation, largest first
        about = about * np.sign(about[np.arange(3), np.abs(about).argmax(1)])[:, None]
        axes = np.stack([about[0], about[1], np.cross(about[0], about[1])])
        labels = ("turn1", "turn2", "turn3")
    if joint.dof != 1 or not np.isfinite(hinge).all():
        return zero, axes, labels
    first = hinge if axes[0] @ hinge >= 0 else -hinge
    seen = rotations.unit(rotations.rotate(turn, first).mean(0))
    nearest = rotations.multiply(shortest_turn(rotations.rotate(zero, first), seen), zero)
    return nearest, _complete_axes(first, axes), labels


def _complete_axes(first: Array, axes: Array) -> Array:
    """Return right-handed axes (3, 3) with this first axis and the second one nearest to that of `axes`."""
    near = axes[1] if abs(first @ axes[1]) < 0.9 else axes[0]
    second = rotations.unit(near - (near @ first) * first)
    return np.stack([first, second, np.cross(first, second)])


def shortest_turn(start: Array, end: Array) -> Array:
    """Return the smallest rotation (4,) that takes the unit vector `start` (3,) to `end` (3,).

    A rotation of 180 deg is about the axis nearest to x, or to y if `start` is nearly along x.
    """
    across = np.cross(start, end)
    sine = float(np.linalg.norm(across))
    if sine == 0.0 and start @ end > 0:
        return IDENTITY.copy()
    axis = across / sine if sine else _complete_axes(start, np.eye(3)[[1, 0, 2]])[1]
    return rotations.about_axis(axis, float(np.arctan2(sine, start @ end)))
