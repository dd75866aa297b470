"""Building blocks of chains: amounts as functions of the unknowns, names of marks, elementary steps.

Unknowns (x) are in units of their prior's standard deviation, zero at its mean. States (y) are the joint
angles of a frame, rad: zero when the digit is straight and lies flat in the hand.

On paper: docs/whole-hand.md, sections 1 to 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from shukotsu.fit.operations import Mark, Operation, Step, Term
from shukotsu.hand.average_hand import PRIOR
from shukotsu.hand.rotations import Array, unit
from shukotsu.study.layout import Layout

KINDS = ("flexion", "abduction", "axial")
"""Kinds of joint angles: about the first, the second and the third axis of a joint."""


@dataclass(frozen=True)
class Amount:
    """A length or an offset that is linear in the unknowns: constant + sum of coefficient * x[unknown]."""

    constant: float
    parts: tuple[tuple[float, int], ...]

    def times(self, factor: float) -> Amount:
        """Scale the amount.

        Parameters
        ----------
        factor : float
            Factor on the constant and on every coefficient.

        Returns
        -------
        Amount
            The scaled amount.

        """
        return Amount(self.constant * factor, tuple((c * factor, i) for c, i in self.parts))

    def plus(self, other: Amount) -> Amount:
        """Return the sum of two amounts."""
        return Amount(self.constant + other.constant, self.parts + other.parts)

    def row(self, n_unknowns: int) -> Array:
        """Compute the derivative of the amount by the unknowns.

        Parameters
        ----------
        n_unknowns : int
            Number of unknowns G.

        Returns
        -------
        array, shape (G,)
            Derivative, in the amount's unit per sd of the unknown's prior.

        """
        row = np.zeros(n_unknowns)
        for coefficient, unknown in self.parts:
            row[unknown] += coefficient
        return row


@dataclass
class Unknowns:
    """Names of the unknowns x, and their groups, each with a common prior scale."""

    names: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)

    def add(self, group: str, name: str) -> int:
        """Add an unknown; return its index."""
        self.names.append(f"{name} {group}")
        self.groups.append(group)
        return len(self.names) - 1


@dataclass
class States:
    """Joint angles of a frame with their priors.

    Attributes
    ----------
    names : list of (joint, kind)
        Joint and kind of each angle.
    mean, sd : list of float
        Prior mean and standard deviation, rad.
    follows : dict of int to (int, float)
        For an angle whose prior mean is a multiple of another angle: that angle and the ratio.

    """

    names: list[tuple[str, str]] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)
    sd: list[float] = field(default_factory=list)
    follows: dict[int, tuple[int, float]] = field(default_factory=dict)

    def add(self, joint: str, kind: str, mean_deg: float, sd_deg: float) -> int:
        """Add a joint angle to the states of a frame.

        Parameters
        ----------
        joint, kind : str
            Joint, and which of its angles, one of KINDS.
        mean_deg, sd_deg : float
            Prior of the angle in every frame, deg.

        Returns
        -------
        int
            Index of the state.

        """
        self.names.append((joint, kind))
        self.mean.append(float(np.radians(mean_deg)))
        self.sd.append(float(np.radians(sd_deg)))
        return len(self.names) - 1

    def follow(self, state: int, other: int, ratio: float, sd_deg: float) -> None:
        """Set the prior mean of a state to a multiple of another state, instead of a constant.

        Parameters
        ----------
        state, other : int
            State that follows, and the one that it follows.
        ratio : float
            Factor on the other state.
        sd_deg : float
            Prior sd about that multiple, deg.

        """
        self.follows[state] = other, ratio
        self.mean[state], self.sd[state] = ratio * self.mean[other], float(np.radians(sd_deg))

    def sd_over(self, samples: float) -> Array:
        """Return the prior sd of the states for a fit to a number of independent samples.

        The coupling of two joints is a single piece of information about the hand, not one per sample, so its
        sd is multiplied by the root of the number of samples.

        Parameters
        ----------
        samples : float
            Number of independent samples.

        Returns
        -------
        array, shape (S,)
            Standard deviations, rad.

        """
        sd = np.array(self.sd)
        sd[list(self.follows)] *= np.sqrt(samples)
        return sd

    def link(self) -> Array:
        """Return the matrix (S, S) from deviations from the mean to independent components of sd `sd`."""
        link = np.eye(len(self.names))
        for state, (other, ratio) in self.follows.items():
            link[state, other] = -ratio
        return link


@dataclass(frozen=True)
class FirstGuess:
    """How to read a flexion off two receivers: child rotation = parent rotation * before * flexion * after.

    Attributes
    ----------
    state : int
        Index of the flexion among the states.
    parent, child : str
        Segments of the two receivers.
    before, after : array, shape (3, 3)
        Constant rotations.
    axis : array, shape (3,)
        Flexion axis in the frame that `before` leads to.

    """

    state: int
    parent: str
    child: str
    before: Array
    axis: Array
    after: Array


@dataclass(frozen=True)
class Drive:
    """A joint angle (state) that moves skin, which is relaxed at the angle relaxed_rad."""

    state: int
    relaxed_rad: float = 0.0

    def terms(self, per_rad: float, unknown: int | None = None) -> tuple[Term, Term]:
        """Return the terms by which skin moves in proportion to the joint angle.

        Parameters
        ----------
        per_rad : float
            Motion of the skin per rad from the angle at which it is relaxed.
        unknown : int, optional
            Index of an unknown that scales it.

        Returns
        -------
        tuple of Term
            A term proportional to the angle, and the constant that makes it zero at the relaxed angle.

        """
        return Term(per_rad, unknown, self.state), Term(-per_rad * self.relaxed_rad, unknown)


def bone(segment: str) -> str:
    """Return the name of the mark at a bone's frame, whose origin is the centre of its proximal joint."""
    return f"bone {segment}"


