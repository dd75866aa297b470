"""Test whether a hand fits better if a receiver sits elsewhere on its bone: from a moment on, or ever farther
off.

To first order the answer needs no second fit (Rao's score test): the six numbers of such a displacement are
six more unknowns of the same least squares, from which the hand's own unknowns, the joint angles and the
roots are eliminated (`Eliminated`). So the part of a displacement that the fit has already absorbed counts as
evidence, and what joint angles or neighbours can explain as well does not. Nor does plausible skin motion:
an offset that belongs to a posture and returns with it, or that fades within seconds.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from shukotsu.fit.compiled_equations import Jacobian, reduce, residuals
from shukotsu.fit.normal_equations import Point, Problem, Reduced
from shukotsu.fit.operations import Index
from shukotsu.hand.rotations import Array

MOMENTS = 40
"""Number of moments at which a receiver may have come loose; the exact frame is then searched for."""

SHORTEST = 2
"""Intervals between moments that a receiver must have sat in its first and in its second place."""

SLOWEST = 8
"""Intervals at least that a receiver slides for; what is faster is a step. Slides begin and end at every
SLIDE_GRID-th moment."""
SLIDE_GRID = 4

MOMENT_GAIN = 1.5
"""Log likelihood by which a slide, or what comes back, must beat a step: it has one more moment to choose."""

NORMAL_SD = (2.5, 3.0)
"""In units of the sd of a receiver's momentary residuals: half a recording may differ so much from the other
half without anything being loose, as skin does not quite follow its law and the postures are others."""

SKIN_SHARE = 0.5
"""Sd of what skin does in a posture or for a while, per component, over what half a recording may differ."""

POSTURE_RAD = float(np.radians(25.0))
"""Difference of angles beyond which two postures move skin independently."""

SKIN_WAYS = 16
"""Components of skin motion that are kept; the others are small."""

LAG_FRAMES = 8.0
"""Evenly spaced frames, about two seconds: the time constant of skin."""

DISPLACEMENT_SD = (6.0, float(np.radians(10.0)))
"""mm and rad per component, of a receiver that came loose."""

LEAST_GAIN = 5.0
"""Log likelihood that a loose receiver must explain beyond a normal displacement; 1.5 is the most in
simulated hands with nothing loose."""

MOST_RIVALS, RIVAL_SHARE = 3, 0.4
"""First-order evidence for a displacement of each receiver."""

DISPLACEMENT_PRECISION = np.diag(np.repeat(DISPLACEMENT_SD, 3) ** -2.0)

_EDGE_STEPS, _LEAST_MORE = 12, 1e-12


@dataclass(frozen=True)
class Displacement:
    """Receiver displaced by step (6,), mm and rad in its own frame, from `start`, or evenly up to `end`."""

    receiver: int
    start: int
    end: int
    step: Array

    @property
    def slides(self) -> bool:
        """Whether the receiver slid."""
        return self.end > self.start

    @property
    def cost(self) -> float:
        """Minus its log prior."""
        return float(self.step @ DISPLACEMENT_PRECISION @ self.step) / 2

    def share(self, n_frames: int) -> Array:
        """Share of the displacement that is reached in every frame.

        Parameters
        ----------
        n_frames : int
            Number of frames F.

        Returns
        -------
        array, shape (F,)
            0 before the displacement, 1 after it.

        """
        gone = np.arange(n_frames) + 1.0 - self.start
        return np.asarray(np.clip(gone / max(1, self.end - self.start), 0.0, 1.0))


@dataclass(frozen=True)
class Courses:
    """Time courses of a displacement: P of them over I intervals between moments.

    share : (P, I) of the displacement in each interval. start, end : (P,) moments between which it grows.
    returns : (P,) whether the receiver comes back.
    """

    share: Array
    start: Index
    end: Index
    returns: npt.NDArray[np.bool_]


@cache
def courses(n_intervals: int, *, from_start: bool = False) -> Courses:
    """List all steps, slides and temporary offsets that a recording may have.

    Parameters
    ----------
    n_intervals : int
        Number of intervals that the recording is cut into.
    from_start : bool
        Whether a receiver may have sat elsewhere throughout, as in a recording that its hand was not fitted
        to.

    Returns
    -------
    Courses
        Every course with the share of the displacement that is reached in each interval.

    """
    last, at = n_intervals - SHORTEST, np.arange(n_intervals)
    grid = range(0, n_intervals + 1, SLIDE_GRID)
    steps = [(k, k) for k in range(SHORTEST, last + 1)]
    if from_start:
        steps = [(0, 0), *steps]
    slides = [(a, b) for a in grid for b in grid if b - a >= SLOWEST]
    spells = [(a, b) for a in range(SHORTEST, last) for b in range(a + 1, last + 1)]
    share = [
        *((at >= a).astype(float) for a, _ in steps),
        *(np.clip((at + 0.5 - a) / (b - a), 0.0, 1.0) for a, b in slides),
        *(((at >= a) & (at < b)).astype(float) for a, b in spells),
    ]
    start, end = np.array([*steps, *slides, *spells], int).reshape(-1, 2).T
    returns = np.arange(len(share)) >= len(steps) + len(slides)
    return Courses(np.array(share).reshape(-1, n_intervals), start, end, returns)


@dataclass(frozen=True)
class ScoreTest:
    """Slope (S, I, 6) and curvature (S, 6 I, 6 I) of the cost by a receiver's displacement in each interval
    from `cuts` (I,).

    gain : (S, P) log posterior that the best displacement, step (S, P, 6), adds on each course. abnormal :
    (S, P) the part of the gain that a normal displacement does not reach, 0 where the whole gain is at most
    `LEAST_GAIN`. Both are 0 for receivers that are not tested.
    """

    cuts: Index
    slope: Array
    curvature: Array
    step: Array
    gain: Array
    abnormal: Array
    ways: Courses

    @classmethod
    def of(
        cls,
        problem: Problem,
        point: Point,
        normal: Array,
        receivers: Sequence[int],
        *,
        from_start: bool = False,
    ) -> ScoreTest:
        """Test receivers for displacement on every course (a score test; docs/whole-hand.md, section 11).

        Parameters
        ----------
        problem, point
            What was solved, and where.
        normal : array, shape (S, 2)
            Offset in mm and rad below which a receiver does not count as displaced.
        receivers : sequence of int
            Numbers of those tested.
        from_start : bool
            Whether a receiver may have sat elsewhere throughout the recording.

        """
        cuts = np.unique(np.linspace(0, len(point.y), MOMENTS + 1).round().astype(int))[:-1]
        n_receivers, ways = len(problem.sd), courses(len(cuts), from_start=from_start)
        slope = np.zeros((n_receivers, len(cuts), 6))
        curvature = np.zeros((n_receivers, 6 * len(cuts), 6 * len(cuts)))
        step = np.zeros((n_receivers, len(ways.start), 6))
        gain, abnormal = np.zeros(step.shape[:2]), np.zeros(step.shape[:2])
        radii = np.maximum(NORMAL_SD * problem.sd, normal).repeat(3, axis=1)
        left = Eliminated.of(problem, point)
        for branch in left.branches:
            tested = [s for s in branch.receivers if s in receivers]
            if tested:
                skin = _skin(problem, point, branch.receivers, SKIN_SHARE * normal)
                for s, (of_s, by_s) in _by_interval(left, branch, skin, cuts).items():
                    slope[s], curvature[s] = of_s, by_s
            for s in tested:
                of_s, by_s = _on_courses(slope[s], curvature[s], ways.share)
                step[s] = -np.linalg.solve(by_s + DISPLACEMENT_PRECISION, of_s[..., None])[..., 0]
                gain[s] = -(of_s * step[s]).sum(-1) / 2
                enough = gain[s] > LEAST_GAIN  # no displacement is more abnormal than it gains
                within = most_within(np.tile(radii[s], (enough.sum(), 1)), of_s[enough], by_s[enough])
                abnormal[s, enough] = gain[s, enough] - within
        return cls(cuts, slope, curvature, step, gain, abnormal, ways)

    def most_abnormal(self) -> float:
        """Log likelihood that the most abnormal displacement explains beyond a normal one, or 0."""
        return float(self._odds(None)[1].max(initial=0.0))

    def likeliest(self, receiver: int | None = None) -> Displacement | None:
        """Find the most abnormal displacement.

        Parameters
        ----------
        receiver : int, optional
            The only receiver to look at; all of them if omitted.

        Returns
        -------
        Displacement or None
            None where none is abnormal.

        """
        best, odds = self._odds(receiver)
        if not odds.any():
            return None
        p = int(np.argmax(odds))
        if self.abnormal[best[p], p] <= LEAST_GAIN:
            return None
        return self._displacement(int(best[p]), p)

    def _odds(self, receiver: int | None) -> tuple[Index, Array]:
        """The likeliest receiver (P,) on each course, or the one given, and how abnormal (P,) it would be.

        On each course only the receiver whose displacement explains most is a candidate, as neighbours may
        explain the others. Reversible offsets count as skin motion and are no candidates.
        """
        ways = self.ways
        every = np.arange(len(ways.start))
        best = np.argmax(self.gain, axis=0) if receiver is None else np.full(len(every), receiver)
        odds = np.maximum(self.abnormal - np.where(ways.end > ways.start, MOMENT_GAIN, 0.0), 0.0)
        returning = np.where(ways.returns, odds, 0.0).max(1, initial=0.0)
        odds_of_best = odds[best, every]
        return best, np.where(~ways.returns & (odds_of_best > returning[best]), odds_of_best, 0.0)

    def _displacement(self, receiver: int, course: int) -> Displacement:
        ways, moments = self.ways, np.append(self.cuts, self.cuts[-1] * 2 - self.cuts[-2])
        start, end = moments[ways.start[course]], moments[ways.end[course]]
        return Displacement(receiver, int(start), int(end), self.step[receiver, course])

    def rivals(self) -> list[Displacement]:
        """The likeliest displacement, the same receiver's if it came loose at once rather than slid or the
        other way round, and those of other receivers on the same course that explain nearly as much.

        Only fits that include them can decide between these: to first order, a turned receiver on the middle
        of a finger looks much like one on its tip that slid.
        """
        first = self.likeliest()
        if first is None:
            return []
        p, s = self._course(first), first.receiver
        ways = self.ways
        otherwise = ~ways.returns & ((ways.end > ways.start) != first.slides)
        k = int(np.argmax(np.where(otherwise, self.gain[s], -np.inf)))
        tried = [(int(other), p) for other in np.argsort(-self.gain[:, p])[:MOST_RIVALS]]
        if otherwise[k]:
            tried.append((s, k))
        least = RIVAL_SHARE * self.gain[s, p]
        return [self._displacement(other, way) for other, way in tried if self.gain[other, way] >= least]

    def _course(self, displaced: Displacement) -> int:
        ways = self.ways
        start, end = np.searchsorted(self.cuts, [displaced.start, displaced.end])
        return int(np.flatnonzero((ways.start == start) & (ways.end == end) & ~ways.returns)[0])

    def refined(self, displaced: Displacement) -> Displacement:
        """A displacement that frames were already corrected for, with its most likely extent."""
        way = self.ways.share[[self._course(displaced)]]
        s = displaced.receiver
        slope, curvature = _on_courses(self.slope[s], self.curvature[s], way)
        rest = np.linalg.solve(
            curvature[0] + DISPLACEMENT_PRECISION, slope[0] + DISPLACEMENT_PRECISION @ displaced.step
        )
        return replace(displaced, step=displaced.step - rest)


def _skin(problem: Problem, point: Point, receivers: Sequence[int], sd: Array) -> Array:
    """Principal components (F, n, R, 6) of skin motion of a branch's n receivers, scaled to unit variance.

    sd : (S, 2) of all components together, mm and rad. Half of the variance belongs to the posture and
    returns with it, half fades with time. The posture of a digit is its joint angles, that of the palm the
    angles at the digits' bases.
    """
    states = next(
        branch.states
        for branch, worn in zip(problem.branches, problem.receivers, strict=True)
        if receivers[0] in [s for _, s in worn]
    )
    bases = [branch.states[0] for branch in problem.branches if len(branch.states)]
    posture = point.y[:, states if len(states) else bases]
    apart = ((posture[:, None] - posture[None]) ** 2).sum(-1) / POSTURE_RAD**2
    frame = np.arange(len(posture))
    fading = np.exp(-np.abs(frame[:, None] - frame[None]) / LAG_FRAMES)
    values, ways = np.linalg.eigh((np.exp(-apart / 2) + fading) / 2)
    ways = (ways * np.sqrt(np.maximum(values, 0.0)))[:, -SKIN_WAYS:]
    return np.asarray(ways[:, None, :, None] * np.repeat(sd[list(receivers)], 3, axis=1)[:, None])


def _by_interval(
    left: Eliminated, branch: EliminatedBranch, skin: Array, cuts: Index
) -> dict[int, tuple[Array, Array]]:
    """Slope (I, 6) and curvature (6 I, 6 I) by a displacement of each receiver of a branch in each interval,
    when skin (F, n, R, 6) may take any part of it, and the hand's unknowns theirs.
    """
    n_frames, n, n_ways, _ = skin.shape
    n_skin, shape = 6 * n * n_ways, (n_frames, n, 6)
    by_x, slope = branch.by_x.reshape(*shape, -1), branch.slope.reshape(shape)
    of_skin = (branch.curvature.reshape(n_frames, 6 * n, n, 1, 6) * skin[:, None]).reshape(*shape, n_skin)
    pull = np.einsum("fiag,fira->gira", by_x, skin, optimize=True).reshape(-1, n_skin)
    x_by_skin, x = left.covariance @ pull, left.covariance @ left.gradient
    inner = np.eye(n_skin) - pull.T @ x_by_skin
    inner += np.einsum("fira,fias->iras", skin, of_skin, optimize=True).reshape(n_skin, -1)
    rhs = np.einsum("fira,fia->ira", skin, slope, optimize=True).ravel() - pull.T @ x
    every = np.arange(len(cuts))
    interval = (np.searchsorted(cuts, np.arange(n_frames), "right") - 1 == every[:, None]).astype(float)
    blocks, pulls, slopes, at_cuts = (  # sums over the frames of each interval, as one product each
        np.tensordot(interval, values, 1)
        for values in (branch.curvature.reshape(*shape, n, 6), by_x, slope, of_skin)
    )
    slopes -= pulls @ x
    at_cuts -= np.tensordot(pulls, x_by_skin, 1)
    with_skin = [at_cuts[:, i].reshape(-1, n_skin) for i in range(n)]
    taken = np.linalg.solve(inner, np.concatenate([*with_skin, rhs[None]]).T)
    by_receiver = {}
    for i, s in enumerate(branch.receivers):
        with_x, by_s = pulls[:, i].reshape(6 * len(cuts), -1), taken[:, :-1].reshape(n_skin, n, -1)[:, i]
        curvature = -with_x @ (left.covariance @ with_x.T) - with_skin[i] @ by_s
        curvature.reshape(len(cuts), 6, len(cuts), 6)[every, :, every] += blocks[:, i, :, i]
        by_receiver[s] = slopes[:, i] - (with_skin[i] @ taken[:, -1]).reshape(-1, 6), curvature
    return by_receiver


def _on_courses(slope: Array, curvature: Array, share: Array) -> tuple[Array, Array]:
    """Slope (P, 6) and curvature (P, 6, 6) by a displacement that goes its share (P, I) in each interval."""
    n = share.shape[1]
    once = share @ curvature.reshape(n, -1)
    blocks = once.reshape(len(share), 6, n, 6)
    return share @ slope, np.einsum("paib,pi->pab", blocks, share, optimize=True)


def most_within(radii: Array, slope: Array, curvature: Array) -> Array:
    """Compute the most that a step within an ellipsoid gains.

    Trust region, by Newton's steps on 1 / |z| from where one component alone is at the edge (More & Sorensen
    1983, SIAM J Sci Stat Comput 4:553): they never go too far.

    Parameters
    ----------
    radii : array, shape (K, 6)
        Half axes of each ellipsoid, mm and rad.
    slope : array, shape (K, 6)
        Gain per step at its centre.
    curvature : array, shape (K, 6, 6)
        By how much the slope falls per step.

    Returns
    -------
    array, shape (K,)
        Gain of the best step in each.

    """
    values, vectors = np.linalg.eigh(radii[:, :, None] * curvature * radii[:, None])
    values = np.maximum(values, 0.0)
    b = (vectors.swapaxes(-1, -2) @ (radii * slope)[..., None])[..., 0]
    more = np.maximum(np.abs(b) - values, _LEAST_MORE).max(-1, keepdims=True)
    for _ in range(_EDGE_STEPS):
        z = b / (values + more)
        length = np.linalg.norm(z, axis=-1, keepdims=True)
        slope_there = (z**2 / (values + more)).sum(-1, keepdims=True)
        more += np.where(length > 1.0, (length - 1.0) * length**2 / np.maximum(slope_there, _LEAST_MORE), 0.0)
    z = b / (values + more)
    return np.asarray((b * z - values * z**2 / 2).sum(-1))


@dataclass(frozen=True)
class EliminatedBranch:
    """Cost to second order in displacements of a branch's n receivers in their own frames, m = 6 n.

    receivers : their numbers. slope (F, m), curvature (F, m, m) : of the cost in each frame, with its states
    and root eliminated; by_x (F, m, G) : mixed derivatives by displacements and the hand's unknowns. root
    (F, m, 6) : the curvature that the root has absorbed is root @ root^T, already subtracted.
    """

    receivers: tuple[int, ...]
    slope: Array
    curvature: Array
    by_x: Array
    root: Array


@dataclass(frozen=True)
class Eliminated:
    """Every branch at a point; covariance (G, G) of the unknowns, gradient (G,) of the cost by them."""

    branches: tuple[EliminatedBranch, ...]
    covariance: Array
    gradient: Array

    @classmethod
    def of(cls, problem: Problem, point: Point) -> Eliminated:
        """Eliminate states, roots and the hand's unknowns at a point.

        Parameters
        ----------
        problem : Problem
            What is fitted to what.
        point : Point
            Where it is linearised.

        Returns
        -------
        Eliminated
            Weighted residuals of every branch, and what is left of them when all unknowns follow.

        """
        steps, branches = reduce(problem, point), []
        reduced = steps.frames_first()
        parts = zip(residuals(problem, point).branches, steps.jacobians(), strict=True)
        for index, (part, jacobian) in enumerate(parts):
            r, states, root, by_x = _left(reduced, index, jacobian)
            receivers = tuple(s for _, s in problem.receivers[index])
            seen = np.sqrt(problem.temper * part.weight.T * problem.frames.valid[:, receivers])  # (F, n)
            scale = (seen[..., None] / problem.sd[receivers, :].repeat(3, axis=1)).reshape(r.shape)
            free = np.eye(r.shape[1]) - states @ states.swapaxes(-1, -2) - root @ root.swapaxes(-1, -2)
            branches.append(
                EliminatedBranch(
                    receivers,
                    scale * r,
                    scale[:, :, None] * free * scale[:, None, :],
                    scale[..., None] * by_x,
                    scale[..., None] * root,
                )
            )
        return cls(tuple(branches), np.asarray(np.linalg.inv(reduced.matrix)), reduced.gradient)


def _left(reduced: Reduced, index: int, jacobian: Jacobian) -> tuple[Array, Array, Array, Array]:
    """A branch's residuals (F, m) and their derivatives by x (F, m, G), states and roots eliminated; between
    them orthonormal derivatives by states (F, m, s) and roots (F, m, 6).
    """
    gone = reduced.eliminated[index]
    states = jacobian.by_states @ gone.inverse.swapaxes(-1, -2)
    of_branch = jacobian.by_unknowns - states @ gone.by_rest[..., 6:]
    root = (jacobian.by_root - states @ gone.by_rest[..., :6]) @ reduced.root_inverse.swapaxes(-1, -2)
    by_x = -root @ reduced.root_by_x
    by_x[..., gone.unknowns] += of_branch
    r = jacobian.r - (states @ gone.rhs[..., None])[..., 0] - (root @ reduced.root_rhs[..., None])[..., 0]
    return r, states, root, by_x
