"""The whole pipeline on one hand, in this process but over real files, as the Snakefile chains it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import stage_runs

from shukotsu.__main__ import main as capture
from shukotsu.hand.rotations import Array
from shukotsu.study.plan import option_of
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.parts import open_parts
from shukotsu.tables.typed_table import Table, read_table, rows_of

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
    for stage, options in (
        ("solve_joints", solve),
        ("project_planes", project),
        ("estimate_metacarpals", replay),
        ("evaluate_tips", replay),
    ):
        reads = [name for name in stage_runs.READS[stage] if (folder / f"{name}.parquet").is_file()]
        files = [f"{option_of(name)}={folder / name}.parquet" for name in reads if name != "findings"]
        argv = [*map(str, (*common, *options)), *files, *stage_runs.outputs(stage, folder)]
        assert getattr(stage_runs, stage)(argv) == 0, stage


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