def axis_frame(joint: str) -> str:
    """Return the name of the mark at the frame in which `HandModel.axes` states a joint's flexion axis."""
    return f"axis {joint}"


def straight(digit: str) -> str:
    """Return the name of the mark at a digit's base: the hand's axes, turned by this digit's direction."""
    return f"straight {digit}"


def centre(joint: str) -> str:
    """Return the name of the mark at the centre of a joint at which no bone of known anatomy begins."""
    return f"centre {joint}"


def receiver(segment: str) -> str:
    """Return the name of the mark at a receiver's frame."""
    return f"receiver {segment}"


class Builder:
    """State shared while chains are laid out: attributes of `HandModel`, arguments of `hand_model`."""

    def __init__(self, layout: Layout, scale: tuple[float, float], seen: frozenset[str]) -> None:
        self.layout, self.seen = layout, seen
        self.unknowns, self.states = Unknowns(), States()
        self.scale = self.free(*scale, "scale", "hand")
        self.length: dict[str, Amount] = {}
        self.mount: dict[str, tuple[Amount, Amount, Amount]] = {}
        self.guesses: list[FirstGuess] = []
        self.axes: dict[str, Array] = {}
        self.centres: dict[str, str] = {}
        self.centres_in_child: dict[str, tuple[Amount, Amount, Amount]] = {}
        self.knuckles: dict[str, tuple[Amount, Amount, Amount]] = {}

    def free(self, mean: float, sd: float, group: str, name: str) -> Amount:
        """Add an unknown amount to the hand.

        Parameters
        ----------
        mean : float
            Mean of its prior, mm or rad.
        sd : float
            Standard deviation of its prior, in the same unit.
        group, name : str
            Group whose prior scale it shares (`fit.FAMILIES`), and its name.

        Returns
        -------
        Amount
            mean + sd times a new unknown.

        """
        return Amount(mean, ((sd, self.unknowns.add(group, name)),))

    def place(self, mean: Amount, sd: float, group: str, name: str) -> Amount:
        """Add an amount that differs from another one by a new unknown.

        Parameters
        ----------
        mean : Amount
            The other amount.
        sd : float
            Standard deviation of its prior, in the same unit.
        group, name : str
            Group whose prior scale it shares (`fit.FAMILIES`), and its name.

        Returns
        -------
        Amount
            mean + sd times a new unknown.

        """
        return mean.plus(self.free(0.0, sd, group, name))

    def shared(self, sd: float, group: str, name: str) -> Amount:
        """Return an amount of mean zero that several parts of the hand share: one unknown under one name.

        Parameters
        ----------
        sd : float
            Standard deviation of its prior, in the same unit.
        group, name : str
            Group whose prior scale it shares (`fit.FAMILIES`), and its name.

        Returns
        -------
        Amount
            sd times the unknown, which is added if it does not exist yet.

        """
        full = f"{name} {group}"
        if full in self.unknowns.names:
            return Amount(0.0, ((sd, self.unknowns.names.index(full)),))
        return self.free(0.0, sd, group, name)

    def receiver_steps(
        self,
        segment: str,
        position: Sequence[Amount],
        drives: Sequence[Drive] = (),
        kind: str | None = None,
        lag: Sequence[Step] = (),
        *,
        faces_freely: bool = False,
    ) -> tuple[Step, ...]:
        """Lay out a receiver on its bone, moved by skin as joints bend (docs/whole-hand.md, section 3).

        Parameters
        ----------
        segment : str
            Segment that carries the receiver.
        position : sequence of three Amounts
            Expected position in the bone's frame, mm.
        drives : sequence of Drive
            Joint angles that move its skin: first the flexion at the bone's proximal joint, unless no pose of
            this receiver is valid.
        kind : str, optional
            Kind of the bone; None for the palm. Nails share a habit of placement, and so do all other bones.
        lag : sequence of Step
            Rotations by which the receiver's orientation lags behind its position.
        faces_freely : bool
            Whether its roll about the bone is hardly constrained.

        Returns
        -------
        tuple of Step
            Steps from the bone's frame to the mark of the receiver.

        """
        habit = None if kind is None else "nail" if kind == "distal" else "bone"
        sds_mm = PRIOR.MOUNT_SD_MM
        if habit is not None and self.layout.receiver_height_mm is not None:
            sds_mm = (*sds_mm[:2], PRIOR.HEIGHT_SD_MM)
        placed = [
            self._put_on(at, sds_mm[i], "mount across" if i else "mount", segment, habit, i)
            for i, at in enumerate(position)
        ]
        if habit is not None:
            placed[2] = placed[2].plus(self._cover())
        self.mount[segment] = (placed[0], placed[1], placed[2])
        steps: list[Step] = []
        for i, axis in enumerate(np.eye(3)):
            skin = self.skin_terms(segment, drives, f"slide {'xyz'[i]}", PRIOR.SLIDE_SD_MM[i])
            steps.append(along(axis, placed[i], skin))
            if i == 0 and habit is not None:
                sd = PRIOR.FACING_SD_RAD if faces_freely else PRIOR.ROUND_SD_RAD
                steps.append(about(axis, self.free(0.0, sd, "facing", segment)))
        steps += lag
        for i, axis in enumerate(np.eye(3)):
            slope = float(np.radians(PRIOR.NAIL_SLOPE_DEG)) if kind == "distal" and i == 1 else 0.0
            turn = self._put_on(Amount(slope, ()), PRIOR.MOUNT_TURN_SD_RAD, "mount turn", segment, habit, i)
            skin = self.skin_terms(segment, drives, f"tilt {'xyz'[i]}", PRIOR.TILT_SD[i])
            if i == 1 and kind == "distal" and drives:
                ((_, more),) = self.shared(1.0, "own tilt", "nails").parts  # common to all nails
                skin += drives[0].terms(PRIOR.DISTAL_TILT) + drives[0].terms(PRIOR.DISTAL_TILT_SD, more)
            steps.append(about(axis, turn, skin))
        return (*steps, Mark(receiver(segment)))

    def _cover(self) -> Amount:
        """Return the amount by which skin and housing of all receivers are higher than expected."""
        height_mm = self.layout.receiver_height_mm
        if height_mm is None:
            return self.shared(PRIOR.COVER_SD_MM, "cover", "receivers")
        higher = Amount(height_mm - PRIOR.HOUSING_MM, ())
        return higher.plus(self.shared(PRIOR.SKIN_COVER_SD_MM, "cover", "receivers"))

    def _put_on(
        self, mean: Amount, sd: float, group: str, segment: str, habit: str | None, axis: int
    ) -> Amount:
        """Return a receiver's offset or turn on an axis of its bone: expected, by habit and by chance."""
        letter = "xyz"[axis]
        if habit is None:
            return self.place(mean, sd, group, f"{segment} {letter}")
        by_chance = self.place(mean, (1.0 - PRIOR.HABIT_SHARE) ** 0.5 * sd, group, f"{segment} {letter}")
        return by_chance.plus(self.shared(PRIOR.HABIT_SHARE**0.5 * sd, f"{group} habit", f"{habit} {letter}"))

    def skin_terms(self, segment: str, drives: Sequence[Drive], group: str, sd: float) -> tuple[Term, ...]:
        """Add the unknowns by which a segment's skin moves with joint angles.

        Parameters
        ----------
        segment : str
            Segment that carries the receiver.
        drives : sequence of Drive
            Joint angles that move its skin.
        group : str
            Group of the unknowns.
        sd : float
            Their prior sd, mm or rad per rad, on skin of usual looseness.

        Returns
        -------
        tuple of Term
            Terms of the amount by which skin moves.

        """
        sd *= PRIOR.looseness(segment)
        terms: tuple[Term, ...] = ()
        for n, drive in enumerate(drives):
            terms += drive.terms(sd, self.unknowns.add(group, f"{segment} {n}"))
        return terms


