"""Command line: poses of the calibration recordings -> joint_solutions table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stages import command_line

if TYPE_CHECKING:
    from schemas.layout import Joint, Layout
    from stages.solve_joints.closed import JointSolution


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.solve_joints",
        "Find the centre and axis of every joint between two receivers (Eq. 1-7 of the paper).",
        "python -m stages.solve_joints --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16 --model paper-fig4 --out joint_solutions.parquet",
    )
    parser.add_argument("--poses", type=Path, nargs="*", default=[], help="poses of one hand's calibration")
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--model", required=True, help="a skeleton model that ships, or a path")
    parser.add_argument("--subject", help="whose hand (default: as the poses say)")
    parser.add_argument("--hand", choices=("right", "left"), help="which hand (default: as the poses say)")
    parser.add_argument(
        "--hand-length-mm",
        type=float,
        help="wrist crease to the middle finger's tip, for the solver anatomical (default: not measured)",
    )
    parser.add_argument("--out", type=Path, required=True, help="the joint_solutions table to write")
    return parser


def solve(arguments: argparse.Namespace) -> None:
    """Read the poses, solve every joint, write the table."""
    from schemas.catalogue import JOINT_SOLUTIONS
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.poses import one_hand, usable_poses
    from schemas.tables import Provenance, columns_from_rows, write_table
    from stages.solve_joints.anatomical import check_hand_length
    from stages.solve_joints.solve import solve_recordings

    layout, model = read_layout(arguments.layout), read_model(arguments.model)
    subject, hand = one_hand(arguments.poses, arguments.subject, arguments.hand)
    usable, reasons = usable_poses(arguments.poses)
    for reason in reasons:
        print(f"note: left out of the calibration: {reason}", file=sys.stderr)
    check_hand_length(arguments.hand_length_mm)
    found = solve_recordings(usable, layout, model, hand, arguments.hand_length_mm)
    nothing = "" if usable else f"no calibration recording: {'; '.join(reasons) or 'the study names none'}"
    rows = [
        {"subject": subject, "hand": hand, "model": model.name, **_row(joint, found[joint.name], nothing)}
        for joint in _present(layout, found)
    ]
    provenance = Provenance.of([*arguments.poses, *command_line.config_files(arguments)])
    write_table(arguments.out, JOINT_SOLUTIONS, columns_from_rows(JOINT_SOLUTIONS, rows), provenance)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the table without rows and the reason."""
    from schemas.catalogue import JOINT_SOLUTIONS
    from schemas.tables import Provenance, write_failure

    write_failure(arguments.out, JOINT_SOLUTIONS, message, Provenance.of(arguments.poses))


def _present(layout: Layout, found: dict[str, JointSolution | str]) -> list[Joint]:
    """Joints to report: all but those of an optional receiver that was not worn."""
    return [
        joint
        for joint in layout.solvable
        if not isinstance(found[joint.name], str)
        or not (layout.segments[joint.parent_receiver].optional or layout.segments[joint.child].optional)
    ]


def _row(joint: Joint, found: JointSolution | str, nothing: str) -> dict[str, Any]:
    names = {
        "joint": joint.name,
        "parent_segment": joint.parent_receiver,
        "child_segment": joint.child,
    }
    if isinstance(found, str):
        return {**names, "status": "failed", "message": nothing or found, "n_frames": 0}
    row: dict[str, Any] = {**names, "status": "weak" if found.message else "ok", "message": found.message}
    for prefix, vector, suffix in (
        ("parent_", found.p_mm, "_mm"),
        ("child_", found.q_mm, "_mm"),
        ("null_parent_", found.null_parent, ""),
        ("null_child_", found.null_child, ""),
    ):
        row |= {f"{prefix}{axis}{suffix}": value for axis, value in zip("xyz", vector, strict=True)}
    row |= {
        f"mean_rotation_{i}{j}": found.mean_rotation["xyz".index(i), "xyz".index(j)]
        for i in "xyz"
        for j in "xyz"
    }
    scalars = ("gap_rms_mm", "gap_rms_free_mm", "slide_to_free_mm", "range_deg", "spread_deg")
    return row | {
        "singular_values": found.singular_values,
        "covariance_mm2": found.covariance_mm2.ravel(),
        **{name: getattr(found, name) for name in (*scalars, "axis_sd_deg", "n_frames", "n_effective")},
    }


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), solve, record_failure)


if __name__ == "__main__":
    sys.exit(main())
