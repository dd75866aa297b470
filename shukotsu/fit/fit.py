"""Maximum a posteriori fit of a whole hand to its calibration recordings, with Laplace's covariance.

The sizes of residuals, misplacements and skin motion in this hand are scales of the priors that are estimated
from the data. A scale is such that the unknowns of its group are as large as their prior says, as far as the
data determine them (fixed point of the evidence; MacKay 1992). Scales are weakly regularised towards
published values, so that a hand whose skin hardly moves, or a tracker with hardly any noise, is recognised as
such.

On paper: docs/whole-hand.md, sections 5 and 7.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shukotsu.arrays import Float
from shukotsu.errors import InputError, count_of
from shukotsu.fit.chain import UNMODELLED, HandModel, hand_model
from shukotsu.fit.compiled_equations import Jacobian, pose, reduce, residuals
from shukotsu.fit.free_joints import free_joints
from shukotsu.fit.gauss_newton import CLOSE, NEARLY, Solution, first_guess, solve
from shukotsu.fit.measurements import Measurement, breadth, observations, planes, side_by_side
from shukotsu.fit.normal_equations import (
    FieldDistortion,
    Frames,
    Observations,
    Point,
    Problem,
    Reduced,
    Residuals,
)
from shukotsu.fit.posterior import Posterior, SolvedFit
from shukotsu.fit.posterior_summary import FittedBone, FittedJoint, HandSummary, summarise
from shukotsu.fit.receiver_frames import Convention, neighbours, postures, spread_frames
from shukotsu.hand.average_hand import AVERAGE_LENGTH_MM, DIGITS, PRIOR, DigitAnatomy
from shukotsu.hand.known_digits import known_digits, root_of
from shukotsu.hand.neutral_bones import faces_nail
from shukotsu.hand.rotations import Array, exp_rotation
from shukotsu.hand.series import effective_samples
from shukotsu.study.layout import Layout
from shukotsu.tables.poses import Poses, joined_poses

FAMILIES: Mapping[str, tuple[str, ...]] = {
    "mount": ("mount",),
    "mount turn": ("mount turn",),
    "slide": ("slide x", "slide y", "slide z"),
    "tilt": ("tilt x", "tilt y", "tilt z"),
    "joint slide": ("joint slide",),
}
"""Groups of unknowns that share a scale; the sizes of bones and joints are left as published."""

PSEUDO_UNKNOWNS = 2.0
PSEUDO_RESIDUALS = 0.2
"""Weight of the published scales, in equivalent numbers of determined unknowns and of residuals. Two unknowns
correspond to a scale whose logarithm has an sd of a half between people."""

RESIDUAL_SD = (0.5, float(np.radians(0.6)))
"""Published sd of a receiver's position (mm) and rotation (rad), per component: tracker, field, and skin
motion that does not follow the joint angles (even two LIBERTY sensors on a rigid bar differ by 0.3 to 0.55 mm
and 0.3 to 0.45 deg)."""

LEAST_SAMPLES = 5.0
_LEAST_SEEN, _NO_MOTION = 5, 1e-12

PSEUDO_TURNS = 100.0
"""Weight with which the scale of a receiver's position residuals enters that of its rotation residuals, in
equivalent residuals: both grow together, and joints with three axes leave hardly any rotation unexplained."""

SD_LIMITS = (0.02, 6.0)
"""Limits of a receiver's residual sd relative to the published one; the lower one, 0.01 mm, is less than any
tracker's noise."""


