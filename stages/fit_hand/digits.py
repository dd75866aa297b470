"""A digit of known anatomy as a chain: its joints, its bones and the receivers over them."""

from __future__ import annotations

import numpy as np

from anatomy import average_hand as prior
from anatomy.average_hand import DigitAnatomy
from schemas.layout import Digit
from skeleton.rotations import Array, unit
from stages.fit_hand.building import (
    KINDS,
    Amount,
    Builder,
    FirstGuess,
    about,
    across_of,
    along,
    axis_frame,
    bone,
    by_state,
    tilted,
)
from stages.fit_hand.operations import Mark, Operation, Side, Step, Term, Turn

X = np.array([1.0, 0.0, 0.0])


def digit_steps(builder: Builder, digit: Digit, anatomy: DigitAnatomy) -> list[Step]:
    """Lay out a digit from the base bone's frame."""
    return _DigitChain(builder, digit, anatomy).steps()


class _DigitChain:
    """A digit while it is laid out; bone k is moved by joint k.

    above : from the hand's frame to that of the bone before bone k; axes : flexion axes in it, rests :
    rotations of bone k against it, digit straight. flexions : the state of every joint that flexes.
    """

    def __init__(self, builder: Builder, digit: Digit, anatomy: DigitAnatomy) -> None:
        self.builder, self.digit, self.anatomy = builder, digit, anatomy
        self.frames = anatomy.frames()
        self.above = np.concatenate([np.eye(3)[None], self.frames[:-1]]).swapaxes(-1, -2)
        self.axes = [back @ axis for back, axis in zip(self.above, anatomy.flexion_axes, strict=True)]
        self.rests = [back @ frame for back, frame in zip(self.above, self.frames, strict=True)]
        self.measured = [builder.layout.segments[segment].measured for segment in digit.segments]

    def steps(self) -> list[Step]:
        """Lay out base, direction, joints, bones and receivers; add how flexion shows in the receivers."""
        builder, name = self.builder, self.digit.name
        steps: list[Step] = [
            along(
                axis, builder.place(builder.scale.times(at_mm), prior.BASE_SD_MM, "base", f"{name} {letter}")
            )
            for axis, at_mm, letter in zip(np.eye(3), self.anatomy.base_mm, "xyz", strict=True)
        ]
        for axis, letter in ((self.frames[0, :, 1], "y"), (self.frames[0, :, 2], "z")):
            steps.append(
                about(axis, builder.free(0.0, prior.DIRECTION_SD_RAD, "direction", f"{name} {letter}"))
            )
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

    def _flexion_states(self) -> dict[str, int]:
        """Add the flexion of every joint of the digit that moves, be it as little as CMC 2 and 3 do."""
        flexions = {}
        for k, joint in enumerate(self.digit.joints):
            moves = bool(self.builder.layout.joints[joint].dof)
            if self.measured[k] and moves:
                mean_and_sd = prior.PHALANX_DEG if k else prior.METACARPAL_DEG
            elif not self.measured[k] and self.builder.parts.palm:
                mean_and_sd = prior.PALM_DEG if moves else prior.STILL_PALM_DEG
            else:
                continue
            flexions[joint] = self.builder.states.add(joint, KINDS[0], *mean_and_sd)
        return flexions

    def _bone(self, k: int) -> list[Step]:
        """Joint k, the bone that it moves, and that bone's receiver.

        The receiver over a metacarpal does not follow its bone all the way: it sits on a side branch of its
        own, in which the joint turns less.
        """
        builder, joint, segment = self.builder, self.digit.joints[k], self.digit.segments[k]
        skew = self.anatomy.second_axis if k == 0 else None
        second = None if skew is None else self.above[k] @ skew
        moved = _Joint(builder, joint, self.flexions.get(joint), self.axes[k], self.rests[k], second)
        length = builder.length[segment] = self._length(k)
        steps = [*moved.steps(under_reading=False), Mark(bone(segment))]
        builder.centres[joint] = bone(segment)
        if self.measured[k]:
            ridden = self._receiver(k, length)
            if k == 0 and builder.parts.pivot:
                steps = [Side((*moved.steps(under_reading=True), *ridden)), *steps]
            else:
                steps.append(Side(ridden))
        return [*steps, along(X, length)]

    def _kind(self, k: int) -> str:
        """Kind of bone k, as anatomy calls it, whatever the layout calls its segment."""
        return prior.BONE_KINDS[k] if k < len(self.digit.segments) - 1 else prior.BONE_KINDS[-1]

    def _length(self, k: int) -> Amount:
        """Length of bone k: the average one to the hand's scale, its own part and the source's."""
        kind, builder = self._kind(k), self.builder
        own_sd_mm = prior.LENGTH_SD_MM[kind]
        if k == 0 and self.anatomy.second_axis is not None:
            own_sd_mm = prior.THUMB_METACARPAL_SD_MM
        length = builder.scale.times(float(self.anatomy.lengths_mm[k]))
        length = length.plus(builder.free(0.0, own_sd_mm, "length", self.digit.segments[k]))
        return length.plus(builder.shared(prior.SOURCE_SD_MM[kind], "source", kind))

    def _receiver(self, k: int, length: Amount) -> tuple[Step, ...]:
        """The receiver of bone k: at mid-bone, over it, its skin driven by the joints at both ends."""
        is_last = k == len(self.digit.segments) - 1
        share, height_mm = prior.NAIL_SHARE if is_last else prior.MOUNT_SHARE, self.anatomy.mounts_mm()[k, 2]
        place = (length.times(share), Amount(0.0, ()), self.builder.scale.times(float(height_mm)))
        ends = zip(self.digit.joints[k : k + 2], self.digit.segments[k : k + 2], strict=True)
        drives = [
            self.flexions[joint]
            for joint, segment in ends
            if joint in self.flexions and segment in self.builder.seen
        ]
        own_tilt = prior.DISTAL_TILT if is_last else 0.0
        return self.builder.receiver_steps(self.digit.segments[k], place, drives, self._kind(k), own_tilt)


