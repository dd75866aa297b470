"""The whole-hand fit on simulated hands, beside joint-by-joint estimators and beside itself with parts off.

`python -m benchmarks.whole_hand_trial --seeds 1000-1009` prints the table; `run` gives it.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from benchmarks.solve_hand import as_poses, closed, solved_joints
from benchmarks.text_table import Cell, TextTable
from kinematics.rotations import rotate
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.poses import Poses
from stages.fit_hand.building import Parts
from stages.fit_hand.fit import HandFit, Settings, fit_hand
from stages.fit_hand.measurements import Measurement
from stages.fit_hand.reading import FittedJoint
from stages.fit_hand.replaying import pose_hand
from stages.project_planes.plane import project
from stages.simulate.anatomy import BONES
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate

COVERED_95 = 7.815
"""95 % of squared Mahalanobis distances in three dimensions are below this."""

RADIUS_SD = 1.614
"""95 % of a three-dimensional error lie within this many sd_mm, if it is as large in every direction."""

GROSS_MM = 5.0
N_FRAMES = 6000
MEASURED_SD_MM = 0.4
POSED_EVERY = 20
LAYOUT = "liberty16"
PALM = ("ring_metacarpal", "little_metacarpal")

PRIOR, PAPER, CLOSED, WHOLE = "prior only", "paper (plane)", "closed form, no plane", "whole hand"
MEASURED, LENGTHS = "whole hand, lengths and mounts measured", "whole hand, lengths measured"
STANDARD = (PRIOR, PAPER, CLOSED, WHOLE, LENGTHS, MEASURED)
ABLATIONS = {
    "without skin states": {"skin": False},
    "without palm states": {"palm": False},
    "without thumb pivot": {"pivot": False},
    "without joint translation": {"joint_slide": False},
}
PUBLISHED = "scales as published"


@dataclass(frozen=True)
class CentreError:
    """One joint's centre against the truth, mm; covered : share of its two halves in their 95 % ellipsoids;
    in_radius : whether the worse half is within the 95 % radius of the stated sd. None where none is stated.
    """

    parent_mm: float
    child_mm: float
    covered: float | None
    in_radius: bool | None


@dataclass(frozen=True)
class HandTrial:
    """One hand by one estimator: its joints, its palm's metacarpal directions (deg) and the time it took."""

    joints: Mapping[str, CentreError]
    metacarpals_deg: Mapping[str, float]
    converged: bool
    seconds: float


def run(
    seeds: Sequence[int] = range(10), task: str = "rom", estimators: Sequence[str] = STANDARD
) -> Iterator[TextTable]:
    """Give the table over those seeds, right and left hand of each."""
    hands = [(seed, hand, task, tuple(estimators)) for seed in seeds for hand in ("right", "left")]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(trials, *zip(*hands, strict=True)))
    rows = [_row(name, [hand[name] for hand in found]) for name in estimators]
    yield TextTable(
        f"whole_hand_trial: {task}, {len(hands)} simulated hands (seeds {min(seeds)} to {max(seeds)}), "
        f"{N_FRAMES} frames, full realism",
        (
            ("estimator", ""),
            ("median mm", ".2f"),
            ("p90 mm", ".2f"),
            ("> 5 mm %", ".1f"),
            ("worst mm", ".1f"),
            ("parent median", ".2f"),
            ("parent p90", ".2f"),
            ("in ellipsoid %", ".1f"),
            ("in radius %", ".1f"),
            ("ring, little mc deg", ".1f"),
            ("converged", ""),
            ("s", ".2f"),
        ),
        rows,
        "Distance of the joint centres to the true ones in the child's receiver frame, all solved joints "
        "together, then in the parent's (of a palm that moves and of the thumb's skew CMC axes: the mean "
        "over the recording); how often the stated 95 % ellipsoid (both frames) and the radius of "
        f"{RADIUS_SD} sd hold the truth; mean angle to the true direction of the ring and little finger's "
        f"metacarpals over the recording. Measured: with {MEASURED_SD_MM} mm error. Simulator and estimator "
        "share published anatomy, not the skin's law.",
    )


