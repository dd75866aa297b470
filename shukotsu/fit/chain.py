"""Chains of operations from the frame of a layout's base bone, the root, to all its bones and receivers.

On paper: docs/whole-hand.md, section 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.fit.chain_builder import (
    KINDS,
    Amount,
    Builder,
    Drive,
    FirstGuess,
    States,
    Unknowns,
    about,
    across_of,
    along,
    axis_frame,
    bone,
    by_state,
    centre,
    receiver,
    straight,
    tilt_steps,
)
from shukotsu.fit.free_joints import ANGLE_SD_DEG, REACH_SD_MM, WRIST_SD_MM, FreeJoint
from shukotsu.fit.free_joints import AXIS_SD_RAD as FREE_AXIS_SD_RAD
from shukotsu.fit.operations import Branch, Mark, Operation, Side, Step, Term, Turn
from shukotsu.hand.average_hand import BONE_KINDS, DIGITS, PRIOR, DigitAnatomy
from shukotsu.hand.known_digits import known_digits, root_of
from shukotsu.hand.rotations import Array, unit
from shukotsu.study.layout import Digit, Layout

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])

UNMODELLED = "unmodelled"
"""Group of unknowns for errors of lengths outside the fitted model (section 8)."""

_FINGER_JOINTS = 4
"""Number of joints of a digit that has a DIP joint."""


@dataclass(frozen=True)
class HandModel:
    """Chains of a hand with their unknowns and states: the part of the model that no recording changes.

    Parameters
    ----------
    unknowns, states
        Names, groups and priors of x and y.
    branches : tuple of Branch
        The hand's receiver, every digit, and joints without anatomy.
    receivers : tuple of str
        Segments, in the order of `Frames`.
    guesses : tuple of FirstGuess
        How to read a flexion off the relative rotation of two receivers.
    length : mapping of str to Amount
        Length of every bone, mm, by segment.
    mount : mapping of str to three Amounts
        Place of a segment's receiver in its bone's frame, mm.
    axes : mapping of str to array, shape (3,)
        Flexion axis of a joint in the frame marked `axis_frame`.
    centres : mapping of str to str
        Name of the mark at a joint's centre, by joint.
    centres_in_child : mapping of str to three Amounts
        Centre of a joint without anatomy in its child's receiver, mm.
    knuckles : mapping of str to three Amounts
        Place of a finger's MCP joint in the hand's frame, mm, to first order.
    scale : Amount
        Size of the hand.
    anatomy : mapping of str to DigitAnatomy
        Anatomy of the average digits; the thumb's metacarpal faces as its receiver shows.

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
    knuckles: Mapping[str, tuple[Amount, Amount, Amount]]
    scale: Amount
    anatomy: Mapping[str, DigitAnatomy]


def hand_model(
    layout: Layout,
    receivers: Sequence[str],
    seen: Sequence[str],
    wrist_mm: Array,
    free: Sequence[FreeJoint] = (),
    scale: tuple[float, float] = (1.0, PRIOR.SCALE_SD),
    anatomy: Mapping[str, DigitAnatomy] = DIGITS,
) -> HandModel:
    """Lay out all chains of a layout (docs/whole-hand.md, sections 1 to 3).

    Parameters
    ----------
    layout : Layout
        Segments, joints and digits.
    receivers : sequence of str
        Segments of the receivers, in the order of `Frames`.
    seen : sequence of str
        Receivers with valid poses; skin has no unknowns for angles that no receiver shows.
    wrist_mm : array, shape (3,)
        Wrist centre expected in the frame of the root's receiver.
    free : sequence of FreeJoint
        Joints without anatomy.
    scale : tuple of float
        Mean and sd of the hand's size, relative to the average hand.
    anatomy : mapping of str to DigitAnatomy
        Anatomy of the average digits.

    Returns
    -------
    HandModel
        Unknowns, states and branches; bone lengths and receiver positions as functions of the unknowns.

    """
    builder = Builder(layout, scale, frozenset(seen))
    root, digits = root_of(layout), known_digits(layout)
    worn = [builder.scale.times(-float(v)) for v in wrist_mm]
    base = builder.receiver_steps(root, worn) if digits else [Mark(receiver(root))]
    branches: list[Sequence[Step]] = [base]
    branches += [_DigitChain(builder, digit, anatomy[digit.name]).steps() for digit in digits]
    states = builder.states
    for digit in digits:  # PIP and DIP bend together, which separates them if no receiver is between
        pip, dip = ((joint, KINDS[0]) for joint in digit.joints[-2:])
        if len(digit.joints) == _FINGER_JOINTS and pip in states.names and dip in states.names:
            places = states.names.index(dip), states.names.index(pip)
            states.follow(*places, PRIOR.DIP_PER_PIP, PRIOR.DIP_BY_PIP_SD_DEG)
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
        builder.knuckles,
        builder.scale,
        anatomy,
    )