def prior_precision(
    groups: Sequence[str], x: Float[Array, " G"], covariance: Float[Array, "G G"], before: Float[Array, " G"]
) -> Float[Array, " G"]:
    """Estimate the scale of each family's prior (MacKay's fixed point; docs/whole-hand.md, section 5).

    Parameters
    ----------
    groups : sequence of str
        Group of each unknown.
    x : array, shape (G,)
        Solution, in units of the published sd.
    covariance : array, shape (G, G)
        Covariance of x.
    before : array, shape (G,)
        Prior precision with which x was solved.

    Returns
    -------
    array, shape (G,)
        Precision of each unknown's prior; 1 is the published value, which groups outside FAMILIES keep.

    """
    group = np.array(groups)
    precision = np.ones(len(group))
    for members in FAMILIES.values():
        of_family = np.isin(group, members)
        if of_family.any():
            squares = float((x[of_family] ** 2).sum())
            determined = float((1.0 - np.diag(covariance)[of_family] * before[of_family]).sum())
            precision[of_family] = (determined + PSEUDO_UNKNOWNS) / (squares + PSEUDO_UNKNOWNS)
    return precision


def independent_samples(problem: Problem, current: Residuals) -> float:
    """Estimate the number of independent samples from the autocorrelation of residuals (section 5).

    Parameters
    ----------
    problem : Problem
        Problem with evenly spaced frames in order of time.
    current : Residuals
        Residuals of these frames once they are posed.

    Returns
    -------
    float
        25th percentile over receivers, in position and in rotation; at least LEAST_SAMPLES.

    """
    counts = []
    for s, r in problem.residuals_of(current):
        seen = r[problem.frames.valid[:, s]]
        for part in (seen[:, :3], seen[:, 3:]) if len(seen) >= _LEAST_SEEN else ():
            variance = float(part.var(0).sum())
            if variance > _NO_MOTION:
                counts.append(effective_samples(part, variance, len(part)))
    return max(LEAST_SAMPLES, float(np.percentile(counts, 25))) if counts else LEAST_SAMPLES


def residual_sd(
    problem: Problem, current: Residuals, jacobians: Sequence[Jacobian], reduced: Reduced
) -> Array:
    """Estimate the sd of every receiver's residuals (docs/whole-hand.md, section 5).

    The sum of squares is divided by the degrees of freedom left by the frames' states and roots, which are
    one minus leverage for each residual.

    Parameters
    ----------
    problem : Problem
        Problem as solved.
    current : Residuals
        Residuals at the solution.
    jacobians : sequence of Jacobian
        Derivatives of every branch at the solution.
    reduced : Reduced
        Normal equations at the solution, undamped.

    Returns
    -------
    array, shape (S, 2)
        Sd, mm and rad per component; the published sd for receivers that were never valid.

    """
    out = np.array([RESIDUAL_SD] * len(problem.sd))
    for index, ((r, weight, _), jacobian) in enumerate(zip(current.branches, jacobians, strict=True)):
        eliminated = reduced.eliminated[index]
        states = jacobian.by_states @ eliminated.inverse.swapaxes(-1, -2)
        rest = jacobian.by_root - states @ eliminated.by_rest[..., :6]
        leverage = (states**2).sum(-1) + ((rest @ reduced.root_inverse.swapaxes(-1, -2)) ** 2).sum(-1)
        for i, (_, s) in enumerate(problem.receivers[index]):
            ok = problem.frames.valid[:, s]
            if not ok.any():
                continue
            expected, pseudo = 1.0, PSEUDO_RESIDUALS  # share of the published variance, and its weight
            for kind in (0, 1):  # position, then rotation
                rows = slice(3 * kind, 3 * kind + 3)
                squares = float((weight[i, :, None] * r[i, :, rows] ** 2)[ok].sum())
                squares *= (problem.sd[s, kind] / RESIDUAL_SD[kind]) ** 2
                left = max(0.0, float((1 - leverage.reshape(len(ok), -1, 6)[:, i, rows])[ok].sum()))
                share = (squares + pseudo * expected) / (left + pseudo)
                out[s, kind] = RESIDUAL_SD[kind] * np.clip(np.sqrt(share), *SD_LIMITS)
                expected, pseudo = share, PSEUDO_TURNS
    return out


INDEPENDENT_SAMPLES = 30.0
"""Number of independent samples assumed at first: a calibration of half a minute, in which skin motion is
correlated over about half a second."""