def along(axis: Array, amount: Amount, skin: tuple[Term, ...] = ()) -> Operation:
    """Translate along an axis by an amount.

    Parameters
    ----------
    axis : array, shape (3,)
        Unit vector of the axis in the frame that the chain has there.
    amount : Amount
        Distance, mm.
    skin : tuple of Term
        Terms by which skin moves with a joint's angle; empty for a bone.

    Returns
    -------
    Operation
        Step of a chain (docs/whole-hand.md, section 2).

    """
    return Operation(False, axis, amount.constant, (*(Term(c, i) for c, i in amount.parts), *skin))


def about(axis: Array, amount: Amount, skin: tuple[Term, ...] = ()) -> Operation:
    """Rotate about an axis by an amount.

    Parameters
    ----------
    axis : array, shape (3,)
        Unit vector of the axis in the frame that the chain has there.
    amount : Amount
        Angle, rad, right-handed.
    skin : tuple of Term
        Terms by which skin moves with a joint's angle; empty for a bone.

    Returns
    -------
    Operation
        Step of a chain (docs/whole-hand.md, section 2).

    """
    return Operation(True, axis, amount.constant, (*(Term(c, i) for c, i in amount.parts), *skin))


def by_state(axis: Array, state: int, skin: tuple[Term, ...] = ()) -> Operation:
    """Rotate about an axis by a joint angle.

    Parameters
    ----------
    axis : array, shape (3,)
        Unit vector of the axis in the frame that the chain has there.
    state : int
        Index of the angle among the states of a frame.
    skin : tuple of Term
        Terms by which skin moves with a joint's angle; empty for a bone.

    Returns
    -------
    Operation
        Step of a chain (docs/whole-hand.md, section 2).

    """
    return Operation(True, axis, 0.0, (Term(1.0, None, state), *skin))


def across_of(axis: Array) -> tuple[Array, Array]:
    """Compute two unit vectors perpendicular to an axis and to each other.

    Parameters
    ----------
    axis : array, shape (3,)
        Unit vector.

    Returns
    -------
    tuple of array, shape (3,)
        First and second, so that axis, first and second are right-handed.

    """
    first = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    return first, np.cross(axis, first)


def tilt_steps(across: tuple[Array, Array], tilts: Sequence[Amount], turn: Sequence[Step]) -> list[Step]:
    """Rotate about an axis that is itself tilted by two small rotations: tilt, turn, and tilt back.

    Parameters
    ----------
    across : tuple of array, shape (3,)
        Axes of the two rotations, as `across_of` returns them.
    tilts : sequence of Amount
        Their angles, rad.
    turn : sequence of Step
        Rotation that is tilted.

    Returns
    -------
    list of Step
        Steps of the chain.

    """
    first, second = across
    return [
        about(first, tilts[0]),
        about(second, tilts[1]),
        *turn,
        about(second, tilts[1].times(-1.0)),
        about(first, tilts[0].times(-1.0)),
    ]
