"""The whole pipeline on one hand, in this process but over real files, as the Snakefile chains it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schemas.catalogue import TABLES
from schemas.tables import read_table, rows_of
from stages.capture.__main__ import main as capture
from stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from stages.evaluate_tips.__main__ import main as evaluate_tips
from stages.project_planes.__main__ import main as project_planes
from stages.solve_joints.__main__ import main as solve_joints

Row = dict[str, Any]


@dataclass(frozen=True)
class HandResults:
    """Where one hand's tables are, and how to read them."""

    folder: Path

    def path(self, name: str) -> Path:
        """A table's file."""
        return self.folder / f"{name}.parquet"

    def rows(self, name: str) -> list[Row]:
        """All rows of a table."""
        return list(rows_of(read_table(self.path(name), TABLES[name])))

    def joints(self) -> dict[str, Row]:
        """joint_centres by joint."""
        return {row["joint"]: row for row in self.rows("joint_centres")}

    def errors(self, binding: str = "least-squares") -> dict[str, Row]:
        """tip_errors by digit, of the one recording."""
        return {row["digit"]: row for row in self.rows("tip_errors") if row["binding"] == binding}


def import_recording(
    file: Path,
    out: Path,
    *,
    subject: str = "01",
    hand: str = "right",
    task: str = "task",
    layout: str = "liberty16",
) -> Path:
    """Run capture on a recording; give its poses."""
    words = ["import", f"--in={file}", f"--out={out}", f"--layout={layout}", f"--subject={subject}"]
    assert capture([*words, f"--hand={hand}", f"--task={task}"]) == 0
    return out


def run_hand(
    calibration: Path, evaluated: Path, model: str, folder: Path, layout: str = "liberty16", *corrections: str
) -> HandResults:
    """Run every stage from poses to tip errors on one hand under one model."""
    done = HandResults(folder)
    common = ["--layout", layout, "--model", model]
    solutions, projected = done.path("joint_solutions"), folder / "projected_joints.parquet"
    poses = ["--poses", evaluated, "--calibration", calibration]
    joints, bones = done.path("joint_centres"), done.path("bone_lengths")
    made = ["--out-joints", joints, "--out-bones", bones]
    built = ["--joints", joints, "--bones", bones, "--metacarpals", done.path("metacarpals")]
    errors = ["--out-errors", done.path("tip_errors")]
    steps = [
        (solve_joints, ["--poses", calibration, "--out", solutions]),
        (project_planes, ["--joints", solutions, "--out", projected, *corrections]),
        (estimate_metacarpals, ["--joints", projected, *poses, *made, "--out", done.path("metacarpals")]),
        (evaluate_tips, [*poses, *built, "--out", done.path("tips"), *errors]),
    ]
    for stage, words in steps:
        assert stage([*common, *map(str, words)]) == 0, stage.__module__
    return done
