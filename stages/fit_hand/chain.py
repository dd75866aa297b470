"""A layout as chains of operations: from the frame of its base bone, the root, to every bone and receiver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.anatomy import average_hand as prior
from shukotsu.anatomy.average_hand import DIGITS, DigitAnatomy
from shukotsu.anatomy.known_digits import known_digits, root_of
from shukotsu.schemas.layout import Layout
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.chain_builder import (
    KINDS,
    Amount,
    Builder,
    FirstGuess,
    States,
    Unknowns,
    along,
    axis_frame,
    by_state,
    centre,
    receiver,
    tilted,
)
from shukotsu.stages.fit_hand.digits import DigitChain
from shukotsu.stages.fit_hand.free_joints import ANGLE_SD_DEG, REACH_SD_MM, WRIST_SD_MM, FreeJoint
from shukotsu.stages.fit_hand.free_joints import AXIS_SD_RAD as FREE_AXIS_SD_RAD
from shukotsu.stages.fit_hand.operations import Branch, Mark, Side, Step, Turn

_FINGER_JOINTS = 4
"""Of a digit that has a DIP joint."""


@dataclass(frozen=True)
class HandModel:
    """Everything that does not depend on a recording.

    length, mount : of a bone, and its receiver's place (x, y, z) on it, by segment; axes : joint to its
    flexion axis in the frame marked `axis_frame`, centres : to the mark at its centre, centres_in_child :
    without anatomy, to its centre in its child's receiver. anatomy : of the average digits, the thumb facing
    as its receiver does.
    """

    unknowns: Unknowns
    states: States
    branches: tuple[Branch, ...]
    receivers: tuple[str, ...]
    guesses: tuple[FirstGuess, ...]
    length: Mapping[str, Amount]
    mount: Mapping[str, tuple[Amount, Amount, Amount]]
    axes: Mapping[str, Array]
    centres: Mapping[str, str]
    centres_in_child: Mapping[str, tuple[Amount, Amount, Amount]]
    anatomy: Mapping[str, DigitAnatomy]


def hand_model(
    layout: Layout,
    receivers: Sequence[str],
    seen: Sequence[str],
    wrist_mm: Array,
    free: Sequence[FreeJoint] = (),
    scale: tuple[float, float] = (1.0, prior.SCALE_SD),
    anatomy: Mapping[str, DigitAnatomy] = DIGITS,
) -> HandModel:
    """Lay out all chains of a layout.

    receivers : segments as frames hold them; seen : those with valid poses, as skin is not fitted to angles
    that nothing shows. wrist_mm : (3,) expected in the root's receiver frame. free : joints without anatomy.
    scale : mean and sd of the hand's size.
    """
    builder = Builder(layout, scale, frozenset(seen))
    root, digits = root_of(layout), known_digits(layout)
    worn = [builder.scale.times(-float(v)) for v in wrist_mm]
    branches = [builder.receiver_steps(root, worn) if digits else [Mark(receiver(root))]]
    branches += [DigitChain(builder, digit, anatomy[digit.name]).steps() for digit in digits]
    states = builder.states
    for digit in digits:  # a finger's last two joints bend together, which tells them apart
        *_, pip, dip = ((joint, KINDS[0]) for joint in digit.joints)
        if len(digit.joints) == _FINGER_JOINTS and pip in states.names and dip in states.names:
            places = states.names.index(dip), states.names.index(pip)
            states.follow(*places, prior.DIP_PER_PIP, prior.DIP_BY_PIP_SD_DEG)
    branches += [_free(builder, joint, free, at_wrist=bool(digits)) for joint in free if joint.near == root]
    return HandModel(
        builder.unknowns,
        builder.states,
        tuple(Branch(steps) for steps in branches),
        tuple(receivers),
        tuple(guess for guess in builder.guesses if {guess.parent, guess.child} <= set(receivers)),
        builder.length,
        builder.mount,
        builder.axes,
        builder.centres,
        builder.centres_in_child,
        anatomy,
    )


def _free(builder: Builder, joint: FreeJoint, others: Sequence[FreeJoint], *, at_wrist: bool) -> list[Step]:
    """A joint without anatomy and all that hangs from it."""
    name = joint.joint.name
    sd = WRIST_SD_MM if at_wrist and joint.far == joint.joint.parent_receiver else REACH_SD_MM
    near = [builder.free(0.0, sd, "near side", f"{name} {n}") for n in "xyz"]
    far = [builder.free(0.0, REACH_SD_MM, "far side", f"{name} {n}") for n in "xyz"]
    outward = joint.far == joint.joint.child
    x, y, z = [amount.times(-1.0) for amount in far] if outward else near
    builder.centres_in_child[name] = x, y, z
    steps: list[Step] = [along(axis, amount) for axis, amount in zip(np.eye(3), near, strict=True)]
    steps.append(Mark(centre(name)))
    states = [
        builder.states.add(name, kind, 0.0, sd)
        for kind, sd in zip(KINDS, ANGLE_SD_DEG[max(joint.joint.dof, 1) - 1], strict=True)
    ]
    axes = joint.axes if outward else -joint.axes  # angles are the child's
    builder.axes[name] = joint.axes[:, 0]
    builder.centres[name] = centre(name)
    builder.guesses.append(FirstGuess(states[0], joint.near, joint.far, np.eye(3), axes[:, 0], joint.mean))
    at_receiver = [1, 2] if joint.joint.dof == 1 else []  # a hinge has one axis; skin turns the receiver
    turns: list[Step] = [
        Mark(axis_frame(name)),
        *(by_state(axes[:, i], state) for i, state in enumerate(states) if i not in at_receiver),
    ]
    if joint.joint.dof < 3:  # three rotations reach every posture, wherever their axes are
        tilts = [builder.free(0.0, FREE_AXIS_SD_RAD, "free axis", f"{name} {n}") for n in (1, 2)]
        turns = tilted((joint.axes[:, 1], joint.axes[:, 2]), tilts, turns)
    steps += turns
    steps.append(Turn(joint.mean))
    steps += [along(axis, amount) for axis, amount in zip(np.eye(3), far, strict=True)]
    steps += [by_state(joint.mean.T @ axes[:, i], states[i]) for i in at_receiver]
    steps.append(Mark(receiver(joint.far)))
    after = [other for other in others if other.near == joint.far]
    return [*steps, *(Side(tuple(_free(builder, other, others, at_wrist=False))) for other in after)]
