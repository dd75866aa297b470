"""Command line: a subject's hands as anatomy alone has them, posed in their recordings, for comparison."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from schemas.layout import Layout
    from schemas.parts import Part, PartsWriter
    from schemas.plan import SubjectPlan
    from stages.fit_hand.fit import HandFit

PRIOR_ONLY = "prior-only"
"""Name of the model of these tables."""

MOST_FRAMES = 80
"""Evenly spaced frames of a recording in which the prior's hand is posed. A motion repeats itself: 200
move the mean errors, which are millimetres, by 0.001 mm and the 95th percentiles by 0.02 mm.
"""

_UNWEIGHED = dict.fromkeys(("sd_mm", "covariance_mm2", "axis_sd_deg"))
"""Errors that are not stated, as nothing was weighed."""


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage fit_hand.prior",
        "Lay out the hand that anatomy expects, and pose recordings with it.",
        "shukotsu stage fit_hand.prior --plan results/demo/sub-01/plan.json --out results/demo/sub-01",
    )
    command_line.add_plan_options(
        parser, calibration="--poses", evaluated="--replay", sizes=("hand_length_mm",)
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of the tables to write")
    return parser


def lay_out(arguments: argparse.Namespace) -> None:
    """Lay out each hand and write its tables; a hand of which no anatomy is known has no part."""
    from schemas.tables import Provenance
    from stages.fit_hand.hand_tables import PRIOR, open_tables

    plan = command_line.plan_of(arguments)
    provenance = Provenance.of(command_line.poses_files(plan), plan.folder)
    with open_tables(arguments.out, PRIOR, provenance) as tables:
        for part in _parts(plan):
            with command_line.recording_failure(arguments, part, *tables.values()):
                _write_prior(plan, part, tables)


def _parts(plan: SubjectPlan) -> list[Part]:
    """Hands of which anatomy is known."""
    from anatomy.known_digits import known_digits

    return [plan.part(hand, PRIOR_ONLY) for hand, layout in plan.layouts.items() if known_digits(layout)]


def fit_prior(
    calibration: Sequence[Path], layout: Layout, hand: str, hand_length_mm: float | None = None
) -> HandFit:
    """Give the hand that anatomy expects, for these recordings.

    hand_length_mm : wrist crease to the tip of the middle finger, where it was measured. The recordings say
    which receivers were worn and how the hand was held in the mean, which is where a joint across a moving
    palm is read; they do not move a bone, an axis or a receiver. Raises InputError where none can be used.
    """
    from schemas.errors import InputError
    from schemas.poses import usable_poses
    from stages.fit_hand.calibration import NO_CALIBRATION, read_thinned
    from stages.fit_hand.fit import Settings, fit_hand

    usable, reasons = usable_poses(calibration)
    if not usable:
        raise InputError(f"{NO_CALIBRATION}: {'; '.join(reasons) or 'none is given'}")
    recordings = [read_thinned(path, layout.measured, MOST_FRAMES) for path in usable]
    nothing_moves = Settings(most_steps=0, rounds=0)
    return fit_hand(recordings, layout, hand, hand_length_mm=hand_length_mm, settings=nothing_moves)


def _write_prior(plan: SubjectPlan, part: Part, tables: Mapping[str, PartsWriter]) -> None:
    import numpy as np

    from schemas.poses import recording_name, usable_poses
    from stages.fit_hand.calibration import read_thinned
    from stages.fit_hand.fingertips import fingertips
    from stages.fit_hand.hand_tables import bone_rows, joint_rows
    from stages.fit_hand.posed_tables import bone_columns, posed_ends_mm, tip_columns
    from stages.fit_hand.replaying import pose_hand

    plan.check_calibration_left(part.hand)
    layout, calibrating = plan.layouts[part.hand], plan.all_calibrating(part.hand)
    fit = fit_prior([plan.poses(r) for r in calibrating], layout, part.hand, plan.hand_length_mm)
    anatomy_alone = {"source": "anatomy alone", "status": "ok", "message": ""}
    tables["prior_joints"].rows(part, [row | anatomy_alone | _UNWEIGHED for row in joint_rows(fit)])
    tables["prior_bones"].rows(part, [row | _UNWEIGHED for row in bone_rows(fit)])
    tables["prior_bone_poses"].rows(part, [])
    tables["prior_posed_tips"].rows(part, [])
    for path in usable_poses([plan.poses(recording) for recording in plan.evaluated(part.hand)])[0]:
        name, poses = recording_name(path), read_thinned(path, layout.measured, MOST_FRAMES)
        posed, every = pose_hand(fit, poses), np.arange(len(poses.frame))
        tips = tip_columns(name, fit, posed, poses, every, posed_ends_mm(fingertips(fit), posed))
        tables["prior_bone_poses"].columns(part, bone_columns(name, posed, poses))
        tables["prior_posed_tips"].columns(part, tips)


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why no hand was laid out, of every part."""
    from stages.fit_hand.hand_tables import PRIOR

    tables = {arguments.out / f"{name}.parquet": table for name, table in PRIOR.items()}
    command_line.record_failed_parts(message, tables, _parts(command_line.plan_of(arguments)))


def main(argv: list[str] | None = None) -> int:
    """Run the stage; give its exit code."""
    return command_line.run(build_parser().parse_args(argv), lay_out, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