class _Joint:
    """Operations of one joint, which a side branch may repeat with its receiver lagging behind.

    Flexion about an axis that may be tilted; abduction about the child's dorsal axis, carried by flexion, and
    axial rotation about its long axis, carried by both; a hinge has these too, within a few degrees, since
    its axis varies as it turns. Skew axes pass each other: the second, in the parent, carries the first, and
    the centre is half way between them. CMC joints without a receiver pronate as they flex; where the layout
    has them still, they move too little to be told from skin and are no joint of the tables, but their motion
    is not taken for that of another.
    """

    def __init__(
        self,
        builder: Builder,
        joint: str,
        flexion: int | None,
        axis: Array,
        rest: Array,
        second: Array | None,
    ) -> None:
        self.name, self.rest, self.flexion, self.axis = joint, rest, flexion, axis
        self.others: tuple[int, int] | None = None
        self.ratio: int | None = None
        self.under: int | None = None
        self.skew: Amount | None = None
        self.slides: tuple[int, ...] = ()
        if flexion is None:
            return
        known, free = builder.layout.joints[joint], builder.free
        self.moves = bool(known.dof)
        builder.axes[joint] = axis
        sd = prior.AXIS_SD_RAD if second is None else prior.SKEW_AXIS_SD_RAD
        self.tilts = [free(0.0, sd, "axis", f"{joint} {n}") for n in (1, 2)]
        if not builder.layout.segments[known.child].measured:
            self.ratio = builder.unknowns.add("pro-supination", joint)
            return
        abduction, axial = (
            (prior.HINGE_DEG,) * 2 if known.dof == 1 else (prior.ABDUCTION_DEG, prior.AXIAL_DEG)
        )
        self.others = (
            builder.states.add(joint, KINDS[1], *abduction),
            builder.states.add(joint, KINDS[2], *axial),
        )
        if builder.parts.joint_slide:
            self.slides = tuple(builder.unknowns.add("joint slide", f"{joint} {n}") for n in "xyz")
        self.second = rest[:, 2]
        if second is not None:
            self._make_skew(builder, second)

    def _make_skew(self, builder: Builder, second: Array) -> None:
        across = unit(second - (second @ self.axis) * self.axis)
        skew = np.radians(prior.SKEW_DEG)
        self.second = np.cos(skew) * self.axis + np.sin(skew) * across
        self.skew_axis = unit(np.cross(self.axis, self.second))
        self.skew = builder.free(prior.SKEW_MM, prior.SKEW_SD_MM, "skew", self.name)
        self.second_tilts = [
            builder.free(0.0, prior.SKEW_AXIS_SD_RAD, "axis", f"{self.name} second {n}") for n in (1, 2)
        ]
        if builder.parts.pivot:
            self.under = builder.unknowns.add("under-reading", self.name)

    def steps(self, *, under_reading: bool) -> list[Step]:
        """Give the joint's operations from its parent's frame, at its centre, to its child's."""
        if self.flexion is None:
            return [Turn(self.rest)]
        steps: list[Step] = [
            Operation(False, axis, 0.0, (Term(prior.JOINT_SLIDE_SD_MM, unknown, self.flexion),))
            for axis, unknown in zip(np.eye(3), self.slides, strict=False)
        ]
        mark = [] if under_reading or not self.moves else [Mark(axis_frame(self.name))]
        turn = by_state(self.axis, self.flexion, self._lag(self.flexion, under_reading))
        flex = tilted(across_of(self.axis), self.tilts, [*mark, turn])
        if self.ratio is not None:
            pronation = (
                Term(prior.PRO_SUPINATION, None, self.flexion),
                Term(prior.PRO_SUPINATION_SD, self.ratio, self.flexion),
            )
            flex.append(Operation(True, self.rest[:, 0], 0.0, pronation))
        if self.others is None:
            return [*steps, *flex, Turn(self.rest)]
        abduction, axial = self.others
        abduct: list[Step] = [by_state(self.second, abduction, self._lag(abduction, under_reading))]
        roll = by_state(self.rest[:, 0], axial, self._lag(axial, under_reading))
        if self.skew is None:
            return [*steps, *flex, *abduct, roll, Turn(self.rest)]
        back = along(self.skew_axis, self.skew.times(-0.5))
        abduct = tilted(across_of(self.second), self.second_tilts, abduct)
        across = along(self.skew_axis, self.skew)
        return [*steps, back, *abduct, across, *flex, roll, back, Turn(self.rest)]

    def _lag(self, state: int, under_reading: bool) -> tuple[Term, ...]:
        """Share of a joint angle that the receiver does not follow."""
        if not under_reading or self.under is None:
            return ()
        return Term(prior.UNDER_READING, None, state), Term(prior.UNDER_READING_SD, self.under, state)
