"""The whole pipeline on one hand, in this process but over real files, as the Snakefile chains it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.__main__ import main as capture
from shukotsu.schemas.catalogue import TABLES
from shukotsu.schemas.parts import open_parts
from shukotsu.schemas.tables import Table, read_table, rows_of
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from shukotsu.stages.evaluate_tips.__main__ import main as evaluate_tips
from shukotsu.stages.project_planes.__main__ import main as project_planes
from shukotsu.stages.solve_joints.__main__ import main as solve_joints

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


def recording_numbers(path: Path, table: Table, *which: Any, **more: Any) -> dict[str, Array]:
    """Numbers of one recording in a subject table, see `PartsReader.recording`."""
    with open_parts(path, table) as parts:
        return parts.recording(*which, **more)


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


def run_stages(
    folder: Path,
    *common: object,
    solve: Sequence[object] = (),
    project: Sequence[object] = (),
    replay: Sequence[object] = (),
) -> None:
    """Run every stage from poses to tip errors, their tables in the folder; a failure fails the test.

    common : arguments of every stage; solve, project, replay : more of them for the joint solve, for the
    planes, and for both the metacarpals and the tips.
    """
    made = {"out-joints": "joint_centres", "out-bones": "bone_lengths", "out": "metacarpals"}
    built = {"joints": "joint_centres", "bones": "bone_lengths", "metacarpals": "metacarpals"}
    for stage, own, tables in (
        (solve_joints, solve, {"out": "joint_solutions"}),
        (project_planes, project, {"joints": "joint_solutions", "out": "projected_joints"}),
        (estimate_metacarpals, replay, {"joints": "projected_joints", **made}),
        (evaluate_tips, replay, {**built, "out": "tips", "out-errors": "tip_errors"}),
    ):
        files = [f"--{option}={folder / table}.parquet" for option, table in tables.items()]
        assert stage([*map(str, (*common, *own)), *files]) == 0, stage.__module__


def run_hand(
    calibration: Path, evaluated: Path, model: str, folder: Path, layout: str = "liberty16", *corrections: str
) -> HandResults:
    """Run every stage from poses to tip errors on one hand under one model."""
    run_stages(
        folder,
        f"--layout={layout}",
        f"--model={model}",
        solve=["--poses", calibration],
        project=corrections,
        replay=["--poses", evaluated, "--calibration", calibration],
    )
    return HandResults(folder)
