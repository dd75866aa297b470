"""Test whether a hand fits better if a receiver was displaced on its bone, at once or by sliding.

Rao's score test answers this to first order without a second fit: the six numbers of a displacement are added
as unknowns to the least squares, and the hand's unknowns, the joint angles and the roots are eliminated
(`Eliminated`). A displacement is therefore detected even if the fit has absorbed a part of it, whereas errors
that joint angles or neighbouring receivers explain equally well are no evidence. Neither is plausible skin
motion, which is an offset that recurs with a posture or fades within seconds.

On paper: docs/whole-hand.md, section 11.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular

from shukotsu.fit.compiled_equations import Jacobian, reduce, residuals
from shukotsu.fit.normal_equations import Point, Problem, Reduced
from shukotsu.fit.operations import Index
from shukotsu.hand.rotations import Array

MOMENTS = 40
"""Number of moments at which a displacement is tested; the exact frame is searched for afterwards."""

SHORTEST_STAY = 2
"""Least number of intervals between moments for which a receiver stays in place before and after a step."""

SHORTEST_SLIDE = 8
"""Least number of intervals that a slide takes; a faster one is a step. Slides begin and end at every
SLIDE_GRID-th moment."""
SLIDE_GRID = 4

MOMENT_GAIN = 1.5
"""Log likelihood by which a slide or a temporary offset must beat a step, as it has one more free moment."""

NORMAL_SD = (2.5, 3.0)
"""Offset between two halves of a recording (position, rotation) that is normal without a loose receiver, in
units of the sd of the receiver's momentary residuals: skin deviates from its law, and postures differ."""

SKIN_SHARE = 0.5
"""Sd of skin motion that recurs with a posture or fades, per component, over the normal offset of a
receiver."""

POSTURE_RAD = float(np.radians(25.0))
"""Difference of angles beyond which two postures move skin independently."""

SKIN_WAYS = 16
"""Number of principal components of skin motion that are kept; the others are small."""

LAG_FRAMES = 8.0
"""Time constant of skin, in evenly spaced frames; about two seconds."""

DISPLACEMENT_SD = (6.0, float(np.radians(10.0)))
"""Prior sd of the displacement of a loose receiver, mm and rad per component."""

LEAST_GAIN = 5.0
"""Log likelihood that a loose receiver must explain beyond a normal displacement; the largest value over
simulated hands without a loose receiver is 1.5."""

MOST_RIVALS, RIVAL_SHARE = 3, 0.4
"""Largest number of receivers that compete for a displacement, and the least gain of a rival relative to the
likeliest: first-order evidence alone does not decide between them."""

DISPLACEMENT_PRECISION = np.diag(np.repeat(DISPLACEMENT_SD, 3) ** -2.0)

_EDGE_STEPS, _LEAST_MORE = 12, 1e-12