def _row(name: str, hands: Sequence[HandTrial]) -> tuple[Cell, ...]:
    joints = [joint for hand in hands for joint in hand.joints.values()]
    child = np.array([joint.child_mm for joint in joints])
    parent = np.array([joint.parent_mm for joint in joints])
    stated = [joint for joint in joints if joint.covered is not None]
    directions = [angle for hand in hands for angle in hand.metacarpals_deg.values()]
    return (
        name,
        float(np.median(child)),
        float(np.percentile(child, 90)),
        100 * float((child > GROSS_MM).mean()),
        float(child.max()),
        float(np.median(parent)),
        float(np.percentile(parent, 90)),
        100 * float(np.mean([j.covered for j in stated])) if stated else None,
        100 * float(np.mean([j.in_radius for j in stated])) if stated else None,
        float(np.mean(directions)) if directions else None,
        f"{sum(hand.converged for hand in hands)}/{len(hands)}",
        float(np.mean([hand.seconds for hand in hands])),
    )


def trials(seed: int, hand: str, task: str, estimators: Sequence[str]) -> dict[str, HandTrial]:
    """Simulate one hand and estimate it in every way asked for."""
    made = simulate("01", hand, task, seed, Realism.full(), N_FRAMES)
    found = {}
    for name in estimators:
        if name in (PAPER, CLOSED):
            found[name] = _joint_by_joint(made, plane=name == PAPER)
        else:
            found[name] = _whole_hand(made, name, seed)
    return found


def _whole_hand(made: Simulated, name: str, seed: int) -> HandTrial:
    """Fit the hand at once; name says with what."""
    measurements = measured(made, seed, mounts=name == MEASURED) if name in (MEASURED, LENGTHS) else []
    settings = Settings(
        most_steps=0 if name == PRIOR else Settings.most_steps,
        rounds=0 if name in (PRIOR, PUBLISHED) else Settings.rounds,
        parts=Parts(**ABLATIONS.get(name, {})),
    )
    poses = as_poses(made)
    started = time.perf_counter()
    fit = fit_hand([poses], read_layout(LAYOUT), made.hand, measurements=measurements, settings=settings)
    seconds = time.perf_counter() - started
    joints = {joint.name: _fit_error(made, joint) for joint in fit.joints.values()}
    if name == PRIOR:  # nothing was weighed, so nothing is stated
        joints = {key: replace(error, covered=None, in_radius=None) for key, error in joints.items()}
    return HandTrial(joints, _metacarpals_deg(made, fit, poses), fit.converged, seconds)


def _fit_error(made: Simulated, joint: FittedJoint) -> CentreError:
    true = made.truth.joints[joint.name]
    parent, child = joint.parent_mm - true.parent_mm, joint.child_mm - true.child_mm
    halves = ((parent, joint.covariance_mm2[:3, :3]), (child, joint.covariance_mm2[3:, 3:]))
    distance = [float(off @ np.linalg.solve(covariance, off)) for off, covariance in halves]
    worse = float(max(np.linalg.norm(parent), np.linalg.norm(child)))
    return CentreError(
        float(np.linalg.norm(parent)),
        float(np.linalg.norm(child)),
        float(np.mean([d < COVERED_95 for d in distance])),
        worse <= RADIUS_SD * joint.sd_mm,
    )


def _metacarpals_deg(made: Simulated, fit: HandFit, poses: Poses) -> dict[str, float]:
    """Mean angle over the recording between the true and the fitted direction of the palm's bones."""
    some = slice(None, None, POSED_EVERY)
    posed = pose_hand(
        fit,
        Poses(
            poses.segments,
            poses.frame[some],
            poses.time_s[some],
            poses.position_mm[some],
            poses.quaternion[some],
            poses.valid[some],
        ),
    )
    distal = np.array([1.0, 0.0, 0.0])
    angles = {}
    for bone in PALM:
        true = rotate(made.truth.bone_quaternion[some, BONES.index(bone)], distal)
        found = rotate(posed.bone_quaternion[:, posed.bones.index(bone)], distal)
        cosine = np.clip((true * found).sum(-1), -1.0, 1.0)
        angles[bone] = float(np.degrees(np.arccos(cosine)).mean())
    return angles


