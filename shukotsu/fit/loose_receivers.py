"""Find receivers that did not stay in place, and disturbed fields.

A receiver may come loose at once or slide slowly; metal disturbs all receivers near it. Every receiver is
tested for a displacement (`displacement_test`) and the room for metal (`field_test`). Unless metal explains
the data better, the likeliest displacement is estimated together with the hand and corrected for, and the
test is repeated until nothing abnormal is left.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shukotsu.fit.chain import HandModel
from shukotsu.fit.compiled_equations import pose, residuals
from shukotsu.fit.displacement_test import MOMENTS, Displacement, ScoreTest
from shukotsu.fit.field_test import LEAST_FIELD_GAIN, Disturbance, likeliest_field
from shukotsu.fit.fit import FAMILIES, HandFit
from shukotsu.fit.gauss_newton import NEARLY, first_guess, solve
from shukotsu.fit.normal_equations import Frames, Observations, Point, Problem, Residuals
from shukotsu.fit.operations import Index
from shukotsu.fit.posterior import SolvedFit
from shukotsu.hand.known_digits import known_digits, root_of
from shukotsu.hand.rotations import Array, exp_rotation
from shukotsu.tables.poses import Poses, joined_poses

EVEN_FRAMES = 120
"""Number of frames that are tested, evenly spaced over all recordings; several for each independent
sample."""

MOST_DISPLACEMENTS, MOST_MOVED, OFF_MM = 8, 4, 60.0
"""Largest number of displacements sought in a calibration, and in a recording that is compared with one;
shift beyond which a receiver must have come off its bone, so that the search ends."""

NORMAL = {
    "phalanx": (1.0, float(np.radians(3.0))),
    "palm": (1.5, float(np.radians(3.0))),
    "metacarpal": (3.0, float(np.radians(10.0))),
}
"""Shift and turn, mm and rad, that skin alone may cause for half of a recording, on a finger, on the back of
the hand and on the thumb's metacarpal. Skin over a phalanx slides by a millimetre and over the tendons of the
hand by one and a half; over the thenar muscles it bulges and stretches with every grip and whenever the hand
rests on something."""

SWALLOWED_SD = 4.5
"""Skin motion, relative to published values, above which a fit has probably explained a loose receiver as
skin motion. In simulations the largest value is 3.4 with twice the usual skin artefact, and the smallest is
8.9 in fits that did so."""

SKIN, STIFF = ("slide", "tilt", "joint slide"), 100.0
"""Families of unknowns that could absorb a displacement, and the precision that prevents it."""

_DENSE_FRAMES = 200
_BARE_STEPS = 10
_POSING_STEPS = 4
_SOLVING_STEPS = 10
_REFINEMENTS = 3
_SAME_MOMENT = 3
_UNSURE_FRAMES = 2
_MEDIAN_OF_SQUARES = 2.366
"""Median of the sum of three squared standard normal variables."""


@dataclass(frozen=True)
class Moment:
    """A frame of one of several recordings (by index), and its time, or NaN."""

    recording: int
    frame: int
    time_s: float


@dataclass(frozen=True)
class LooseReceiver:
    """A receiver displaced by step (6,), mm and rotation vector, at `start` or evenly until `end`."""

    segment: str
    start: Moment
    end: Moment
    step: Array

    @property
    def slid(self) -> bool:
        """Whether it slid slowly rather than came loose at once."""
        return (self.end.recording, self.end.frame) != (self.start.recording, self.start.frame)

    @property
    def shift_mm(self) -> float:
        """Distance by which its origin moved on the bone."""
        return float(np.linalg.norm(self.step[:3]))

    @property
    def turn_deg(self) -> float:
        """Angle by which it turned."""
        return float(np.degrees(np.linalg.norm(self.step[3:])))


@dataclass(frozen=True)
class Displaced:
    """Receivers that came loose or slid, in order of time; or a disturbed field instead."""

    loose: Sequence[LooseReceiver] = ()
    field: Disturbance | None = None


def displaced_in(fit: HandFit, recordings: Sequence[Poses]) -> Displaced:
    """Find displacements in the recordings to which a hand was fitted (docs/whole-hand.md, section 11).

    A receiver that was put on elsewhere between two recordings is displaced at the first frame of the second.
    Only receivers on bones of known anatomy are tested, as skin motion of others would be mistaken for a
    loose receiver. If the field is disturbed no receiver is reported, as the two cannot be separated.

    Parameters
    ----------
    fit : HandFit
        The hand.
    recordings : sequence of Poses
        Recordings to which it was fitted, in order of time.

    Returns
    -------
    Displaced
        Loose receivers in order of time, or a disturbed field.

    """
    poses = joined_poses(recordings)
    rows, problem, point = _pose_evenly(fit, poses)
    tested = Tested.of(fit)
    field, gain = likeliest_field(problem, point)
    if gain > LEAST_FIELD_GAIN and gain > tested.scored(problem, point).most_abnormal():
        return Displaced(field=field)
    model, start = fit.model, list[Displacement]()
    skin = np.isin(model.unknowns.groups, [name for family in SKIN for name in FAMILIES[family]])
    if np.abs(point.x[skin]).max(initial=0.0) > SWALLOWED_SD:
        problem = replace(problem, precision=np.ones(len(problem.precision)))
        skinless = replace(problem, precision=np.where(skin, STIFF, 1.0))
        point, start = _uncover(problem, skinless, point, model, tested)
    needed = _leave_out_explained(problem, tested, *_search(problem, point, start, tested))
    return Displaced(_loose(fit, recordings, poses, rows, problem, *needed))


def moved_in(fit: HandFit, poses: Poses) -> list[LooseReceiver]:
    """Find receivers displaced relative to the calibration, throughout a recording or from a frame on.

    The recording is compared with the fitted hand and its covariance. No receiver is reported if a disturbed
    field explains the residuals that remain after correcting for the displacements.

    Parameters
    ----------
    fit : HandFit
        The hand; its posterior is used as the prior.
    poses : Poses
        Another recording of the same receivers.

    Returns
    -------
    list of LooseReceiver
        Displacements in order of time; empty for recordings of fewer than `MOMENTS` frames.

    """
    if len(poses.frame) < MOMENTS:
        return []
    rows, problem, point = _pose_evenly(fit, poses)
    posterior = fit.posterior
    root = np.linalg.cholesky(np.linalg.inv(posterior.covariance)).T
    calibrated = Observations(root, root @ posterior.x)
    problem = replace(problem, precision=np.zeros(len(posterior.x)), observations=calibrated)
    tested = replace(Tested.of(fit), calibrated=True)
    put_back, displaced = _search(problem, point, [], tested)
    if not displaced:
        return []
    left = replace(problem, frames=_certain(_put_back(problem.frames, displaced), displaced))
    gain = likeliest_field(left, put_back)[1]
    if gain > max(LEAST_FIELD_GAIN, likeliest_field(problem, point)[1] / 2):
        return []
    return _loose(
        fit, [poses], poses, rows, problem, *_leave_out_explained(problem, tested, put_back, displaced)
    )


def _loose(
    fit: HandFit,
    recordings: Sequence[Poses],
    poses: Poses,
    rows: Index,
    problem: Problem,
    displaced: Sequence[Displacement],
    x: Array,
) -> list[LooseReceiver]:
    """Convert displacements to named receivers and moments; rows : indices of the even frames in poses."""
    recording = recording_of_rows(recordings)
    untempered = replace(problem, temper=1.0)
    loose = []
    for moved in displaced:
        others = [other for other in displaced if other is not moved]
        first, last = (int(rows[min(moment, len(rows) - 1)]) for moment in (moved.start, moved.end))
        if not moved.slides:
            first = last = _exact_row(fit, poses, rows, untempered, x, moved, others)
        start, end = (
            Moment(int(recording[row]), int(poses.frame[row]), float(poses.time_s[row]))
            for row in (first, last)
        )
        loose.append(LooseReceiver(fit.model.receivers[moved.receiver], start, end, moved.step))
    return sorted(loose, key=lambda receiver: (receiver.start.recording, receiver.start.frame))


@dataclass(frozen=True)
class Tested:
    """Receivers that are tested for displacement.

    Attributes
    ----------
    receivers : tuple of int
        Indices of the receivers.
    normal : array, shape (S, 2)
        Shift and turn that skin alone may cause, mm and rad.
    calibrated : bool
        Whether the hand was fitted to other recordings, so that a receiver may be displaced throughout this
        one.

    """

    receivers: tuple[int, ...]
    normal: Array
    calibrated: bool = False

    @classmethod
    def of(cls, fit: SolvedFit) -> Tested:
        """Select the receivers over bones of known anatomy."""
        names, metacarpals = fit.model.receivers, {d.segments[0] for d in known_digits(fit.layout)}
        kinds = ["metacarpal" if name in metacarpals else "phalanx" for name in names]
        kinds[names.index(root_of(fit.layout))] = "palm"
        over_bones = tuple(s for s, name in enumerate(names) if name in fit.model.mount)
        return cls(over_bones, np.array([NORMAL[kind] for kind in kinds]))

    def scored(self, problem: Problem, point: Point, only: Sequence[int] = ()) -> ScoreTest:
        """Test receivers for displacements at a point.

        Parameters
        ----------
        problem : Problem
            Chains, measured frames and priors.
        point : Point
            Solution.
        only : sequence of int, optional
            Receivers to test; all of `receivers` if omitted.

        Returns
        -------
        ScoreTest
            Evidence for all displacements.

        """
        receivers = only or self.receivers
        return ScoreTest.of(problem, point, self.normal, receivers, from_start=self.calibrated)


def recording_of_rows(recordings: Sequence[Poses]) -> Index:
    """Return the index of the recording from which each frame of concatenated recordings is.

    Parameters
    ----------
    recordings : sequence of Poses
        Recordings with T frames in total.

    Returns
    -------
    array of int, shape (T,)
        Index of the recording.

    """
    return np.repeat(np.arange(len(recordings)), [len(poses.frame) for poses in recordings])


def _pose_evenly(fit: HandFit, poses: Poses) -> tuple[Index, Problem, Point]:
    """Pose evenly spaced frames; return their indices, the problem and its solution.

    Sds of residuals are those of the momentary scatter, as a loose receiver inflates the fitted ones.
    """
    rows = np.unique(np.linspace(0, len(poses.frame) - 1, EVEN_FRAMES).round().astype(int))
    frames = fit.convention.frames(poses.take(rows))
    samples = fit.problem.temper * len(fit.problem.frames.valid)
    temper = min(1.0, samples / len(frames.valid))
    problem = replace(fit.problem, frames=frames, temper=temper)
    point = pose(problem, first_guess(problem, fit.model, fit.posterior.x), _POSING_STEPS)
    problem = replace(problem, sd=_momentary_sd(problem, residuals(problem, point)))
    return rows, problem, pose(problem, point, _POSING_STEPS)


def _momentary_sd(problem: Problem, current: Residuals) -> Array:
    """Return the sd (S, 2) of residuals from their differences over a lag, at most the problem's sd."""
    sd = problem.sd.copy()
    lag = max(1, len(problem.frames.valid) // 30)
    for s, r in problem.residuals_of(current):
        both = problem.frames.valid[lag:, s] & problem.frames.valid[:-lag, s]
        if both.any():
            squares = ((r[lag:] - r[:-lag])[both].reshape(-1, 2, 3) ** 2).sum(-1)
            scatter = np.sqrt(np.median(squares, axis=0) / _MEDIAN_OF_SQUARES / 2)
            sd[s] *= np.clip(scatter, 0.3, 1.0)
    return sd


def _uncover(
    problem: Problem, skinless: Problem, point: Point, model: HandModel, tested: Tested
) -> tuple[Point, list[Displacement]]:
    """Return a starting point with displaced receivers, if it is likelier than the one without any.

    Joint angles jump when a receiver comes loose, so that implausibly large skin motion in proportion to them
    can absorb the displacement and leave no residual. Displacements are therefore sought in `skinless`, the
    problem without skin motion.
    """
    start = pose(skinless, first_guess(skinless, model, np.zeros(len(point.x))), _POSING_STEPS)
    start = solve(skinless, start, _BARE_STEPS, NEARLY).point
    rivals = tested.scored(skinless, start).rivals()
    if not rivals:
        return point, []
    as_it_was = _refine(problem, point, tested, [], rivals)
    with_rivals = [_refine(problem, start, tested, [rival], rivals) for rival in rivals]
    _, point, displaced = min((as_it_was, *with_rivals), key=_cost)
    return point, displaced


def _search(
    problem: Problem, point: Point, displaced: list[Displacement], tested: Tested
) -> tuple[Point, list[Displacement]]:
    """Find all displacements of the tested receivers, each after correcting for the previous ones."""
    corrected = problem
    if displaced:
        corrected = replace(problem, frames=_certain(_put_back(problem.frames, displaced), displaced))
    for _ in range(MOST_MOVED if tested.calibrated else MOST_DISPLACEMENTS):
        rivals = tested.scored(corrected, point).rivals()
        if not rivals:
            break
        with_rivals = [
            _refine(problem, point, tested, _add_displacement(displaced, rival), rivals) for rival in rivals
        ]
        corrected, point, displaced = min(with_rivals, key=_cost)
        if max(np.linalg.norm(moved.step[:3]) for moved in displaced) > OFF_MM:
            break
    return point, displaced


def _cost(refined: tuple[Problem, Point, Sequence[Displacement]]) -> float:
    """Return the negative log posterior of a hand and its displacements."""
    problem, point, displaced = refined
    return residuals(problem, point).cost + sum(moved.cost for moved in displaced)


def _leave_out_explained(
    problem: Problem, tested: Tested, point: Point, displaced: list[Displacement]
) -> tuple[list[Displacement], Array]:
    """Drop displacements that later ones explain; return the others, and x after correcting for them."""
    for moved in displaced if len(displaced) > 1 else ():
        others = [other for other in displaced if other is not moved]
        corrected, start, refined = _refine(problem, point, tested, others)
        if tested.scored(corrected, start, [moved.receiver]).likeliest(moved.receiver) is None:
            return _leave_out_explained(problem, tested, start, refined)
    return displaced, point.x


def _refine(
    problem: Problem,
    point: Point,
    tested: Tested,
    displaced: Sequence[Displacement],
    rivals: Sequence[Displacement] = (),
) -> tuple[Problem, Point, list[Displacement]]:
    """Alternately estimate the hand and the displacements; return the corrected problem, point and both.

    rivals : alternatives with which the result is compared; uncertain frames of theirs are left out as well.
    """
    refined, corrected = list(displaced), problem
    for refinement in range(_REFINEMENTS + 1):
        if refinement:
            test = tested.scored(corrected, point, [moved.receiver for moved in refined])
            refined = [test.refined(moved) for moved in refined]
        frames = _certain(_put_back(problem.frames, refined), [*refined, *rivals])
        corrected = replace(problem, frames=frames)
        if tested.calibrated:
            point = pose(corrected, point, _POSING_STEPS)
        else:
            point = solve(corrected, point, _SOLVING_STEPS, NEARLY).point
    return corrected, point, refined


def _add_displacement(displaced: Sequence[Displacement], new: Displacement) -> list[Displacement]:
    """Add a displacement to the others, or merge it with one of the same receiver at about the same time."""
    for i, earlier in enumerate(displaced):
        later = max(abs(earlier.start - new.start), abs(earlier.end - new.end))
        if earlier.receiver == new.receiver and later <= _SAME_MOMENT:
            return [*displaced[:i], replace(earlier, step=earlier.step + new.step), *displaced[i + 1 :]]
    return [*displaced, new]


def _put_back(frames: Frames, displaced: Sequence[Displacement]) -> Frames:
    """Return the frames as they would have been measured had the receivers stayed in place."""
    rotation, position = frames.rotation.copy(), frames.position_mm.copy()
    for moved in displaced:
        s, step = moved.receiver, moved.share(len(rotation))[:, None] * moved.step
        rotation[:, s] = rotation[:, s] @ exp_rotation(-step[:, 3:])
        position[:, s] -= (rotation[:, s] @ step[:, :3, None])[..., 0]
    return Frames(rotation, position, frames.valid)


def _certain(frames: Frames, displaced: Sequence[Displacement]) -> Frames:
    """Mark displaced receivers as not valid in the few frames in which they may or may not have moved yet."""
    valid = frames.valid.copy()
    for moved in displaced:
        if not moved.slides:
            near = slice(max(0, moved.start - _UNSURE_FRAMES), moved.start + _UNSURE_FRAMES)
            valid[near, moved.receiver] = False
    return replace(frames, valid=valid)


def _exact_row(
    fit: HandFit,
    poses: Poses,
    rows: Index,
    problem: Problem,
    x: Array,
    displaced: Displacement,
    others: Sequence[Displacement],
) -> int:
    """Find the row from which a receiver is displaced; rows : (F,) indices of the even frames in poses."""
    first = rows[max(0, displaced.start - _SAME_MOMENT)]
    last = rows[min(len(rows) - 1, displaced.start + _SAME_MOMENT)]
    near = np.unique(np.linspace(first, last, _DENSE_FRAMES).round().astype(int))
    frames = fit.convention.frames(poses.take(near))
    before, costs = [], []
    for other in others:  # convert moments among the even frames to moments among the near ones
        moments = (np.interp(moment, np.arange(len(rows)), rows) for moment in (other.start, other.end))
        start, stop = np.searchsorted(near, [*moments])
        before.append(replace(other, start=int(start), end=int(stop)))
    for put_back in (before, [*before, replace(displaced, start=0, end=0)]):
        dense = replace(problem, frames=_put_back(frames, put_back))
        point = pose(dense, first_guess(dense, fit.model, x), _POSING_STEPS)
        costs.append(residuals(dense, point).frame_cost)
    # total cost, less a constant, if the displacement begins at each of these rows
    excess = np.concatenate([[0.0], np.cumsum(costs[0] - costs[1])])
    return int(near[min(int(np.argmin(excess)), len(near) - 1)])
