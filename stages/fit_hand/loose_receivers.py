"""Receivers that came loose: whose place on the bone changed for good in the middle of a recording.

Every receiver is tested for a displacement (`displacement_test`), the likeliest one is solved for together
with the hand and put back, and so on until nothing abnormal is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from schemas.poses import Poses
from skeleton.rotations import Array
from stages.fit_hand.chain import HandModel
from stages.fit_hand.displacement_test import Displacement, ScoreTest
from stages.fit_hand.empirical_bayes import FAMILIES
from stages.fit_hand.fit import HandFit
from stages.fit_hand.normal_equations import Frames, Point, Problem, Residuals, exp_rotation, residuals
from stages.fit_hand.operations import Index
from stages.fit_hand.receiver_frames import concatenated
from stages.fit_hand.solving import NEARLY, first_guess, pose, solve

EVEN_FRAMES = 120
"""Evenly spaced over all recordings, several for each independent sample."""

MOST_DISPLACEMENTS = 8

SWALLOWED_SD = 4.5
"""A skin so far from what is published is no hand's: 3.4 is the most with twice the usual skin artefact,
8.9 the least where the skin of the fit made up for a receiver that had come loose."""

SKIN, STIFF = ("slide", "tilt", "joint slide"), 100.0
"""Families of unknowns that could, and the precision at which they cannot."""

_DENSE_FRAMES = 200
_BARE_STEPS = 10
_POSING_STEPS = 4
_SOLVING_STEPS = 10
_REFINEMENTS = 3
_SAME_MOMENT = 3
_UNSURE_FRAMES = 2
_MEDIAN_OF_SQUARES = 2.366
"""Of the sum of three squared standard normal variables."""


@dataclass(frozen=True)
class LooseReceiver:
    """A receiver that sits elsewhere on its bone from a moment on.

    recording : which of the recordings; frame : its frame number and time_s its time there (NaN where it has
    none), the first with the receiver elsewhere; of a slow slide, the middle of it or of a part. shift_mm :
    how far its origin moved on the bone; turn_deg : how far it turned.
    """

    segment: str
    recording: int
    frame: int
    time_s: float
    shift_mm: float
    turn_deg: float


def loose_receivers(fit: HandFit, recordings: Sequence[Poses]) -> list[LooseReceiver]:
    """Find the receivers that came loose during the recordings that a hand was fitted to, in order of time.

    recordings : those given to `fit_hand`, in the order in which they were made. A receiver that was put back
    elsewhere between two of them is found too, at the first frame of the second. What slides slowly is found
    as one or more steps. Only receivers on bones of known anatomy are tested: elsewhere the model has no
    skin, and what skin does would be called loose.
    """
    poses, recording = concatenated(recordings), _recording_of_rows(recordings)
    rows = np.unique(np.linspace(0, len(recording) - 1, min(EVEN_FRAMES, len(recording))).round().astype(int))
    problem, point = _posed(fit, fit.evidence.convention.frames(poses.take(rows)))
    model = fit.evidence.model
    tested = [s for s, name in enumerate(model.receivers) if name in model.mount]
    start: list[Displacement] = []
    skin = np.isin(model.unknowns.groups, [name for family in SKIN for name in FAMILIES[family]])
    if np.abs(point.x[skin]).max(initial=0.0) > SWALLOWED_SD:
        problem = replace(problem, precision=np.ones(len(problem.precision)))
        skinless = replace(problem, precision=np.where(skin, STIFF, 1.0))
        point, start = _uncovered(problem, skinless, point, model, tested)
    displaced, x = _needed(problem, *_search(problem, point, start, tested))
    loose = []
    for moved in displaced:
        others = [other for other in displaced if other is not moved]
        row = _exact_row(fit, poses, rows, replace(problem, temper=1.0), x, moved, others)
        loose.append(
            LooseReceiver(
                model.receivers[moved.receiver],
                int(recording[row]),
                int(poses.frame[row]),
                float(poses.time_s[row]),
                float(np.linalg.norm(moved.step[:3])),
                float(np.degrees(np.linalg.norm(moved.step[3:]))),
            )
        )
    return sorted(loose, key=lambda receiver: (receiver.recording, receiver.frame))


def without_loose(recordings: Sequence[Poses], loose: Sequence[LooseReceiver]) -> list[Poses]:
    """The recordings with each loose receiver valid only while it sat in one place: where it did longest."""
    recording = _recording_of_rows(recordings)
    valid = np.concatenate([poses.valid for poses in recordings])
    for segment in {receiver.segment for receiver in loose}:
        column = valid[:, recordings[0].index(segment)]
        cuts = sorted(
            int(np.flatnonzero(recording == receiver.recording)[0])
            + int(np.flatnonzero(recordings[receiver.recording].frame == receiver.frame)[0])
            for receiver in loose
            if receiver.segment == segment
        )
        part = np.searchsorted(cuts, np.arange(len(column)), side="right")
        column &= part == np.argmax(np.bincount(part[column], minlength=1))
    return [replace(poses, valid=valid[recording == r]) for r, poses in enumerate(recordings)]


def _recording_of_rows(recordings: Sequence[Poses]) -> Index:
    """Which recording each frame (T,) of all of them, one after the other, is of."""
    return np.repeat(np.arange(len(recordings)), [len(poses.frame) for poses in recordings])


def _posed(fit: HandFit, frames: Frames) -> tuple[Problem, Point]:
    """The problem on these frames, with residuals weighed as they scatter from moment to moment.

    A receiver that came loose made its residuals large, and the fit took that for their usual size; its
    differences over a second or so do not know of it.
    """
    evidence = fit.evidence
    samples = evidence.problem.temper * len(evidence.problem.frames.valid)
    temper = min(1.0, samples / len(frames.valid))
    problem = replace(evidence.problem, frames=frames, temper=temper)
    point = pose(problem, first_guess(problem, evidence.model, evidence.posterior.x), _POSING_STEPS)
    problem = replace(problem, sd=_momentary_sd(problem, residuals(problem, point)))
    return problem, pose(problem, point, _POSING_STEPS)


def _momentary_sd(problem: Problem, current: Residuals) -> Array:
    """Sd (S, 2) of residuals from their differences, no larger than the problem's own."""
    sd = problem.sd.copy()
    lag = max(1, len(problem.frames.valid) // 30)
    for receivers, (r, _, _) in zip(problem.receivers, current.branches, strict=True):
        for i, (_, s) in enumerate(receivers):
            both = problem.frames.valid[lag:, s] & problem.frames.valid[:-lag, s]
            if both.any():
                squares = ((r[i, lag:] - r[i, :-lag])[both].reshape(-1, 2, 3) ** 2).sum(-1)
                scatter = np.sqrt(np.median(squares, axis=0) / _MEDIAN_OF_SQUARES / 2)
                sd[s] *= np.clip(scatter, 0.3, 1.0)
    return sd


def _uncovered(
    problem: Problem, skinless: Problem, point: Point, model: HandModel, tested: Sequence[int]
) -> tuple[Point, list[Displacement]]:
    """Where to begin and what is displaced there, if that is likelier than nothing being displaced.

    skinless : the problem without skin, in which it is looked for. A fit can cover a loose receiver up: joint
    angles jump with it, as far as they must for skin in proportion to them to make up for it, and no residual
    is left to see. That takes a skin that nobody has.
    """
    start = pose(skinless, first_guess(skinless, model, np.zeros(len(point.x))), _POSING_STEPS)
    start = solve(skinless, start, _BARE_STEPS, NEARLY).point
    rivals = ScoreTest.of(skinless, start, tested).rivals()
    if not rivals:
        return point, []
    as_it_was = _refined(problem, point, [], rivals)
    with_rivals = [_refined(problem, start, [rival], rivals) for rival in rivals]
    _, point, displaced = min((as_it_was, *with_rivals), key=_cost)
    return point, displaced


def _search(
    problem: Problem, point: Point, displaced: list[Displacement], tested: Sequence[int]
) -> tuple[Point, list[Displacement]]:
    """All displacements of the tested receivers, each looked for with the earlier ones put back."""
    corrected = replace(problem, frames=_certain(_put_back(problem.frames, displaced), displaced))
    for _ in range(MOST_DISPLACEMENTS):
        rivals = ScoreTest.of(corrected, point, tested).rivals()
        if not rivals:
            break
        with_rivals = [_refined(problem, point, _added(displaced, rival), rivals) for rival in rivals]
        corrected, point, displaced = min(with_rivals, key=_cost)
    return point, displaced


def _cost(refined: tuple[Problem, Point, Sequence[Displacement]]) -> float:
    """Minus log posterior of a hand and its displacements."""
    problem, point, displaced = refined
    return residuals(problem, point).cost + sum(moved.cost for moved in displaced)


def _needed(
    problem: Problem, point: Point, displaced: list[Displacement]
) -> tuple[list[Displacement], Array]:
    """Leave out what later ones explain; give also x with all receivers put back."""
    for moved in displaced if len(displaced) > 1 else ():
        others = [other for other in displaced if other is not moved]
        corrected, start, refined = _refined(problem, point, others)
        if ScoreTest.of(corrected, start, [moved.receiver]).likeliest(moved.receiver) is None:
            return _needed(problem, start, refined)
    return displaced, point.x


def _refined(
    problem: Problem, point: Point, displaced: Sequence[Displacement], rivals: Sequence[Displacement] = ()
) -> tuple[Problem, Point, list[Displacement]]:
    """Solve for the hand and for these displacements; give the problem with the receivers put back, and both.

    rivals : displacements that are judged by the same frames.
    """
    refined = list(displaced)
    for is_last in [False] * _REFINEMENTS + [True]:
        frames = _certain(_put_back(problem.frames, refined), [*refined, *rivals])
        corrected = replace(problem, frames=frames)
        point = solve(corrected, point, _SOLVING_STEPS, NEARLY).point
        if not is_last:
            test = ScoreTest.of(corrected, point, [moved.receiver for moved in refined])
            refined = [test.refined(moved) for moved in refined]
    return corrected, point, refined


def _added(displaced: Sequence[Displacement], new: Displacement) -> list[Displacement]:
    """The displacements and one more; what is left of one that was already known is added to it."""
    for i, known in enumerate(displaced):
        if known.receiver == new.receiver and abs(known.at - new.at) <= _SAME_MOMENT:
            return [*displaced[:i], replace(known, step=known.step + new.step), *displaced[i + 1 :]]
    return [*displaced, new]


def _put_back(frames: Frames, displaced: Sequence[Displacement]) -> Frames:
    """The frames as they were measured had the receivers stayed in their places."""
    rotation, position = frames.rotation.copy(), frames.position_mm.copy()
    for moved in displaced:
        rows, s = slice(moved.at, None), moved.receiver
        rotation[rows, s] = rotation[rows, s] @ exp_rotation(-moved.step[3:])
        position[rows, s] -= rotation[rows, s] @ moved.step[:3]
    return Frames(rotation, position, frames.valid)


def _certain(frames: Frames, displaced: Sequence[Displacement]) -> Frames:
    """The frames without the displaced receivers where it is not certain whether they had moved yet."""
    valid = frames.valid.copy()
    for moved in displaced:
        valid[max(0, moved.at - _UNSURE_FRAMES) : moved.at + _UNSURE_FRAMES, moved.receiver] = False
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
    """The first row of poses at which the receiver is rather displaced than not, all else being known.

    rows : (F,) the even frames, in which `at` of displacements counts.
    """
    first = rows[max(0, displaced.at - _SAME_MOMENT)]
    last = rows[min(len(rows) - 1, displaced.at + _SAME_MOMENT)]
    near = np.unique(np.linspace(first, last, min(_DENSE_FRAMES, int(last - first) + 1)).round().astype(int))
    frames = fit.evidence.convention.frames(poses.take(near))
    before = [replace(other, at=int(np.searchsorted(near, rows[other.at]))) for other in others]
    costs = []
    for put_back in (before, [*before, replace(displaced, at=0)]):
        dense = replace(problem, frames=_put_back(frames, put_back))
        point = pose(dense, first_guess(dense, fit.evidence.model, x), _POSING_STEPS)
        costs.append(residuals(dense, point).frame_cost)
    excess = np.concatenate([[0.0], np.cumsum(costs[0] - costs[1])])  # more with the receiver put back
    return int(near[min(int(np.argmin(excess)), len(near) - 1)])