def measured(made: Simulated, seed: int, *, mounts: bool, sd_mm: float = MEASURED_SD_MM) -> list[Measurement]:
    """Measure the hand as a lab would: every phalanx, `mounts` every receiver's place too, with an error."""
    rng = np.random.default_rng([seed, made.hand == "left"])
    truth, taken = made.truth, []
    lateral = -1.0 if made.hand == "left" else 1.0
    for index, segment in enumerate(truth.mounts.segments):
        if BONES[truth.mounts.bone[index]] == "hand":
            continue
        true = {segment: truth.hand.length_mm[truth.mounts.bone[index]]}
        if mounts:
            x, y, z = truth.mounts.position_mm[index]
            true |= {f"{segment}.along": x, f"{segment}.lateral": lateral * y, f"{segment}.height": z}
        for quantity, value in true.items():
            taken.append(Measurement(quantity, float(value + sd_mm * rng.normal()), sd_mm))
    return taken


def _joint_by_joint(made: Simulated, *, plane: bool) -> HandTrial:
    """Every joint on its own: Eq. 1-7, then the plane; or six unknowns and no plane."""
    layout, model = read_layout(LAYOUT), read_model("paper-fig4")
    poses = as_poses(made)
    joints = solved_joints(layout, poses)
    started = time.perf_counter()
    solutions = closed(poses, joints, model.singular_values if plane else 6)
    seconds = time.perf_counter() - started
    errors = {}
    for joint, solution in zip(joints, solutions, strict=True):
        p_mm, q_mm = solution.p_mm, solution.q_mm
        if plane:
            placed = project(
                p_mm,
                q_mm,
                solution.null_parent,
                solution.null_child,
                solution.covariance_mm2,
                float(np.radians(solution.axis_sd_deg)),
                plane_point_mm=np.array(joint.plane.point_mm),
                plane_normal=np.array(joint.plane.normal),
                plane_in_parent=joint.plane.frame == "parent",
            )
            if placed is not None:
                p_mm, q_mm = placed.p_mm, placed.q_mm
        true = made.truth.joints[joint.name]
        apart = float(np.linalg.norm(p_mm - true.parent_mm)), float(np.linalg.norm(q_mm - true.child_mm))
        errors[joint.name] = CentreError(*apart, None, None)
    return HandTrial(errors, {}, True, seconds)


def main(words: list[str] | None = None) -> int:
    """Run the trial on the words of a command line; give the exit code."""
    made = argparse.ArgumentParser(
        prog="python -m benchmarks.whole_hand_trial",
        description="Fit simulated hands whole and joint by joint; print how far joint centres are off.",
        epilog="example:\n  python -m benchmarks.whole_hand_trial --seeds 1000-1009",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument(
        "--seeds", type=_seeds, default=range(10), help="first-last, both included (default: 0-9)"
    )
    made.add_argument(
        "--task", choices=("rom", "opposition"), default="rom", help="calibration (default: rom)"
    )
    made.add_argument("--ablations", action="store_true", help="the whole-hand fit with parts left out, too")
    arguments = made.parse_args(words)
    os.environ["OMP_NUM_THREADS"] = "1"  # for the process that computes: one thread, as in the workflow
    estimators = (*STANDARD, PUBLISHED, *ABLATIONS) if arguments.ablations else STANDARD
    for table in run(arguments.seeds, arguments.task, estimators):
        print(table)
    return 0


def _seeds(text: str) -> range:
    first, _, last = text.partition("-")
    if not first.isdigit() or not (last or first).isdigit() or int(last or first) < int(first):
        raise argparse.ArgumentTypeError(f"{text!r} is no range of seeds; expected e.g. 1000-1009")
    return range(int(first), int(last or first) + 1)


if __name__ == "__main__":
    sys.exit(main())