def _free(builder: Builder, joint: FreeJoint, others: Sequence[FreeJoint], *, at_wrist: bool) -> list[Step]:
    """Lay out a joint of unknown anatomy and everything beyond it."""
    name = joint.joint.name
    sd = WRIST_SD_MM if at_wrist and joint.far == joint.joint.parent_receiver else REACH_SD_MM
    near = [builder.free(0.0, sd, "near side", f"{name} {n}") for n in "xyz"]
    far = [builder.free(0.0, REACH_SD_MM, "far side", f"{name} {n}") for n in "xyz"]
    outward = joint.far == joint.joint.child
    x, y, z = [amount.times(-1.0) for amount in far] if outward else near
    builder.centres_in_child[name] = x, y, z
    steps: list[Step] = [along(axis, amount) for axis, amount in zip(np.eye(3), near, strict=True)]
    steps.append(Mark(centre(name)))
    sds_deg = ANGLE_SD_DEG[max(joint.joint.dof, 1) - 1]
    states = [builder.states.add(name, kind, 0.0, sd) for kind, sd in zip(KINDS, sds_deg, strict=True)]
    axes = joint.axes if outward else -joint.axes  # angles describe the child's motion
    builder.axes[name] = joint.axes[:, 0]
    builder.centres[name] = centre(name)
    builder.guesses.append(FirstGuess(states[0], joint.near, joint.far, np.eye(3), axes[:, 0], joint.mean))
    at_receiver = [1, 2] if joint.joint.dof == 1 else []  # rotations off a hinge's axis are skin motion
    turns: list[Step] = [
        Mark(axis_frame(name)),
        *(by_state(axes[:, i], state) for i, state in enumerate(states) if i not in at_receiver),
    ]
    if joint.joint.dof < 3:  # three rotations reach every posture, wherever their axes are
        tilts = [builder.free(0.0, FREE_AXIS_SD_RAD, "free axis", f"{name} {n}") for n in (1, 2)]
        turns = tilt_steps((joint.axes[:, 1], joint.axes[:, 2]), tilts, turns)
    steps += turns
    steps.append(Turn(joint.mean))
    steps += [along(axis, amount) for axis, amount in zip(np.eye(3), far, strict=True)]
    steps += [by_state(joint.mean.T @ axes[:, i], states[i]) for i in at_receiver]
    steps.append(Mark(receiver(joint.far)))
    after = [other for other in others if other.near == joint.far]
    return [*steps, *(Side(tuple(_free(builder, other, others, at_wrist=False))) for other in after)]


