"""Joint centres by estimator on simulated hands: anatomy alone, the paper, the closed form, and both joined.

`python -m benchmarks.anatomical_trial --seeds 2000-2009`
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.paper_accuracy import JOINT_TYPES, RADIUS_SD
from benchmarks.text_table import Cell, TextTable
from kinematics.rotations import Array
from schemas.layout import Joint, Layout, read_layout
from stages.project_planes.plane import Projection, centre_sd_mm, project
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate
from stages.simulate.truth import TrueJoint
from stages.solve_joints.anatomical import HandSample, solve_hand
from stages.solve_joints.closed import JointSolution, solve_closed
from stages.solve_joints.moments import JointMoments, RelativePoses, relative_poses
from stages.solve_joints.priors import average_bones, joint_prior
from stages.solve_joints.receivers import hand_prior

ESTIMATORS = ("prior only", "paper", "closed form", "anatomical")
STIFF_DEG = 10.0


@dataclass(frozen=True)
class CentreError:
    """One centre of one estimator against the truth, mm; `worse_mm` is of the half that is farther off.

    along_mm, across_mm : parts of the child's half's error along the true axis and across. sd_mm : as stated.
    """

    estimator: str
    joint: str
    range_deg: float
    child_mm: float
    along_mm: float
    across_mm: float
    worse_mm: float
    sd_mm: float


def hand_errors(seed: int, hand: str, task: str, artefact: float) -> list[CentreError]:
    """Errors of every estimator on every joint of one simulated hand."""
    made = simulate("01", hand, task, seed, replace(Realism.full(), artefact=artefact))
    layout = read_layout("liberty16")
    joints = [joint for joint in layout.solvable if joint.parent_receiver in made.segments]
    moments, sample = JointMoments(len(joints)), HandSample(joints)
    relative = _relative(made, joints)
    moments.add(relative)
    sample.add(relative)
    errors = []
    for name, centres in (
        ("prior only", _prior_only(joints, layout, hand)),
        ("paper", _paper(joints, moments)),
        ("closed form", [_halves(solve_closed(moments, i, 6)) for i in range(len(joints))]),
        ("anatomical", [_halves(one) for one in solve_hand(sample, moments, layout, hand, None).values()]),
    ):
        errors += [
            _error(name, made.truth.joints[joint.name], *centre)
            for joint, centre in zip(joints, centres, strict=True)
        ]
    return errors


Centre = tuple[Array, Array, Array]


def _halves(solution: JointSolution | Projection) -> Centre:
    return solution.p_mm, solution.q_mm, solution.covariance_mm2


def _relative(made: Simulated, joints: Sequence[Joint]) -> RelativePoses:
    parents = np.array([made.segments.index(joint.parent_receiver) for joint in joints])
    children = np.array([made.segments.index(joint.child) for joint in joints])
    valid = np.ones(made.position_mm.shape[:2], bool)
    return relative_poses(made.quaternion, made.position_mm, valid, parents, children)


def _prior_only(joints: Sequence[Joint], layout: Layout, hand: str) -> list[Centre]:
    bones = average_bones(hand)
    known = [joint_prior(joint, layout, bones) for joint in joints]
    prior = hand_prior(joints, known, [None] * len(joints), layout, None)
    blocks = [prior.block(i) for i in range(len(joints))]
    return [(mean[:3], mean[3:], covariance) for mean, covariance in blocks]


def _paper(joints: Sequence[Joint], moments: JointMoments) -> list[Centre]:
    centres = []
    for i, joint in enumerate(joints):
        found = solve_closed(moments, i, 5)
        placed = project(
            found.p_mm,
            found.q_mm,
            found.null_parent,
            found.null_child,
            found.covariance_mm2,
            float(np.radians(found.axis_sd_deg)),
            plane_point_mm=np.array(joint.plane.point_mm),
            plane_normal=np.array(joint.plane.normal),
            plane_in_parent=joint.plane.frame == "parent",
        )
        assert placed is not None
        centres.append(_halves(placed))
    return centres


def _error(estimator: str, true: TrueJoint, p_mm: Array, q_mm: Array, covariance_mm2: Array) -> CentreError:
    child = q_mm - true.child_mm
    along = float(child @ true.axis_child)
    length = float(np.linalg.norm(child))
    return CentreError(
        estimator,
        true.name,
        true.range_deg,
        length,
        abs(along),
        float(np.sqrt(max(length**2 - along**2, 0.0))),
        max(length, float(np.linalg.norm(p_mm - true.parent_mm))),
        centre_sd_mm(covariance_mm2),
    )


def tables(seeds: Sequence[int], task: str, artefact: float) -> Iterator[TextTable]:
    """Give a table of all joints, one of DIP joints that hardly moved, one by joint type."""
    errors = [
        error
        for seed in seeds
        for hand in ("right", "left")
        for error in hand_errors(seed, hand, task, artefact)
    ]
    whose = f"{2 * len(seeds)} simulated hands, seeds {seeds[0]} to {seeds[-1]}, {task}, skin x{artefact:g}"
    stiff = [e for e in errors if e.joint.endswith("_dip") and e.range_deg < STIFF_DEG]
    yield _table(f"all joints: {whose}", [(name, _of(errors, name)) for name in ESTIMATORS])
    yield _table(
        f"DIP joints that moved less than {STIFF_DEG:g} deg",
        [(name, _of(stiff, name)) for name in ESTIMATORS],
    )
    by_type = [
        (kind, [e for e in _of(errors, "anatomical") if e.joint in names])
        for kind, names in JOINT_TYPES.items()
    ]
    yield _table("anatomical, by joint", by_type)


def _of(errors: Sequence[CentreError], estimator: str) -> list[CentreError]:
    return [error for error in errors if error.estimator == estimator]


def _table(title: str, groups: Sequence[tuple[str, Sequence[CentreError]]]) -> TextTable:
    return TextTable(
        title,
        (
            ("", ""),
            ("n", "d"),
            *((name, ".2f") for name in ("median mm", "p90 mm")),
            ("> 5 mm %", ".1f"),
            *((name, ".2f") for name in ("along mm", "along p90", "across mm", "across p90", "sd mm")),
            ("within 95 % radius %", ".0f"),
        ),
        [_row(name, group) for name, group in groups],
        "Distance of the child's half to the true centre: median, 90th percentile, share over 5 mm; its "
        "parts along the true axis and across it; the stated sd (median), and how often the worse half is "
        f"within {RADIUS_SD} sd.",
    )


def _row(name: str, group: Sequence[CentreError]) -> tuple[Cell, ...]:
    if not group:
        return (name, 0, *[None] * 9)
    child, along, across, worse, sd = (
        np.array([getattr(error, part) for error in group])
        for part in ("child_mm", "along_mm", "across_mm", "worse_mm", "sd_mm")
    )
    middle = [
        float(f(values)) for values in (along, across) for f in (np.median, lambda v: np.percentile(v, 90))
    ]
    return (
        name,
        len(group),
        float(np.median(child)),
        float(np.percentile(child, 90)),
        100 * float(np.mean(child > 5)),
        *middle,
        float(np.median(sd)),
        100 * float(np.mean(worse <= RADIUS_SD * sd)),
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.anatomical_trial", description=__doc__)
    parser.add_argument("--seeds", default="2000-2009", help="first and last, such as 2000-2009")
    parser.add_argument("--calibration", choices=("rom", "opposition"), default="rom")
    parser.add_argument("--artefact", type=float, default=1.0, help="scale of the skin artefact")
    arguments = parser.parse_args()
    first, _, last = arguments.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    for table in tables(seeds, arguments.calibration, arguments.artefact):
        print(table, end="\n\n")


if __name__ == "__main__":
    main()
