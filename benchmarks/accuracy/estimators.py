"""Every way to estimate a hand that is compared: ours, one joint at a time or the hand as a whole."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.accuracy.score import Centre, Estimate, phalanges_mm
from benchmarks.accuracy.trials import Trial
from shukotsu.schemas.layout import Joint, read_layout
from shukotsu.schemas.model import read_model
from shukotsu.skeleton.rotations import Array, rotate
from shukotsu.stages.fit_hand.fit import HandFit, Settings, fit_hand
from shukotsu.stages.fit_hand.fitted_motion import pose_hand
from shukotsu.stages.fit_hand.measurements import Measurement
from shukotsu.stages.fit_hand.shared_lengths import share_lengths
from shukotsu.stages.project_planes.place import place_joint
from shukotsu.stages.simulate.random_hand import BONES
from shukotsu.stages.simulate.simulation import LAYOUT
from shukotsu.stages.solve_joints.closed import JointSolution, solve_closed
from shukotsu.stages.solve_joints.moments import BLOCK_FRAMES, JointMoments
from shukotsu.stages.solve_joints.solution_rows import solution_row
from shukotsu.stages.solve_joints.solve import add_block

PRIOR = "prior only"
PAPER, SCORE, SARA = "paper-fig4", "SCoRE", "SARA"
WHOLE = "whole-hand"
BOTH = "whole-hand, both hands"
LENGTHS = "whole-hand + lengths"
MEASURED = "whole-hand + lengths, mounts"
OURS = (PRIOR, PAPER, SCORE, SARA, WHOLE, BOTH, LENGTHS, MEASURED)

MEASURED_SD_MM = 0.4
POSED_EVERY = 20
PALM = ("ring_metacarpal", "little_metacarpal")


def joint_by_joint(trial: Trial, kind: str) -> Estimate:
    """Each joint alone, in closed form: on its plane (the paper), with six unknowns, or five and an axis."""
    joints = _solved_joints(trial)
    started = time.process_time()
    moments, centres = JointMoments(len(joints)), {}
    for start in range(0, len(trial.poses.frame), BLOCK_FRAMES):  # as the stage does
        add_block(moments, trial.poses.take(slice(start, start + BLOCK_FRAMES)), joints)
    for index, joint in enumerate(joints):
        one = solve_closed(moments, index, 6 if kind == SCORE else 5)
        stated = one.covariance_mm2 if kind == SCORE else None
        on_axis = Centre(one.p_mm, one.q_mm, stated, one.null_child)
        centres[joint.name] = _on_plane(joint, one) if kind == PAPER else on_axis
    seconds = time.process_time() - started
    return Estimate(centres, seconds, phalanges_mm(centres))


def _solved_joints(trial: Trial) -> list[Joint]:
    """Joints between two receivers that were worn."""
    worn = set(trial.poses.segments)
    return [one for one in read_layout(LAYOUT).solvable if {one.parent_receiver, one.child} <= worn]


def _on_plane(joint: Joint, solution: JointSolution) -> Centre:
    row = place_joint(joint, read_layout(LAYOUT), solution_row(joint, solution), read_model(PAPER), None)
    if row["status"] == "failed":  # an axis in the plane itself: the point that the singular values give
        return Centre(solution.p_mm, solution.q_mm, None, solution.null_child)
    parent, child = (np.array([row[f"{half}_{axis}_mm"] for axis in "xyz"]) for half in ("parent", "child"))
    return Centre(parent, child, np.reshape(row["covariance_mm2"], (6, 6)), solution.null_child)


Fits = dict[str, list[tuple[HandFit, float]]]
"""By estimator, for each trial its fit and the processor's seconds."""


def whole_hands(trials: Sequence[Trial], names: Sequence[str]) -> Fits:
    """Fit both hands of a person as a whole, in every way that is named."""
    ways: dict[str, Callable[[Trial], tuple[HandFit, float]]] = {
        PRIOR: lambda trial: _fit(trial, [], Settings(most_steps=0, rounds=0)),
        WHOLE: lambda trial: _fit(trial, []),
        LENGTHS: lambda trial: _fit(trial, measured(trial, mounts=False)),
        MEASURED: lambda trial: _fit(trial, measured(trial, mounts=True)),
    }
    fits = {name: [way(trial) for trial in trials] for name, way in ways.items() if name in names}
    if BOTH in names and len(trials) == 2:
        (one, one_s), (other, other_s) = fits[WHOLE]
        started = time.process_time()
        shared = share_lengths(one, other)
        sharing_s = (time.process_time() - started) / 2
        fits[BOTH] = [(shared[0], one_s + sharing_s), (shared[1], other_s + sharing_s)]
    return fits


def _fit(
    trial: Trial, measurements: list[Measurement], settings: Settings | None = None
) -> tuple[HandFit, float]:
    started = time.process_time()
    fit = fit_hand(
        [trial.poses],
        read_layout(LAYOUT),
        trial.hand,
        measurements=measurements,
        settings=settings,
    )
    return fit, time.process_time() - started


def of_fit(name: str, trial: Trial, fit: HandFit, seconds: float) -> Estimate:
    """The estimate that a fit is; nothing was weighed for the prior alone, so that states nothing."""
    centres = {
        joint.name: Centre(
            joint.parent_mm,
            joint.child_mm,
            None if name == PRIOR else joint.covariance_mm2,
            joint.axis_child,
        )
        for joint in fit.joints.values()
    }
    lengths = {bone: one.length_mm for bone, one in fit.bones.items()}
    sds = {} if name == PRIOR else {bone: one.sd_mm for bone, one in fit.bones.items()}
    return Estimate(centres, seconds, lengths, sds, palm_deg(trial, fit))


def palm_deg(trial: Trial, fit: HandFit) -> dict[str, float]:
    """Mean angle over the recording between the true and the fitted direction of the palm's bones."""
    posed = pose_hand(fit, trial.poses.take(slice(None, None, POSED_EVERY)))
    distal = np.array([1.0, 0.0, 0.0])
    angles = {}
    for bone in PALM:
        true = rotate(trial.truth.bone_quaternion[::POSED_EVERY, BONES.index(bone)], distal)
        fitted = rotate(posed.bone_quaternion[:, posed.bones.index(bone)], distal)
        angles[bone] = float(np.nanmean(_between_deg(true, fitted)))
    return angles


def _between_deg(one: Array, other: Array) -> Array:
    """Angles (T,) between unit vectors (T, 3)."""
    sine = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, (one * other).sum(-1))))


def measured(trial: Trial, *, mounts: bool, sd_mm: float = MEASURED_SD_MM) -> list[Measurement]:
    """Measure the hand as a lab would: every phalanx, `mounts` every receiver's place too, with an error."""
    rng = np.random.default_rng([trial.seed, trial.hand == "left"])
    truth = trial.truth
    lateral = -1.0 if trial.hand == "left" else 1.0
    measurements = []
    for index, segment in enumerate(truth.mounts.segments):
        if BONES[truth.mounts.bone[index]] == "hand":
            continue
        true = {segment: truth.hand.length_mm[truth.mounts.bone[index]]}
        if mounts:
            x, y, z = truth.mounts.position_mm[index]
            true |= {f"{segment}.along": x, f"{segment}.lateral": lateral * y, f"{segment}.height": z}
        for quantity, value in true.items():
            measurements.append(Measurement(quantity, float(value + sd_mm * rng.normal()), sd_mm))
    return measurements
