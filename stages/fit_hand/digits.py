"""A digit of known anatomy as a chain: its joints, its bones and the receivers over them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinematics.rotations import Array, unit
from schemas.layout import Digit
from stages.fit_hand import anatomy_priors as prior
from stages.fit_hand.anatomy_priors import DigitAnatomy
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
    frames = anatomy.frames()
    steps: list[Step] = [
        along(
            axis,
            builder.place(builder.scale.times(at_mm), prior.BASE_SD_MM, "base", f"{digit.name} {name}"),
        )
        for axis, at_mm, name in zip(np.eye(3), anatomy.base_mm, "xyz", strict=True)
    ]
    for axis, name in ((frames[0, :, 1], "y"), (frames[0, :, 2], "z")):
        tilt = builder.free(0.0, prior.DIRECTION_SD_RAD, "direction", f"{digit.name} {name}")
        steps.append(about(axis, tilt))
    flexions = _flexion_states(builder, digit)
    above = np.eye(3)
    for k in range(len(digit.segments)):
        steps += _bone(builder, digit, anatomy, flexions, k, above)
        above = frames[k]
    _guess(builder, digit, anatomy, flexions)
    return steps


def _bone(
    builder: Builder,
    digit: Digit,
    anatomy: DigitAnatomy,
    flexions: Mapping[str, int],
    k: int,
    above: Array,
) -> list[Step]:
    """A digit's joint k, the bone that it moves, and that bone's receiver; above : the parent bone's frame.

    The receiver over a metacarpal does not follow its bone all the way: it sits on a side branch of its own,
    in which the joint turns less.
    """
    joint, segment = digit.joints[k], digit.segments[k]
    axis = above.T @ unit(np.array(anatomy.flexion_axes[k]))
    second = above.T @ np.array(anatomy.second_axis) if k == 0 and anatomy.second_axis else None
    moved = _Joint(builder, joint, flexions.get(joint), axis, above.T @ anatomy.frames()[k], second)
    size = builder.scale.plus(builder.free(0.0, prior.LENGTH_SD, "length", segment))
    length = builder.length[segment] = size.times(anatomy.lengths_mm[k])
    steps = moved.steps(under_reading=False)
    steps.append(Mark(bone(segment)))
    builder.centres[joint] = bone(segment)
    if builder.layout.segments[segment].measured:
        ridden = _receiver(builder, digit, k, length, flexions)
        if k == 0 and builder.parts.pivot:
            steps = [Side((*moved.steps(under_reading=True), *ridden)), *steps]
        else:
            steps.append(Side(ridden))
    return [*steps, along(X, length)]


def _receiver(
    builder: Builder, digit: Digit, k: int, length: Amount, flexions: Mapping[str, int]
) -> tuple[Step, ...]:
    """The receiver of a digit's bone k: at mid-bone, over it, its skin driven by the joints at both ends."""
    last = k == len(digit.segments) - 1
    kind = len(prior.HEIGHT_MM) - 1 if last else k
    place = (length.times(0.5), Amount(0.0, ()), builder.scale.times(prior.HEIGHT_MM[kind]))
    drives = [
        flexions[joint]
        for joint, segment in zip(digit.joints[k : k + 2], digit.segments[k : k + 2], strict=True)
        if joint in flexions and segment in builder.seen
    ]
    return builder.receiver_steps(digit.segments[k], place, drives, prior.DISTAL_TILT if last else 0.0)


def _flexion_states(builder: Builder, digit: Digit) -> dict[str, int]:
    """Add the flexion of every joint of the digit that moves."""
    flexions = {}
    for joint, segment in zip(digit.joints, digit.segments, strict=True):
        if not builder.layout.joints[joint].dof:
            continue
        measured = builder.layout.segments[segment].measured
        first = segment == digit.segments[0]
        if measured or builder.parts.palm:
            prior_deg = (prior.PHALANX_DEG, prior.METACARPAL_DEG)[first] if measured else prior.PALM_DEG
            flexions[joint] = builder.states.add(joint, KINDS[0], *prior_deg)
    return flexions


def _guess(builder: Builder, digit: Digit, anatomy: DigitAnatomy, flexions: Mapping[str, int]) -> None:
    """Say how every joint's flexion shows in the receivers before it and after it."""
    frames = anatomy.frames()
    parent, above, before = digit.base, np.eye(3), np.eye(3)
    for k, (joint, segment) in enumerate(zip(digit.joints, digit.segments, strict=True)):
        rest = above.T @ frames[k]
        if builder.layout.segments[segment].measured:
            if joint in flexions:
                axis = above.T @ unit(np.array(anatomy.flexion_axes[k]))
                builder.guesses.append(FirstGuess(flexions[joint], parent, segment, before, axis, rest))
            parent, before = segment, np.eye(3)
        else:
            before = before @ rest
        above = frames[k]


class _Joint:
    """Operations of one joint, which a side branch may repeat with its receiver lagging behind.

    Flexion about an axis that may be tilted; abduction about the child's dorsal axis, carried by flexion, and
    axial rotation about its long axis, carried by both, where the joint has two degrees of freedom. Skew
    axes pass each other, and the centre is half way between them. CMC joints without a receiver pronate as
    they flex.
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
        builder.axes[joint] = axis
        self.tilts = [free(0.0, prior.AXIS_SD_RAD, "axis", f"{joint} {n}") for n in (1, 2)]
        if not builder.layout.segments[known.child].measured:
            self.ratio = builder.unknowns.add("pro-supination", joint)
            return
        if known.dof > 1:
            abduction = builder.states.add(joint, KINDS[1], *prior.ABDUCTION_DEG)
            self.others = abduction, builder.states.add(joint, KINDS[2], *prior.AXIAL_DEG)
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
            builder.free(0.0, prior.AXIS_SD_RAD, "axis", f"{self.name} second {n}") for n in (1, 2)
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
        half = [] if self.skew is None else [along(self.skew_axis, self.skew.times(-0.5))]
        mark = [] if under_reading else [Mark(axis_frame(self.name))]
        flex = by_state(self.axis, self.flexion, self._lag(self.flexion, under_reading))
        steps += [*half, *tilted(across_of(self.axis), self.tilts, [*mark, flex])]
        if self.ratio is not None:
            pronation = (
                Term(prior.PRO_SUPINATION, None, self.flexion),
                Term(prior.PRO_SUPINATION_SD, self.ratio, self.flexion),
            )
            steps.append(Operation(True, self.rest[:, 0], 0.0, pronation))
        if self.skew is not None:
            steps.append(along(self.skew_axis, self.skew))
        if self.others is not None:
            abduction, axial = self.others
            abduct = [by_state(self.second, abduction, self._lag(abduction, under_reading))]
            skew = self.skew is not None
            steps += tilted(across_of(self.second), self.second_tilts, abduct) if skew else abduct
            steps.append(by_state(self.rest[:, 0], axial, self._lag(axial, under_reading)))
        return [*steps, *half, Turn(self.rest)]

    def _lag(self, state: int, under_reading: bool) -> tuple[Term, ...]:
        """Share of a joint angle that the receiver does not follow."""
        if not under_reading or self.under is None:
            return ()
        return Term(prior.UNDER_READING, None, state), Term(prior.UNDER_READING_SD, self.under, state)
