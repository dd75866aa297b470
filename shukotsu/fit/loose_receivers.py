"""Receivers that did not stay where they were put, and fields that were disturbed.

A receiver may come loose at once or slide slowly; beside metal all receivers are off that are near it. Every
receiver is tested for a displacement (`displacement_test`) and the room for metal (`field_test`). Where no
metal explains it better, the likeliest displacement is solved for together with the hand and put back, and so
on until nothing abnormal is left.

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
"""Evenly spaced over all recordings, several for each independent sample."""

MOST_DISPLACEMENTS, MOST_MOVED, OFF_MM = 8, 4, 60.0
"""Looked for in a calibration, and in a recording that is held against one; how far a receiver goes
on a bone: one beyond came off, and the search ends."""

NORMAL = {
    "phalanx": (1.0, float(np.radians(3.0))),
    "palm": (1.5, float(np.radians(3.0))),
    "metacarpal": (3.0, float(np.radians(10.0))),
}
"""mm and rad by which a receiver on a finger, on the back of the hand and on the thumb's metacarpal may sit
elsewhere for half of a recording, all of it skin: that over a phalanx slides a millimetre, that over the
tendons of the hand half as far again, and that over the thenar muscles bulges and stretches with every grip
and with whatever it rests on."""

SWALLOWED_SD = 4.5
"""Skin motion that is implausible for a hand, over published values: 3.4 is the most with twice the usual
skin artefact, 8.9 the least where the skin of the fit made up for a receiver that had come loose."""

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
    """A frame of one of several recordings, by number, and its time (or NaN)."""

    recording: int
    frame: int
    time_s: float


@dataclass(frozen=True)
class LooseReceiver:
    """A receiver displaced by step (6,), mm and rotation vector, from `start`, or evenly up to `end`."""

    segment: str
    start: Moment
    end: Moment
    step: Array

    @property
    def slid(self) -> bool:
        """Whether it went slowly."""
        return (self.end.recording, self.end.frame) != (self.start.recording, self.start.frame)

    @property
    def shift_mm(self) -> float:
        """Return how far its origin moved on the bone."""
        return float(np.linalg.norm(self.step[:3]))

    @property
    def turn_deg(self) -> float:
        """Return how far it turned."""
        return float(np.degrees(np.linalg.norm(self.step[3:])))


@dataclass(frozen=True)
class Displaced:
    """Receivers that came loose or slid, in order of time; or a disturbed field instead."""

    loose: Sequence[LooseReceiver] = ()
    field: Disturbance | None = None


def displaced_in(fit: HandFit, recordings: Sequence[Poses]) -> Displaced:
    """Find what was displaced in the recordings that a hand was fitted to (docs/whole-hand.md, section 11).

    A receiver that was put back elsewhere between two recordings counts as displaced at the first frame of
    the second. Only receivers on bones of known anatomy are tested: elsewhere skin motion would be taken for
    a loose receiver. Where the field is disturbed no receiver is reported, as the two cannot be separated.

    Parameters
    ----------
    fit : HandFit
        The hand.
    recordings : sequence of Poses
        What it was fitted to, in the order in which they were made.

    Returns
    -------
    Displaced
        Loose receivers in order of time, or a disturbed field.

    """
    poses = joined_poses(recordings)
    n_even = min(EVEN_FRAMES, len(poses.frame))
    rows = np.unique(np.linspace(0, len(poses.frame) - 1, n_even).round().astype(int))
    problem, point = _pose_frames(fit, fit.convention.frames(poses.take(rows)))
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
    """Find receivers that sit elsewhere in a recording than in the calibration, throughout or from a frame.

    The recording is compared with the fitted hand and its covariance. No receiver is reported where, after
    they are put back, a disturbed field explains the remaining residuals.

    Parameters
    ----------
    fit : HandFit
        The hand; its posterior is the prior here.
    poses : Poses
        Another recording of the same receivers.

    Returns
    -------
    list of LooseReceiver
        In order of time; empty in recordings of less than `MOMENTS` frames.

    """
    if len(poses.frame) < MOMENTS:
        return []
    rows = np.unique(np.linspace(0, len(poses.frame) - 1, EVEN_FRAMES).round().astype(int))
    problem, point = _pose_frames(fit, fit.convention.frames(poses.take(rows)))
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
    """Name displaced receivers and moments; rows : of poses, the even frames."""
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

    normal : (S, 2) mm and rad by which skin alone may displace each. calibrated : whether the hand is known
    from other recordings, in which case a receiver may have sat elsewhere throughout this one.
    """

    receivers: tuple[int, ...]
    normal: Array
    calibrated: bool = False

    @classmethod
    def of(cls, fit: SolvedFit) -> Tested:
        """Return those over bones of known anatomy."""
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
            The solution.
        only : sequence of int, optional
            Receivers to test; all of these if omitted.

        Returns
        -------
        ScoreTest
            Gains of all displacements.

        """
        receivers = only or self.receivers
        return ScoreTest.of(problem, point, self.normal, receivers, from_start=self.calibrated)


def recording_of_rows(recordings: Sequence[Poses]) -> Index:
    """Index of the recording that each frame is from, where all are put one after the other.

    Parameters
    ----------
    recordings : sequence of Poses
        Recordings of T frames in all.

    Returns
    -------
    array of int, shape (T,)
        Indices.

    """
    return np.repeat(np.arange(len(recordings)), [len(poses.frame) for poses in recordings])


def _pose_frames(fit: HandFit, frames: Frames) -> tuple[Problem, Point]:
    """Pose these frames, with residual sds from their scatter: a loose receiver inflates its fitted one."""
    samples = fit.problem.temper * len(fit.problem.frames.valid)
    temper = min(1.0, samples / len(frames.valid))
    problem = replace(fit.problem, frames=frames, temper=temper)
    point = pose(problem, first_guess(problem, fit.model, fit.posterior.x), _POSING_STEPS)
    problem = replace(problem, sd=_momentary_sd(problem, residuals(problem, point)))
    return problem, pose(problem, point, _POSING_STEPS)


def _momentary_sd(problem: Problem, current: Residuals) -> Array:
    """Sd (S, 2) of residuals from their differences, no larger than the problem's own."""
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
    """Return a start with displaced receivers in it, if that is likelier than a start without any.

    skinless : the problem without skin motion. Joint angles jump when a receiver comes loose, so that
    implausibly large skin motion in proportion to them can absorb the displacement and leave no residual.
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
    """All displacements of the tested receivers, each looked for with the earlier ones put back."""
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
    """Minus log posterior of a hand and its displacements."""
    problem, point, displaced = refined
    return residuals(problem, point).cost + sum(moved.cost for moved in displaced)


def _leave_out_explained(
    problem: Problem, tested: Tested, point: Point, displaced: list[Displacement]
) -> tuple[list[Displacement], Array]:
    """Drop displacements that later ones explain; return the others, and x with all receivers put back."""
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
    """Solve for the hand and these displacements by turns; return the corrected problem, point and them.

    rivals : displacements that are compared with these, and therefore by the same frames.
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
    """The displacements with another one added; a remainder of a known displacement is merged into it."""
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
    """Make displaced receivers not valid in the few frames in which they may or may not have moved yet."""
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
    """Find the first row from which a displaced receiver is likelier; rows : (F,) of the even frames."""
    first = rows[max(0, displaced.start - _SAME_MOMENT)]
    last = rows[min(len(rows) - 1, displaced.start + _SAME_MOMENT)]
    near = np.unique(np.linspace(first, last, min(_DENSE_FRAMES, int(last - first) + 1)).round().astype(int))
    frames = fit.convention.frames(poses.take(near))
    before, costs = [], []
    for other in others:  # of the even frames, among the near ones
        moments = (np.interp(moment, np.arange(len(rows)), rows) for moment in (other.start, other.end))
        start, stop = np.searchsorted(near, [*moments])
        before.append(replace(other, start=int(start), end=int(stop)))
    for put_back in (before, [*before, replace(displaced, start=0, end=0)]):
        dense = replace(problem, frames=_put_back(frames, put_back))
        point = pose(dense, first_guess(dense, fit.model, x), _POSING_STEPS)
        costs.append(residuals(dense, point).frame_cost)
    excess = np.concatenate([[0.0], np.cumsum(costs[0] - costs[1])])  # more with the receiver put back
    return int(near[min(int(np.argmin(excess)), len(near) - 1)])