LEAST_CANDIDATES = 0.5
"""Least share of the frames (of those in which half of the receivers are valid) among which frames are
chosen, those with most receivers first. A smaller share would cover few moments and postures if receivers
drop out in turn."""

LEAST_LEFT, MOST_WHOLE = 0.25, 0.9
"""A receiver that is lost for good after a share of the frames between these limits ends the part that is
fitted: only frames before its loss are used."""

EVEN_FRAMES = 300
"""Number of evenly spaced frames from which the autocorrelation of residuals is estimated."""

SIDE_SD = 0.0025
"""Sd of the difference between left and right, relative: lengths differ by less than 0.5 %
(Buryanov & Kotiuk 2010)."""

_POSING_STEPS, _BOOTSTRAP_STEPS = 4, 8
NO_PRECISION = 1e-9
"""Precision of a prior that has been replaced."""


@dataclass(frozen=True)
class FitSettings:
    """Numbers of frames to fit, of steps per solution at most, and of rounds that estimate the scales."""

    n_frames: int = 100
    most_steps: int = 25
    rounds: int = 4


@dataclass(frozen=True)
class HandFit(SolvedFit):
    """A fitted hand.

    residual_rms : root mean square residual of every receiver, mm and deg per component; NaN if never valid.
    """

    residual_rms: Mapping[str, tuple[float, float]]

    @cached_property
    def summary(self) -> HandSummary:
        """Centres of all joints, and zero and axes of their angles."""
        return summarise(self)

    @property
    def joints(self) -> Mapping[str, FittedJoint]:
        """Joints between two receivers, by name."""
        return self.summary.joints

    @cached_property
    def bones(self) -> Mapping[str, FittedBone]:
        """Lengths of the bones, by segment."""
        lengths = self.model.length.items()
        return {segment: FittedBone(*self.posterior.of_amount(length)) for segment, length in lengths}

    @property
    def side(self) -> str:
        """Side of the hand, right or left."""
        return "left" if self.convention.left else "right"

    def moved_to(self, x: Array, covariance: Array) -> HandFit:
        """Replace the mean and covariance of the hand's unknowns.

        Parameters
        ----------
        x : array, shape (G,)
            Mean.
        covariance : array, shape (G, G)
            Covariance.

        Returns
        -------
        HandFit
            The same hand with that posterior.

        """
        return replace(self, posterior=self.posterior.moved_to(x, covariance))


def fit_hand(
    recordings: Sequence[Poses],
    layout: Layout,
    hand: str,
    *,
    hand_length_mm: float | None = None,
    hand_breadth_mm: float | None = None,
    measurements: Sequence[Measurement] = (),
    settings: FitSettings | None = None,
) -> HandFit:
    """Fit a hand to its calibration recordings, all at once (docs/whole-hand.md, sections 5 to 7).

    Parameters
    ----------
    recordings : sequence of Poses
        Recordings of the same receivers, each in its transmitter frame. A receiver that is never valid is
        ignored.
    layout : Layout
        Segments, joints and digits; digits of known anatomy have a prior.
    hand : str
        right or left.
    hand_length_mm, hand_breadth_mm : float, optional
        Length from the wrist crease to the middle finger's tip, and breadth across the knuckles.
    measurements : sequence of Measurement
        Lengths measured on the hand.
    settings : FitSettings, optional
        Number of frames and rounds.

    Returns
    -------
    HandFit
        The solved fit; its `summary` has joint centres (mm, in their receivers' frames), axes and bones, each
        with its 1-sigma error.

    Raises
    ------
    InputError
        If fewer than two frames have half of the receivers, or a measurement names an unknown quantity.

    """
    settings = settings or FitSettings()
    worn = {name for poses in recordings for name in np.array(poses.segments)[poses.valid.any(0)].tolist()}
    worn |= {*layout.expected}  # optional receivers are included only if they were worn
    root = root_of(layout)
    receivers = [root, *(name for name in layout.measured if name != root and name in worn)]
    convention = Convention.of(layout, receivers, hand)
    everything = convention.frames(joined_poses(recordings))
    frames, share = _choose_frames(everything, layout, convention.receivers, settings.n_frames)
    scale = (1.0, PRIOR.SCALE_SD)
    if hand_length_mm is not None:
        scale = hand_length_mm / AVERAGE_LENGTH_MM, PRIOR.SCALE_SD_BY_LENGTH
    model = _model(layout, convention, everything, frames, scale)
    field = FieldDistortion.among(model.unknowns, frames.position_mm[frames.valid])
    measured = observations(model, measurements).plus(planes(model, layout, convention, frames))
    measured = measured.plus(breadth(model, hand_breadth_mm))
    problem = problem_of(model, frames, measured, field)
    problem, solution = _solve_scales(problem, model, everything, settings)
    seen = {model.receivers[i] for i in np.flatnonzero(frames.valid.any(0))}
    bones = {name for digit in known_digits(layout) for name in digit.segments}
    if settings.rounds and any(name not in seen and layout.segments[name].measured for name in bones):
        point = without_noise_bias(problem, solution.point)
        solution = replace(solution, point=point, residuals=residuals(problem, point))
    posterior = Posterior.of(problem, solution.point, reduce(problem, solution.point).frames_first(), share)
    return HandFit(
        layout,
        model,
        convention,
        problem,
        posterior,
        alone=posterior,
        share=share,
        states=solution.point.y,
        converged=solution.converged,
        residual_rms=_residual_rms(problem, solution, model),
    )


