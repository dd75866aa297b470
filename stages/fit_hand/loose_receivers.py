"""Receivers that came loose: whose place on the bone changed for good in the middle of a recording.

Every receiver is asked in turn whether the hand fits better if, from some moment on, the receiver sits
elsewhere on its bone. To first order the answer needs no second fit: the six numbers of such a change are six
more unknowns of the same least squares, from which the hand's own unknowns, the joint angles and the roots
are eliminated (Rao's score test). So what the fit has already bent to the change counts for it, and what
joint angles or neighbours can explain as well does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array
from schemas.poses import Poses
from stages.fit_hand.chain import HandModel
from stages.fit_hand.empirical_bayes import FAMILIES
from stages.fit_hand.fit import HandFit
from stages.fit_hand.normal_equations import (
    Frames,
    Point,
    Problem,
    Reduced,
    Residuals,
    exp_rotation,
    reduce,
    residuals,
    weighted_jacobian,
)
from stages.fit_hand.posing import first_guess, pose
from stages.fit_hand.recordings import Convention, joined
from stages.fit_hand.solving import NEARLY, solve

Index = npt.NDArray[np.int64]

EVEN_FRAMES = 120
"""Evenly spaced over all recordings, several for each independent sample."""

MOMENTS = 40
"""At so many of them a receiver may have come loose; the exact frame is then looked for."""

SHORTEST = 2
"""Intervals between moments that a receiver must have sat in its first and in its second place."""

NORMAL_CHANGE_SD = (2.5, 3.0)
LEAST_NORMAL_CHANGE = (0.5, float(np.radians(1.5)))
"""In units of the sd of a receiver's momentary residuals, and at least so many mm and rad: half a recording
may differ so much from the other half without anything being loose, as skin does not quite follow its law and
the postures are others."""

CHANGE_SD = (6.0, float(np.radians(10.0)))
"""mm and rad per component, of a receiver that came loose."""

LEAST_GAIN = 7.0
"""Log likelihood that a loose receiver must explain beyond a normal change; 6.0 is the most in 40 simulated
hands with nothing loose, half of them with twice the usual skin artefact."""

MOST_CHANGES = 8
MOST_RIVALS, RIVAL_SHARE = 3, 0.4
"""Receivers of which one is loose, by what their changes explain to first order."""

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
_PRIOR = np.diag(np.repeat(CHANGE_SD, 3) ** -2.0)
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


@dataclass(frozen=True)
class _Change:
    """Receiver s is displaced by step (6,), mm and rad in its own frame, from even frame `at` on."""

    s: int
    at: int
    step: Array


def loose_receivers(fit: HandFit, recordings: Sequence[Poses]) -> list[LooseReceiver]:
    """Find the receivers that came loose during the recordings that a hand was fitted to, in order of time.

    recordings : those given to `fit_hand`, in the order in which they were made. A receiver that was put back
    elsewhere between two of them is found too, at the first frame of the second. What slides slowly is found
    as one or more steps. Only receivers on bones of known anatomy are asked: elsewhere the model has no skin,
    and what skin does would be called loose.
    """
    every = _Rows.of(recordings)
    rows = np.unique(np.linspace(0, len(every.row) - 1, min(EVEN_FRAMES, len(every.row))).round().astype(int))
    problem, point = _posed(fit, every.frames(fit.evidence.convention, rows))
    model = fit.evidence.model
    asked = [s for s, name in enumerate(model.receivers) if name in model.mount]
    begun: list[_Change] = []
    skin = np.isin(model.unknowns.groups, [name for family in SKIN for name in FAMILIES[family]])
    if np.abs(point.x[skin]).max(initial=0.0) > SWALLOWED_SD:
        problem = replace(problem, precision=np.ones(len(problem.precision)))
        bare = replace(problem, precision=np.where(skin, STIFF, 1.0))
        point, begun = _disgorged(problem, bare, point, model, asked)
    changes, x = _needed(problem, *_found(problem, point, begun, asked))
    loose = []
    for change in changes:
        others = [other for other in changes if other is not change]
        row = _exact_row(fit, every, rows, replace(problem, temper=1.0), x, change, others)
        poses = recordings[every.recording[row]]
        loose.append(
            LooseReceiver(
                model.receivers[change.s],
                int(every.recording[row]),
                int(poses.frame[every.row[row]]),
                float(poses.time_s[every.row[row]]),
                float(np.linalg.norm(change.step[:3])),
                float(np.degrees(np.linalg.norm(change.step[3:]))),
            )
        )
    return sorted(loose, key=lambda one: (one.recording, one.frame))


def without_loose(recordings: Sequence[Poses], found: Sequence[LooseReceiver]) -> list[Poses]:
    """The recordings with each loose receiver valid only while it sat in one place: where it did longest."""
    every = _Rows.of(recordings)
    valid = [poses.valid.copy() for poses in recordings]
    for segment in {one.segment for one in found}:
        columns = [
            own[:, poses.index(segment)] if segment in poses.segments else np.zeros(len(own), bool)
            for own, poses in zip(valid, recordings, strict=True)
        ]
        cuts = sorted(every.at(one) for one in found if one.segment == segment)
        part = np.searchsorted(cuts, np.arange(len(every.row)), side="right")
        longest = np.argmax(np.bincount(part[np.concatenate(columns)], minlength=1))
        for r, column in enumerate(columns):
            column &= part[every.recording == r] == longest
    return [replace(poses, valid=own) for poses, own in zip(recordings, valid, strict=True)]


@dataclass(frozen=True)
class _Rows:
    """All frames of several recordings one after the other: recording (T,) and row in it (T,)."""

    recordings: Sequence[Poses]
    recording: Index
    row: Index

    @classmethod
    def of(cls, recordings: Sequence[Poses]) -> _Rows:
        lengths = [len(poses.frame) for poses in recordings]
        recording = np.repeat(np.arange(len(lengths)), lengths)
        return cls(recordings, recording, np.concatenate([np.arange(length) for length in lengths]))

    def frames(self, convention: Convention, rows: Index) -> Frames:
        """Some of all frames, as they are fitted."""
        parts = [
            convention.frames(poses.take(self.row[rows[self.recording[rows] == r]]))
            for r, poses in enumerate(self.recordings)
        ]
        return joined(parts)

    def at(self, one: LooseReceiver) -> int:
        """Index among all frames of the moment when a receiver came loose."""
        row = int(np.flatnonzero(self.recordings[one.recording].frame == one.frame)[0])
        return int(np.flatnonzero(self.recording == one.recording)[0]) + row


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


def _momentary_sd(problem: Problem, found: Residuals) -> Array:
    """Sd (S, 2) of residuals from their differences, no larger than the problem's own."""
    sd = problem.sd.copy()
    lag = max(1, len(problem.frames.valid) // 30)
    for receivers, (r, _, _) in zip(problem.receivers, found.branches, strict=True):
        for i, (_, s) in enumerate(receivers):
            both = problem.frames.valid[lag:, s] & problem.frames.valid[:-lag, s]
            if both.any():
                squares = ((r[i, lag:] - r[i, :-lag])[both].reshape(-1, 2, 3) ** 2).sum(-1)
                scatter = np.sqrt(np.median(squares, axis=0) / _MEDIAN_OF_SQUARES / 2)
                sd[s] *= np.clip(scatter, 0.3, 1.0)
    return sd


def _disgorged(
    problem: Problem, bare: Problem, point: Point, model: HandModel, asked: Sequence[int]
) -> tuple[Point, list[_Change]]:
    """Where to begin and what is loose there, if that is likelier than nothing being loose.

    bare : the problem without skin, in which it is looked for.

    A fit can swallow a loose receiver: joint angles jump with it, as far as they must for skin in proportion
    to them to make up for it, and no residual is left to see. That takes a skin that nobody has.
    """
    start = pose(bare, first_guess(bare, model, np.zeros(len(point.x))), _POSING_STEPS)
    start = solve(bare, start, _BARE_STEPS, NEARLY).point
    rivals = _Changes.of(bare, start, asked).rivals()
    if not rivals:
        return point, []
    as_it_was = _refined(problem, point, [], rivals)
    tried = [_refined(problem, start, [rival], rivals) for rival in rivals]
    _, point, changes = min((as_it_was, *tried), key=_cost)
    return point, changes


def _found(
    problem: Problem, point: Point, begun: list[_Change], asked: Sequence[int]
) -> tuple[Point, list[_Change]]:
    """All changes of the receivers asked, each looked for with those put back that were found before it."""
    changes = begun
    here = replace(problem, frames=_sure(_put_back(problem.frames, changes), changes))
    for _ in range(MOST_CHANGES):
        rivals = _Changes.of(here, point, asked).rivals()
        if not rivals:
            break
        tried = [_refined(problem, point, _with(changes, rival), rivals) for rival in rivals]
        here, point, changes = min(tried, key=_cost)
    return point, changes


def _cost(tried: tuple[Problem, Point, Sequence[_Change]]) -> float:
    """Minus log posterior of a hand and its changes."""
    problem, point, changes = tried
    return residuals(problem, point).cost + sum(float(one.step @ _PRIOR @ one.step) / 2 for one in changes)


def _needed(problem: Problem, point: Point, changes: list[_Change]) -> tuple[list[_Change], Array]:
    """Leave out what those found later explain; give also x with all receivers put back."""
    for change in changes if len(changes) > 1 else ():
        others = [other for other in changes if other is not change]
        here, start, refined = _refined(problem, point, others)
        if _Changes.of(here, start, [change.s]).likeliest(change.s) is None:
            return _needed(problem, start, refined)
    return changes, point.x


def _refined(
    problem: Problem, point: Point, changes: Sequence[_Change], rivals: Sequence[_Change] = ()
) -> tuple[Problem, Point, list[_Change]]:
    """Solve for the hand and for these changes; give the problem with the receivers put back, and both.

    rivals : changes that are judged by the same frames.
    """
    refined = list(changes)
    for last in [False] * _REFINEMENTS + [True]:
        here = replace(problem, frames=_sure(_put_back(problem.frames, refined), [*refined, *rivals]))
        point = solve(here, point, _SOLVING_STEPS, NEARLY).point
        if not last:
            slopes = _Changes.of(here, point, [one.s for one in refined])
            refined = [slopes.farther(one) for one in refined]
    return here, point, refined


@dataclass(frozen=True)
class _Changes:
    """Slope (S, K, 6) and curvature (S, K, 6, 6) of the cost by a change of receiver s from `at` (K,) on.

    gain : (S, K) log posterior that the best change, step (S, K, 6), adds. radii : (S, 6) of a normal one.
    """

    at: Index
    slope: Array
    curvature: Array
    step: Array
    gain: Array
    radii: Array

    @classmethod
    def of(cls, problem: Problem, point: Point, asked: Sequence[int]) -> _Changes:
        """Ask some of the receivers; the others gain nothing."""
        found = residuals(problem, point)
        reduced = reduce(problem, point, found, np.zeros(len(point.y)))
        cuts = np.unique(np.linspace(0, len(point.y), MOMENTS + 1).round().astype(int))[:-1]
        slope = np.zeros((len(problem.sd), len(cuts) - 1, 6))
        curvature = np.zeros((*slope.shape, 6))
        for index, receivers in enumerate(problem.receivers):
            own = [(i, s) for i, (_, s) in enumerate(receivers) if s in asked]
            if not own:
                continue
            projected = _Projected.of(problem, index, point, found, reduced)
            for i, s in own:
                slope[s], curvature[s] = projected.of_changes(problem, i, s, cuts, reduced)
        long = slice(SHORTEST - 1, len(cuts) - SHORTEST)
        slope, curvature = slope[:, long], curvature[:, long]
        radii = np.maximum(NORMAL_CHANGE_SD * problem.sd, LEAST_NORMAL_CHANGE).repeat(3, axis=1)
        step = np.asarray(-np.linalg.solve(curvature + _PRIOR, slope[..., None])[..., 0], float)
        return cls(cuts[1:][long], slope, curvature, step, -(slope * step).sum(-1) / 2, radii)

    def likeliest(self, s: int | None = None) -> _Change | None:
        """The change (of receiver s alone, where given) that is most abnormal; None where none is.

        What one receiver's large change explains may be the small one of its neighbour: at each moment only
        the receiver whose change explains most is a candidate.
        """
        moments = np.arange(len(self.at))
        best = np.argmax(self.gain, axis=0) if s is None else np.full(len(self.at), s)
        abnormal = self.gain[best, moments] - _most_within(
            self.radii[best], self.slope[best, moments], self.curvature[best, moments]
        )
        if not len(moments) or abnormal.max() <= LEAST_GAIN:
            return None
        k = int(np.argmax(abnormal))
        return _Change(int(best[k]), int(self.at[k]), self.step[best[k], k])

    def rivals(self) -> list[_Change]:
        """The likeliest change and those of other receivers, at the same moment, that explain nearly as much.

        Which of them it is, only the fits with them can tell: to first order a turned receiver on the middle
        of a finger is much like one on its tip that slid.
        """
        first = self.likeliest()
        if first is None:
            return []
        k = int(np.searchsorted(self.at, first.at))
        near = np.argsort(-self.gain[:, k])[:MOST_RIVALS]
        return [
            _Change(int(s), first.at, self.step[s, k])
            for s in near
            if self.gain[s, k] >= RIVAL_SHARE * self.gain[first.s, k]
        ]

    def farther(self, change: _Change) -> _Change:
        """A change that is already known, gone as far as is likeliest."""
        k = int(np.searchsorted(self.at, change.at))
        slope = self.slope[change.s, k] + _PRIOR @ change.step
        return replace(
            change, step=change.step - np.linalg.solve(self.curvature[change.s, k] + _PRIOR, slope)
        )


@dataclass(frozen=True)
class _Projected:
    """One branch's residuals with every frame's states and root eliminated, and their derivatives.

    r : (F, m). by_x : (F, m, G). by_states, by_root : (F, m, .) whose squares are the leverage of the frame's
    own unknowns. weight : (receivers, F) robust.
    """

    r: Array
    by_x: Array
    by_states: Array
    by_root: Array
    weight: Array

    @classmethod
    def of(cls, problem: Problem, index: int, point: Point, found: Residuals, reduced: Reduced) -> _Projected:
        part, branch, gone = found.branches[index], problem.branches[index], reduced.eliminated[index]
        r, by_operation, by_root = weighted_jacobian(problem, index, part, point)
        states = by_operation @ branch.per_state(point.x) @ gone.inverse.swapaxes(-1, -2)
        own = branch.by_unknown(by_operation, point.y) - states @ gone.by_rest[..., 6:]
        root = (by_root - states @ gone.by_rest[..., :6]) @ reduced.root_inverse.swapaxes(-1, -2)
        by_x = -root @ reduced.root_by_x
        by_x[..., branch.unknowns] += own
        r = r - (states @ gone.rhs[..., None])[..., 0] - (root @ reduced.root_rhs[..., None])[..., 0]
        return cls(r, by_x, states, root, part[1])

    def of_changes(
        self, problem: Problem, i: int, s: int, cuts: Index, reduced: Reduced
    ) -> tuple[Array, Array]:
        """Slope (K, 6) and curvature (K, 6, 6) of the cost by a change of receiver s, the branch's i-th, from
        each cut but the first on; the hand's unknowns eliminated.
        """
        rows = slice(6 * i, 6 * i + 6)
        seen = np.sqrt(problem.temper * self.weight[i] * problem.frames.valid[:, s])
        scale = seen[:, None] / np.repeat(problem.sd[s], 3)
        states, root = self.by_states[:, rows], self.by_root[:, rows]
        free = np.eye(6) - states @ states.swapaxes(-1, -2) - root @ root.swapaxes(-1, -2)
        slope = _from_each(cuts, scale * self.r[:, rows])
        curvature = _from_each(cuts, scale[:, :, None] * free * scale[:, None, :])
        with_x = _from_each(cuts, scale[:, :, None] * self.by_x[:, rows])
        flat = with_x.reshape(-1, with_x.shape[-1])
        solved = np.linalg.solve(reduced.matrix, np.concatenate([flat, reduced.gradient[None]]).T).T
        slope = slope - with_x @ solved[-1]
        return slope, curvature - with_x @ solved[:-1].reshape(with_x.shape).swapaxes(-1, -2)


def _from_each(cuts: Index, of_frames: Array) -> Array:
    """Sums over the frames from each cut but the first to the end."""
    return np.asarray(np.cumsum(np.add.reduceat(of_frames, cuts, axis=0)[::-1], 0)[::-1][1:])


def _most_within(radii: Array, slope: Array, curvature: Array) -> Array:
    """Most (K,) that a change within an ellipsoid of these radii (K, 6) gains; trust region, by bisection."""
    values, vectors = np.linalg.eigh(radii[:, :, None] * curvature * radii[:, None])
    values = np.maximum(values, 0.0)
    b = (vectors.swapaxes(-1, -2) @ (radii * slope)[..., None])[..., 0]
    low, high = np.zeros(len(b)), np.linalg.norm(b, axis=-1) + 1e-9
    for _ in range(50):
        middle = (low + high) / 2
        outside = ((b / (values + middle[:, None])) ** 2).sum(-1) > 1
        low, high = np.where(outside, middle, low), np.where(outside, high, middle)
    z = b / (values + high[:, None])
    return np.asarray((b * z - values * z**2 / 2).sum(-1))


def _with(changes: Sequence[_Change], found: _Change) -> list[_Change]:
    """The changes and one more; what is left of a change that was already found is added to it."""
    for i, known in enumerate(changes):
        if known.s == found.s and abs(known.at - found.at) <= _SAME_MOMENT:
            return [*changes[:i], replace(known, step=known.step + found.step), *changes[i + 1 :]]
    return [*changes, found]


def _put_back(frames: Frames, changes: Sequence[_Change]) -> Frames:
    """The frames as they were measured had the receivers stayed in their places."""
    rotation, position = frames.rotation.copy(), frames.position_mm.copy()
    for change in changes:
        rows = slice(change.at, None)
        rotation[rows, change.s] = rotation[rows, change.s] @ exp_rotation(-change.step[3:])
        position[rows, change.s] -= rotation[rows, change.s] @ change.step[:3]
    return Frames(rotation, position, frames.valid)


def _sure(frames: Frames, changes: Sequence[_Change]) -> Frames:
    """The frames without the changed receivers where it is not sure yet whether they had changed."""
    valid = frames.valid.copy()
    for change in changes:
        valid[max(0, change.at - _UNSURE_FRAMES) : change.at + _UNSURE_FRAMES, change.s] = False
    return replace(frames, valid=valid)


def _exact_row(
    fit: HandFit,
    every: _Rows,
    rows: Index,
    problem: Problem,
    x: Array,
    change: _Change,
    others: Sequence[_Change],
) -> int:
    """The first of all frames at which the receiver is rather displaced than not, all else being known."""
    first, last = rows[max(0, change.at - _SAME_MOMENT)], rows[min(len(rows) - 1, change.at + _SAME_MOMENT)]
    near = np.unique(np.linspace(first, last, min(_DENSE_FRAMES, int(last - first) + 1)).round().astype(int))
    frames = every.frames(fit.evidence.convention, near)
    begun = [replace(o, at=int(np.searchsorted(near, rows[o.at]))) for o in others]
    costs = []
    for changes in (begun, [*begun, replace(change, at=0)]):
        dense = replace(problem, frames=_put_back(frames, changes))
        point = pose(dense, first_guess(dense, fit.evidence.model, x), _POSING_STEPS)
        costs.append(residuals(dense, point).frame_cost)
    before = np.concatenate([[0.0], np.cumsum(costs[0] - costs[1])])  # more with the receiver put back
    return int(near[min(int(np.argmin(before)), len(near) - 1)])