class _DigitChain:
    """Builder of one digit's chain, from the base bone's frame; joint k moves bone k.

    Attributes
    ----------
    above : array, shape (K, 3, 3)
        Rotation from the hand's frame to that of the bone proximal to bone k, digit straight.
    axes : list of array, shape (3,)
        Flexion axis of joint k in the proximal bone's frame.
    rests : list of array, shape (3, 3)
        Rotation of bone k relative to the proximal bone, digit straight.
    flexions : dict of str to int
        State of the flexion of every joint that flexes.

    """

    def __init__(self, builder: Builder, digit: Digit, anatomy: DigitAnatomy) -> None:
        self.builder, self.digit, self.anatomy = builder, digit, anatomy
        self.frames = anatomy.frames()
        self.above = np.concatenate([np.eye(3)[None], self.frames[:-1]]).swapaxes(-1, -2)
        self.axes = [back @ axis for back, axis in zip(self.above, anatomy.flexion_axes, strict=True)]
        self.rests = [back @ frame for back, frame in zip(self.above, self.frames, strict=True)]
        self.measured = [builder.layout.segments[segment].measured for segment in digit.segments]
        self.lengths = [self._length(k) for k in range(len(digit.segments))]
        for k, (segment, length) in enumerate(zip(digit.segments, self.lengths, strict=True)):
            part = "phalanx" if k else "thumb_metacarpal" if digit.name == "thumb" else "metacarpal"
            sd_mm = PRIOR.UNMODELLED_LENGTH_MM[part]  # from how sources define a bone's ends
            builder.length[segment] = builder.place(length, sd_mm, UNMODELLED, segment)

    def steps(self) -> list[Step]:
        """Lay out base, direction, joints, bones and receivers; add first guesses of flexions."""
        builder, name = self.builder, self.digit.name
        base_sd_mm = PRIOR.THUMB_BASE_SD_MM if name == "thumb" else PRIOR.BASE_SD_MM
        base = [
            builder.place(builder.scale.times(at_mm), base_sd_mm, "base", f"{name} {letter}")
            for at_mm, letter in zip(self.anatomy.base_mm, "xyz", strict=True)
        ]
        roll_sd = PRIOR.THUMB_ROLL_SD_RAD if name == "thumb" else PRIOR.ROLL_SD_RAD
        sds = zip((roll_sd, *(PRIOR.DIRECTION_SD_RAD,) * 2), "xyz", strict=True)
        turns = [builder.free(0.0, sd, "direction", f"{name} {letter}") for sd, letter in sds]
        if name != "thumb":
            broader = builder.shared(PRIOR.PALM_BREADTH_SD, "breadth", "palm")
            base[1] = base[1].plus(broader.times(float(self.anatomy.base_mm[1])))
            turns[2] = turns[2].plus(broader.times(float(self.anatomy.directions[0, 1])))
            builder.knuckles[name] = self._knuckle(base, turns)
        steps: list[Step] = [along(axis, amount) for axis, amount in zip(np.eye(3), base, strict=True)]
        steps += [about(axis, amount) for axis, amount in zip(self.frames[0].T, turns, strict=True)]
        steps.append(Mark(straight(name)))
        self.flexions = self._flexion_states()
        parent, before = self.digit.base, np.eye(3)
        for k, (joint, segment) in enumerate(zip(self.digit.joints, self.digit.segments, strict=True)):
            steps += self._bone(k)
            if not self.measured[k]:
                before = before @ self.rests[k]
                continue
            if joint in self.flexions:
                turn = before, self.axes[k], self.rests[k]
                builder.guesses.append(FirstGuess(self.flexions[joint], parent, segment, *turn))
            parent, before = segment, np.eye(3)
        return steps

    def _knuckle(self, base: Sequence[Amount], turns: Sequence[Amount]) -> tuple[Amount, Amount, Amount]:
        """Return the end of the first bone in the hand's frame, to first order in its unknowns."""
        length = self.lengths[0]
        aside, down = (turn.times(length.constant) for turn in (turns[2], turns[1].times(-1.0)))
        x, y, z = (
            at.plus(length.times(along_x)).plus(aside.times(along_y)).plus(down.times(along_z))
            for at, (along_x, along_y, along_z) in zip(base, self.frames[0].tolist(), strict=True)
        )
        return x, y, z

    def _flexion_states(self) -> dict[str, int]:
        """Add a flexion state for every joint that moves, including CMC 2 and 3, which move little."""
        flexions = {}
        for k, joint in enumerate(self.digit.joints):
            moves = bool(self.builder.layout.joints[joint].dof)
            if self.measured[k] and moves:
                mean_and_sd = PRIOR.PHALANX_DEG if k else PRIOR.METACARPAL_DEG
            elif not self.measured[k]:
                mean_and_sd = PRIOR.PALM_DEG if moves else PRIOR.STILL_PALM_DEG
            else:
                continue
            flexions[joint] = self.builder.states.add(joint, KINDS[0], *mean_and_sd)
        return flexions

    def _bone(self, k: int) -> list[Step]:
        """Lay out joint k, its bone and receiver; a thumb's first receiver follows its joint only in part."""
        builder, joint, segment = self.builder, self.digit.joints[k], self.digit.segments[k]
        skew = self.anatomy.second_axis if k == 0 else None
        second = None if skew is None else self.above[k] @ skew
        moved = _Joint(builder, joint, self.flexions.get(joint), self.axes[k], self.rests[k], second)
        length = self.lengths[k]
        steps = [*moved.steps(), Mark(bone(segment))]
        builder.centres[joint] = bone(segment)
        if self.measured[k]:
            worn = self._receiver(k, length, moved)
            if moved.lags is not None:
                steps = [Side((*moved.steps(lagging=True), *worn)), *steps]
            else:
                steps.append(Side(worn))
        return [*steps, along(X, length)]

    def _kind(self, k: int) -> str:
        """Return the anatomical kind of bone k, independent of its segment's name in the layout."""
        return BONE_KINDS[k] if k < len(self.digit.segments) - 1 else BONE_KINDS[-1]

    def _length(self, k: int) -> Amount:
        """Return the length of bone k: the scaled average plus deviations of this bone and its kind."""
        kind, builder = self._kind(k), self.builder
        own_sd_mm = PRIOR.LENGTH_SD_MM[kind]
        if k == 0 and self.anatomy.second_axis is not None:
            own_sd_mm = PRIOR.THUMB_METACARPAL_SD_MM
        length = builder.scale.times(float(self.anatomy.lengths_mm[k]))
        length = length.plus(builder.free(0.0, own_sd_mm, "length", self.digit.segments[k]))
        return length.plus(builder.shared(PRIOR.SOURCE_SD_MM[kind], "source", kind))

    def _receiver(self, k: int, length: Amount, moved: _Joint) -> tuple[Step, ...]:
        """Lay out the receiver of bone k, whose skin is moved by the joints at both ends of the bone."""
        worn, is_last = self.digit.segments[k], k == len(self.digit.segments) - 1
        share, height_mm = PRIOR.NAIL_SHARE if is_last else PRIOR.MOUNT_SHARE, self.anatomy.mounts_mm()[k, 2]
        position = (length.times(share), Amount(0.0, ()), self.builder.scale.times(float(height_mm)))
        ends = zip(self.digit.joints[k : k + 2], self.digit.segments[k : k + 2], strict=True)
        drives = [
            Drive(self.flexions[joint], PRIOR.RELAXED_RAD if joint != self.digit.joints[0] else 0.0)
            for joint, segment in ends
            if joint in self.flexions and segment in self.builder.seen
        ]
        if moved.abducts is not None and worn in self.builder.seen:
            drives.append(Drive(moved.abducts))
        lag, free = moved.turn_lag(), bool(moved.lags)
        return self.builder.receiver_steps(worn, position, drives, self._kind(k), lag, faces_freely=free)