@dataclass(frozen=True)
class Displacement:
    """A receiver's displacement, at frame `start` or growing evenly from `start` to `end`.

    step : (6,) translation, mm, and rotation vector, rad, in the receiver's frame.
    """

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
        """Negative log prior of the displacement, up to a constant."""
        return float(self.step @ DISPLACEMENT_PRECISION @ self.step) / 2

    def share(self, n_frames: int) -> Array:
        """Return the share of the displacement that is reached in every frame.

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
    """P possible time courses of a displacement over I intervals between moments.

    Attributes
    ----------
    share : array, shape (P, I)
        Share of the displacement in each interval.
    start, end : array of int, shape (P,)
        Moments between which it grows; of a temporary offset, its first moment and that after its last.
    returns : array of bool, shape (P,)
        Whether the receiver returns to its place.

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
        Whether a receiver may be displaced throughout, as is possible in a recording to which the hand was
        not fitted.

    Returns
    -------
    Courses
        Every course with the share of the displacement that is reached in each interval.

    """
    last, at = n_intervals - SHORTEST_STAY, np.arange(n_intervals)
    grid = range(0, n_intervals + 1, SLIDE_GRID)
    steps = [(k, k) for k in range(SHORTEST_STAY, last + 1)]
    if from_start:
        steps = [(0, 0), *steps]
    slides = [(a, b) for a in grid for b in grid if b - a >= SHORTEST_SLIDE]
    spells = [(a, b) for a in range(SHORTEST_STAY, last) for b in range(a + 1, last + 1)]
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
    """Evidence for displacements of S receivers on P time courses over I intervals.

    Attributes
    ----------
    cuts : array of int, shape (I,)
        Frame at which each interval begins.
    slope, curvature : array, shape (S, I, 6) and (S, 6 I, 6 I)
        Derivatives of the cost by a receiver's displacement in each interval.
    step : array, shape (S, P, 6)
        Best displacement on each course, mm and rad.
    gain : array, shape (S, P)
        Log posterior that it adds; 0 for receivers that were not tested.
    abnormal : array, shape (S, P)
        Part of the gain that no normal displacement explains; 0 for receivers that were not tested, and where
        the whole gain is at most `LEAST_GAIN`.
    ways : Courses
        The time courses.

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
            Problem as solved, and its solution.
        normal : array, shape (S, 2)
            Offset below which a receiver is not regarded as displaced, mm and rad.
        receivers : sequence of int
            Indices of the receivers to test.
        from_start : bool
            Whether a receiver may be displaced throughout the recording.

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
                of_s, by_s = _on_all_courses(slope[s], curvature[s], ways)
                step[s] = -np.linalg.solve(by_s + DISPLACEMENT_PRECISION, of_s[..., None])[..., 0]
                gain[s] = -(of_s * step[s]).sum(-1) / 2
                enough = gain[s] > LEAST_GAIN  # no displacement is more abnormal than it gains
                within = most_within(np.tile(radii[s], (enough.sum(), 1)), of_s[enough], by_s[enough])
                abnormal[s, enough] = gain[s, enough] - within
        return cls(cuts, slope, curvature, step, gain, abnormal, ways)

    def most_abnormal(self) -> float:
        """Return the log likelihood that the most abnormal displacement explains beyond a normal one."""
        return float(self._odds(None)[1].max(initial=0.0))

    def likeliest(self, receiver: int | None = None) -> Displacement | None:
        """Find the most abnormal displacement.

        Parameters
        ----------
        receiver : int, optional
            Receiver to consider; all of them if omitted.

        Returns
        -------
        Displacement or None
            None if no displacement is abnormal.

        """
        best, odds = self._odds(receiver)
        if not odds.any():
            return None
        p = int(np.argmax(odds))
        if self.abnormal[best[p], p] <= LEAST_GAIN:
            return None
        return self._displacement(int(best[p]), p)

    def _odds(self, receiver: int | None) -> tuple[Index, Array]:
        """Return a receiver (P,) for each course, and how abnormal (P,) its displacement would be.

        Unless `receiver` is specified, it is the one whose displacement explains most on the course, as it
        may also explain the residuals of its neighbours. Temporary offsets are taken as skin motion and have
        0.
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
        """Return the likeliest displacement and its alternatives that explain nearly as much.

        Alternatives are other receivers on the same course, and the same receiver sliding instead of coming
        loose at once or vice versa. Only fits that include them can decide: to first order, a turned receiver
        on the middle of a finger looks much like one on its tip that slid.
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
        """Re-estimate the extent of a displacement for which the frames were already corrected."""
        way = self.ways.share[[self._course(displaced)]]
        s = displaced.receiver
        slope, curvature = _on_courses(self.slope[s], self.curvature[s], way)
        rest = np.linalg.solve(
            curvature[0] + DISPLACEMENT_PRECISION, slope[0] + DISPLACEMENT_PRECISION @ displaced.step
        )
        return replace(displaced, step=displaced.step - rest)


