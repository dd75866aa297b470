"""Command line: joint_solutions -> joint_centres table (without the wrist point)."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line

if TYPE_CHECKING:
    from kinematics.rotations import Array


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    parser = command_line.parser(
        "stages.project_planes",
        "Cut every joint's axis with its plane (end of the paper's section 4); apply manual corrections.",
        "python -m stages.project_planes --joints joint_solutions.parquet --layout liberty16 "
        "--model paper-fig4 --out projected_joints.parquet",
    )
    parser.add_argument("--joints", type=Path, required=True, help="the joint_solutions table of one hand")
    parser.add_argument("--layout", required=True, help="a layout that ships, or a path")
    parser.add_argument("--model", required=True, help="a skeleton model that ships, or a path")
    parser.add_argument(
        "--corrections",
        type=Path,
        nargs="?",
        help="sheet of manual corrections; used by models that apply them",
    )
    parser.add_argument("--out", type=Path, required=True, help="the joint_centres table to write")
    return parser


def project_planes(arguments: argparse.Namespace) -> None:
    """Read the solutions, place every joint, write the table."""
    from schemas.catalogue import JOINT_CENTRES, JOINT_SOLUTIONS
    from schemas.errors import InputError
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.tables import Provenance, columns_from_rows, read_table, rows_of, write_table
    from stages.project_planes.place import place_joint

    layout, model = read_layout(arguments.layout), read_model(arguments.model)
    solutions = list(rows_of(read_table(arguments.joints, JOINT_SOLUTIONS)))
    for solution in solutions:
        if solution["joint"] not in layout.joints:
            raise InputError(
                f"{arguments.joints}: joint {solution['joint']} is not in layout {layout.name}; "
                "give the layout that the joints were solved with"
            )
    corrections = _corrections(arguments.corrections if model.corrections else None)
    rows = [
        {key: solution[key] for key in ("subject", "hand", "model")}
        | place_joint(
            layout.joints[solution["joint"]],
            solution,
            model,
            corrections.get((solution["subject"], solution["hand"], solution["joint"])),
        )
        for solution in solutions
    ]
    sheets = [arguments.corrections] if model.corrections and arguments.corrections else []
    provenance = Provenance.of([arguments.joints, *command_line.config_files(arguments), *sheets])
    write_table(arguments.out, JOINT_CENTRES, columns_from_rows(JOINT_CENTRES, rows), provenance)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the table without rows and the reason."""
    from schemas.catalogue import JOINT_CENTRES
    from schemas.tables import Provenance, write_failure

    write_failure(arguments.out, JOINT_CENTRES, message, Provenance.of([arguments.joints]))


def _corrections(path: Path | None) -> dict[tuple[str, str, str], Array]:
    import numpy as np

    from schemas.study import read_corrections

    return {
        (row["subject"], row["hand"], row["joint"]): np.array([row["dx_mm"], row["dy_mm"], row["dz_mm"]])
        for row in read_corrections(path)
    }


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), project_planes, record_failure)


if __name__ == "__main__":
    sys.exit(main())