def _model(
    layout: Layout, convention: Convention, everything: Frames, frames: Frames, scale: tuple[float, float]
) -> HandModel:
    """Lay out the chains of this layout, with the receivers and free joints that the recordings show."""
    receivers, root = convention.receivers, root_of(layout)
    seen = [receivers[i] for i in np.flatnonzero(np.any(everything.valid, axis=0))]
    of_digits = [joint for digit in known_digits(layout) for joint in digit.joints]
    free = free_joints(layout, root, of_digits, frames, receivers)
    wrist_mm = np.zeros(3)
    if layout.wrist is not None:
        wrist_mm = convention.point_matrix(root).T @ (layout.wrist.point_mm or layout.wrist.nominal_mm)
    anatomy = _anatomy(layout, everything, receivers)
    return hand_model(layout, receivers, seen, wrist_mm, free, scale, anatomy)


def _anatomy(layout: Layout, everything: Frames, receivers: Sequence[str]) -> Mapping[str, DigitAnatomy]:
    """Return the digits' anatomy, with the thumb's metacarpal facing as its receiver shows."""
    thumb = next((digit for digit in known_digits(layout) if digit.name == "thumb"), None)
    if thumb is None or not set(thumb.segments[:2]) <= set(receivers):
        return DIGITS
    metacarpal, proximal = (receivers.index(segment) for segment in thumb.segments[:2])
    both = everything.valid[:, metacarpal] & everything.valid[:, proximal]
    seen = everything.rotation[both, metacarpal].swapaxes(-1, -2) @ everything.rotation[both, proximal]
    nail = replace(DIGITS["thumb"], faces_nail=True)
    rests = [frames[0].T @ frames[1] for frames in (nail.frames(), DIGITS["thumb"].frames())]
    return {**DIGITS, "thumb": nail} if faces_nail(seen, *rests) else DIGITS


def problem_of(
    model: HandModel, frames: Frames, measured: Observations, field: FieldDistortion | None = None
) -> Problem:
    """Set up the problem with all scales as published.

    Parameters
    ----------
    model : HandModel
        Chains of the hand.
    frames : Frames
        Frames to fit.
    measured : Observations
        Linear observations of the unknowns.
    field : FieldDistortion, optional
        Distortion of the magnetic field, if it is fitted.

    Returns
    -------
    Problem
        The problem.

    """
    return Problem(
        branches=model.branches,
        receivers=tuple(branch.receivers(model.receivers) for branch in model.branches),
        frames=frames,
        sd=np.array([RESIDUAL_SD] * len(model.receivers)),
        temper=min(1.0, INDEPENDENT_SAMPLES / len(frames.valid)),
        state_mean=np.array(model.states.mean),
        state_sd=model.states.sd_over(INDEPENDENT_SAMPLES),
        precision=np.ones(len(model.unknowns.names)),
        observations=measured,
        state_link=model.states.link(),
        field=field,
    )