class _Joint:
    """Operations of one joint (docs/whole-hand.md, section 2).

    A side branch may repeat them for a receiver that follows only a part of the motion. Flexion turns about
    an axis that may be tilted, then abduction about the child's dorsal axis, then axial rotation about its
    long axis. A hinge abducts and rotates by a few degrees only, and its bone may lean sideways at rest. The
    centre slides as the joint flexes. If a joint has two skew axes, the second one is fixed in the parent and
    carries the first, and the centre is half way between them. CMC joints without a receiver pronate as they
    flex and are held slightly flexed. If the layout declares them immobile they are left out of the tables,
    but their small motion is modelled so that it is not attributed to other joints.
    """

    def __init__(
        self, builder: Builder, name: str, flexion: int | None, axis: Array, rest: Array, second: Array | None
    ) -> None:
        self.name, self.rest, self.flexion, self.axis = name, rest, flexion, axis
        self.held: list[Step] = []
        self.at_rest: list[Step] = [Turn(rest)]
        self.others: tuple[int, int] | None = None
        self.ratio: int | None = None
        self.lags: tuple[int, int] | None = None
        self.abducts: int | None = None
        self.skew: Amount | None = None
        self.slides: tuple[int, ...] = ()
        if flexion is None:
            return
        declared, free = builder.layout.joints[name], builder.free
        self.moves = bool(declared.dof)
        builder.axes[name] = axis
        sd = PRIOR.AXIS_SD_RAD if second is None else PRIOR.SKEW_AXIS_SD_RAD
        self.tilts = [free(0.0, sd, "axis", f"{name} {n}") for n in (1, 2)]
        if not builder.layout.segments[declared.child].measured:
            self.ratio = builder.unknowns.add("pro-supination", name)
            if self.moves:
                self.held.append(about(axis, free(0.0, PRIOR.PALM_HELD_SD_RAD, "palm held", name)))
            return
        add = builder.states.add
        if declared.dof == 1:
            self.others = add(name, KINDS[1], *PRIOR.HINGE_DEG), add(name, KINDS[2], *PRIOR.HINGE_DEG)
            self.at_rest.append(about(Z, free(0.0, PRIOR.LEAN_SD_RAD, "lean", name)))
            self.slide_sd_mm = PRIOR.HINGE_SLIDE_SD_MM
        else:
            self.others = add(name, KINDS[1], *PRIOR.ABDUCTION_DEG), add(name, KINDS[2], *PRIOR.AXIAL_DEG)
            self.abducts = self.others[0]
            self.slide_sd_mm = PRIOR.JOINT_SLIDE_SD_MM
        self.slides = tuple(builder.unknowns.add("joint slide", f"{name} {n}") for n in "xyz")
        self.second = rest[:, 2]
        if second is not None:
            self._make_skew(builder, second)

    def _make_skew(self, builder: Builder, second: Array) -> None:
        across = unit(second - (second @ self.axis) * self.axis)
        skew = np.radians(PRIOR.SKEW_DEG)
        self.second = np.cos(skew) * self.axis + np.sin(skew) * across
        self.skew_axis = unit(np.cross(self.axis, self.second))
        self.skew = builder.free(PRIOR.SKEW_MM, PRIOR.SKEW_SD_MM, "skew", self.name)
        self.second_tilts = [
            builder.free(0.0, PRIOR.SKEW_AXIS_SD_RAD, "axis", f"{self.name} second {n}") for n in (1, 2)
        ]
        add = builder.unknowns.add
        self.lags = add("place lag", self.name), add("turn lag", self.name)

    def steps(self, *, lagging: bool = False) -> list[Step]:
        """Lay out the operations from the parent's frame at the joint's centre to the child's frame."""
        if self.flexion is None:
            return self.at_rest
        steps: list[Step] = [
            Operation(False, axis, 0.0, (Term(self.slide_sd_mm, unknown, self.flexion),))
            for axis, unknown in zip(np.eye(3), self.slides, strict=False)
        ]
        mark = [] if lagging or not self.moves else [Mark(axis_frame(self.name))]
        turn = by_state(self.axis, self.flexion, self._lag(self.flexion, lagging))
        flex = tilt_steps(across_of(self.axis), self.tilts, [*mark, *self.held, turn])
        if self.ratio is not None:
            usual = Term(PRIOR.PRO_SUPINATION, None, self.flexion)
            own = Term(PRIOR.PRO_SUPINATION_SD, self.ratio, self.flexion)
            flex.append(Operation(True, self.rest[:, 0], 0.0, (usual, own)))
        if self.others is None:
            return [*steps, *flex, *self.at_rest]
        abduction, axial = self.others
        abduct: list[Step] = [by_state(self.second, abduction, self._lag(abduction, lagging))]
        roll = by_state(self.rest[:, 0], axial, self._lag(axial, lagging))
        if self.skew is None:
            return [*steps, *flex, *abduct, roll, *self.at_rest]
        back = along(self.skew_axis, self.skew.times(-0.5))
        abduct = tilt_steps(across_of(self.second), self.second_tilts, abduct)
        across = along(self.skew_axis, self.skew)
        return [*steps, back, *abduct, across, *flex, roll, back, *self.at_rest]

    def _lag(self, state: int, lagging: bool) -> tuple[Term, ...]:
        """Return the terms by which the receiver's position lags behind a joint angle."""
        if not lagging or self.lags is None:
            return ()
        return Term(PRIOR.PLACE_LAG, None, state), Term(PRIOR.PLACE_LAG_SD, self.lags[0], state)

    def turn_lag(self) -> tuple[Step, ...]:
        """Lay out the rotations by which the receiver's orientation lags behind its position."""
        if self.lags is None or self.flexion is None or self.others is None:
            return ()
        steps = []
        axes = (self.axis, self.second, self.rest[:, 0])
        for axis, state in zip(axes, (self.flexion, *self.others), strict=True):
            lag = Term(PRIOR.TURN_LAG, None, state), Term(PRIOR.TURN_LAG_SD, self.lags[1], state)
            steps.append(Operation(True, self.rest.T @ axis, 0.0, lag))
        return tuple(steps)