def _skin(problem: Problem, point: Point, receivers: Sequence[int], sd: Array) -> Array:
    """Return R principal components of skin motion of a branch's n receivers, shape (F, n, R, 6).

    sd : (S, 2) of all components together, mm and rad. Half of the variance depends on the posture and recurs
    with it, half fades with time. The posture of a digit is its joint angles, that of the palm the angles at
    the digits' bases.
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
    """Return the slope (I, 6) and curvature (6 I, 6 I) of the cost by displacements in each interval.

    The result has an entry for each receiver of the branch. Skin motion, a combination of the components skin
    (F, n, R, 6), and the hand's unknowns are eliminated, so that they may explain a part.
    """
    n_frames, n, n_ways, _ = skin.shape
    n_skin, shape = 6 * n * n_ways, (n_frames, n, 6)
    by_x, slope = branch.by_x.reshape(*shape, -1), branch.slope.reshape(shape)
    of_skin = (branch.curvature.reshape(n_frames, 6 * n, n, 1, 6) * skin[:, None]).reshape(*shape, n_skin)
    pull = left.whitened(np.einsum("fiag,fira->irag", by_x, skin, optimize=True))
    inner = np.eye(n_skin) - pull.T @ pull
    inner += np.einsum("fira,fias->iras", skin, of_skin, optimize=True).reshape(n_skin, -1)
    rhs = np.einsum("fira,fia->ira", skin, slope, optimize=True).ravel() - pull.T @ left.gradient
    every = np.arange(len(cuts))
    interval = (np.searchsorted(cuts, np.arange(n_frames), "right") - 1 == every[:, None]).astype(float)
    blocks, pulls, slopes, at_cuts = (  # sums over the frames of each interval, as one product each
        np.tensordot(interval, values, 1)
        for values in (branch.curvature.reshape(*shape, n, 6), by_x, slope, of_skin)
    )
    with_x = left.whitened(pulls.swapaxes(0, 1))  # of each receiver, all intervals
    with_skin = at_cuts.swapaxes(0, 1).reshape(-1, n_skin) - with_x.T @ pull
    lower = np.linalg.cholesky(inner)
    taken = solve_triangular(lower, np.c_[with_skin.T, rhs], lower=True)
    by_receiver = {}
    for i, s in enumerate(branch.receivers):
        rows = slice(6 * len(cuts) * i, 6 * len(cuts) * (i + 1))
        by_s, by_x_s = taken[:, rows], with_x[:, rows]
        curvature = -(by_x_s.T @ by_x_s) - by_s.T @ by_s
        curvature.reshape(len(cuts), 6, len(cuts), 6)[every, :, every] += blocks[:, i, :, i]
        explained = by_x_s.T @ left.gradient + by_s.T @ taken[:, -1]
        by_receiver[s] = slopes[:, i] - explained.reshape(-1, 6), curvature
    return by_receiver


def _on_courses(slope: Array, curvature: Array, share: Array) -> tuple[Array, Array]:
    """Return slope (P, 6) and curvature (P, 6, 6) by displacements with shares (P, I) in the intervals."""
    n = share.shape[1]
    once = share @ curvature.reshape(n, -1)
    blocks = once.reshape(len(share), 6, n, 6)
    return share @ slope, np.einsum("paib,pi->pab", blocks, share, optimize=True)


def _on_all_courses(slope: Array, curvature: Array, ways: Courses) -> tuple[Array, Array]:
    """Return slope (P, 6) and curvature (P, 6, 6) by displacements on every course.

    Of steps and temporary offsets, by far the most, they are differences of sums over all intervals from a
    moment on: the curvature from a to b is C(a, a) - C(a, b) - C(b, a) + C(b, b).
    """
    n = len(slope)
    since = np.zeros((n + 1, n + 1, 6, 6))
    backwards = curvature.reshape(n, 6, n, 6).swapaxes(1, 2)[::-1, ::-1]
    since[:n, :n] = backwards.cumsum(0).cumsum(1)[::-1, ::-1]
    a, b = ways.start, np.where(ways.returns, ways.end, n)
    blocks = since[a, a] - since[a, b] - since[b, a] + since[b, b]
    slides = (ways.end > ways.start) & ~ways.returns
    blocks[slides] = _on_courses(slope, curvature, ways.share[slides])[1]
    return ways.share @ slope, blocks


def most_within(radii: Array, slope: Array, curvature: Array) -> Array:
    """Compute the largest gain of a step within an ellipsoid.

    The trust-region problem is solved by Newton steps on 1 / |z| (More & Sorensen 1983, SIAM J Sci Stat
    Comput 4:553). They start where one component alone reaches the edge and therefore never overshoot.

    Parameters
    ----------
    radii : array, shape (K, 6)
        Half axes of each ellipsoid, mm and rad.
    slope : array, shape (K, 6)
        Gain per step at its centre.
    curvature : array, shape (K, 6, 6)
        Decrease of that slope per step.

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

    Attributes
    ----------
    receivers : tuple of int
        Indices of the receivers.
    slope, curvature : array, shape (F, m) and (F, m, m)
        Derivatives of the cost in each frame, with its states and root eliminated.
    by_x : array, shape (F, m, G)
        Mixed derivatives by displacements and the hand's unknowns.
    root : array, shape (F, m, 6)
        Factor of root @ root^T, the curvature that the root absorbs and that is already subtracted.

    """

    receivers: tuple[int, ...]
    slope: Array
    curvature: Array
    by_x: Array
    root: Array


@dataclass(frozen=True)
class Eliminated:
    """All branches at a point, with the hand's unknowns still to be eliminated.

    Attributes
    ----------
    branches : tuple of EliminatedBranch
        Derivatives by displacements of each branch's receivers.
    lower : array, shape (G, G)
        Cholesky factor L of the unknowns' precision.
    gradient : array, shape (G,)
        Derivatives g of the cost by the unknowns, as L^-1 g.

    """

    branches: tuple[EliminatedBranch, ...]
    lower: Array
    gradient: Array

    def whitened(self, by_x: Array) -> Array:
        """Return L^-1 A^T (G, N) of derivatives A by the unknowns, (..., G) with N rows.

        The unknowns absorb (A L^-T) (A L^-T)^T of the curvature, since their covariance is (L L^T)^-1.
        """
        return np.asarray(solve_triangular(self.lower, by_x.reshape(-1, len(self.lower)).T, lower=True))

    @classmethod
    @lru_cache(maxsize=1)
    def of(cls, problem: Problem, point: Point) -> Eliminated:
        """Eliminate states, roots and the hand's unknowns at a point; cached, as two tests use one point.

        Parameters
        ----------
        problem : Problem
            Chains, measured frames and priors.
        point : Point
            Point at which it is linearised.

        Returns
        -------
        Eliminated
            Derivatives of the cost by displacements of every branch's receivers.

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
        lower = np.asarray(np.linalg.cholesky(reduced.matrix), float)
        return cls(tuple(branches), lower, solve_triangular(lower, reduced.gradient, lower=True))


def _left(reduced: Reduced, index: int, jacobian: Jacobian) -> tuple[Array, Array, Array, Array]:
    """Return a branch's residuals (F, m) with states and roots eliminated, and their derivatives.

    The derivatives are by states (F, m, s) and by roots (F, m, 6), both orthonormalised, and by x (F, m, G).
    """
    gone = reduced.eliminated[index]
    states = jacobian.by_states @ gone.inverse.swapaxes(-1, -2)
    of_branch = jacobian.by_unknowns - states @ gone.by_rest[..., 6:]
    root = (jacobian.by_root - states @ gone.by_rest[..., :6]) @ reduced.root_inverse.swapaxes(-1, -2)
    by_x = -root @ reduced.root_by_x
    by_x[..., gone.unknowns] += of_branch
    r = jacobian.r - (states @ gone.rhs[..., None])[..., 0] - (root @ reduced.root_rhs[..., None])[..., 0]
    return r, states, root, by_x