def _solve_scales(
    problem: Problem, model: HandModel, everything: Frames, settings: FitSettings
) -> tuple[Problem, Solution]:
    """Alternate between solving and estimating the scales; return the last problem and solution."""
    measured, average = problem.observations, np.zeros(len(problem.precision))
    start = pose(problem, first_guess(problem, model, average), _POSING_STEPS)
    closeness = [NEARLY] * settings.rounds + [CLOSE]
    solution = solve(problem, start, settings.most_steps, closeness[0])
    if settings.rounds:
        step = max(1, len(everything.valid) // EVEN_FRAMES)
        even = replace(problem, frames=everything.take(slice(None, None, step)))
        posed = pose(even, first_guess(even, model, solution.point.x), _POSING_STEPS)
        samples = independent_samples(even, residuals(even, posed))
        problem = replace(problem, temper=min(1.0, samples / len(problem.frames.valid)))
    for close in closeness[1:]:
        point, steps = solution.point, reduce(problem, solution.point)
        reduced = steps.frames_first()
        covariance = np.asarray(np.linalg.inv(reduced.matrix), float)
        precision = prior_precision(model.unknowns.groups, point.x, covariance, problem.precision)
        sd = residual_sd(problem, solution.residuals, steps.jacobians(), reduced)
        held = measured.plus(side_by_side(model, point.x))
        problem = replace(problem, sd=sd, precision=precision, observations=held)
        solution = solve(problem, point, settings.most_steps, close)
    return problem, solution


def _choose_frames(
    frames: Frames, layout: Layout, receivers: Sequence[str], n_frames: int
) -> tuple[Frames, Array]:
    """Choose frames to fit; return them and the share (F,) of the recording that each represents."""
    worn = int(frames.valid.any(0).sum())
    count = frames.valid.sum(1)
    enough = int(LEAST_CANDIDATES * (count >= max(2, worn / 2)).sum())
    least = next(c for c in range(worn, -1, -1) if (count >= c).sum() >= enough)
    usable = np.flatnonzero(count >= max(2, worn / 2, least))
    end = min(int(np.flatnonzero(seen)[-1]) + 1 for seen in frames.valid.T if seen.any()) if worn else 0
    if LEAST_LEFT <= end / len(count) < MOST_WHOLE:
        usable = usable[usable < end]
    if len(usable) < 2:
        raise InputError(
            f"{count_of(len(usable), 'frame', 'have')} half of the {count_of(worn, 'receiver')} valid; "
            "expected 2 or more: record the receivers together"
        )
    seen = [receivers[i] for i in np.flatnonzero(np.any(frames.valid, axis=0)).tolist()]
    index = [(receivers.index(a), receivers.index(b)) for a, b in neighbours(layout, seen)]
    rows, share = spread_frames(postures(frames.take(usable), index), n_frames)
    return frames.take(usable[rows]), share


def _residual_rms(problem: Problem, solution: Solution, model: HandModel) -> dict[str, tuple[float, float]]:
    """Return every receiver's root mean square residual, mm and deg per component; NaN if never valid."""
    rms = {}
    for s, r in problem.residuals_of(solution.residuals):
        seen = r[problem.frames.valid[:, s]].reshape(-1, 2, 3)
        off = np.sqrt((seen**2).mean((0, 2))) * problem.sd[s] if len(seen) else np.full(2, np.nan)
        rms[model.receivers[s]] = (float(off[0]), float(np.degrees(off[1])))
    return rms


def share_lengths(first_fit: HandFit, second_fit: HandFit) -> tuple[HandFit, HandFit]:
    """Condition the fits of a person's two hands on each other's bone lengths (section 7).

    Left and right bones are equally long up to SIDE_SD. Both posteriors are normal (Laplace) and lengths are
    linear in the unknowns, so that conditioning on the difference is equivalent to one fit of both hands.

    Parameters
    ----------
    first_fit, second_fit : HandFit
        The two hands of one person.

    Returns
    -------
    tuple of HandFit
        The hands in the same order, with conditioned posteriors.

    """
    bones = [name for name in first_fit.bones if name in second_fit.bones]
    first, second = _lengths(first_fit, bones), _lengths(second_fit, bones)
    difference = first[0] - second[0]
    spread = first[2] + second[2] + np.diag((SIDE_SD * first[0]) ** 2)
    pull = np.linalg.solve(spread, np.concatenate([difference[:, None], first[1], second[1]], 1))
    n_one = first[1].shape[1]
    steps = -first[1].T @ pull[:, 0], second[1].T @ pull[:, 0]
    shrinks = first[1].T @ pull[:, 1 : 1 + n_one], second[1].T @ pull[:, 1 + n_one :]
    first_fit, second_fit = (
        fit.moved_to(fit.posterior.x + step, fit.posterior.covariance - shrink)
        for fit, step, shrink in zip((first_fit, second_fit), steps, shrinks, strict=True)
    )
    return first_fit, second_fit


def _lengths(fit: SolvedFit, bones: list[str]) -> tuple[Array, Array, Array]:
    """Return lengths (B,), mm, their covariance with the unknowns (B, G) and with each other (B, B)."""
    posterior, amounts = fit.posterior, [fit.model.length[name] for name in bones]
    rows = np.array([amount.row(len(posterior.x)) for amount in amounts]).reshape(-1, len(posterior.x))
    rows[:, np.array(fit.model.unknowns.groups) == UNMODELLED] = 0.0  # this error is the same in both hands
    lengths = np.array([amount.constant for amount in amounts]) + rows @ posterior.x
    with_unknowns = rows @ posterior.covariance
    return lengths, with_unknowns, with_unknowns @ rows.T


def without_noise_bias(problem: Problem, point: Point) -> Point:
    """Correct a hand for the bias that noise causes if bones have no receiver (section 5, last item).

    The mode over the hand and the angles of all frames is a hand that is too large: noise looks like motion,
    and longer bones explain the same motion with smaller angles, which are likelier (Neyman & Scott 1948).
    The bias is estimated by a parametric bootstrap (Efron 1979): poses are simulated from the fitted hand
    with noise of the residuals' sd and with its negative, so that odd orders cancel, and fitted with the hand
    as the prior.

    Parameters
    ----------
    problem : Problem
        Problem as solved.
    point : Point
        Solution.

    Returns
    -------
    Point
        The corrected hand, with its frames posed again.

    """
    noise = np.random.default_rng(0).normal(size=(2, *problem.frames.valid.shape, 3))
    root, rows = np.sqrt(problem.precision), problem.observations.rows
    held = Observations(rows, rows @ point.x).plus(Observations(np.diag(root), root * point.x))
    again = replace(problem, observations=held, precision=np.full(len(root), NO_PRECISION))
    fitted, solved_x = residuals(problem, point).branches, []
    for shift, turn in (noise, -noise):
        rotation, position = problem.frames.rotation.copy(), problem.frames.position_mm.copy()
        for receivers, (_, _, reached) in zip(problem.receivers, fitted, strict=True):
            for mark, s in receivers:
                rotation[:, s] = reached.rotation[mark] @ exp_rotation(problem.sd[s, 1] * turn[:, s])
                position[:, s] = reached.position_mm[mark] + problem.sd[s, 0] * shift[:, s]
        if problem.field is not None:
            rotation = problem.field.turn(position, point.x) @ rotation
        frames = Frames(rotation, position, problem.frames.valid)
        solved_x.append(solve(replace(again, frames=frames), point, _BOOTSTRAP_STEPS, NEARLY).point.x)
    x = 2 * point.x - np.mean(solved_x, axis=0)
    return pose(problem, replace(point, x=x))
