"""A simulated subject of a study with its plan, and the stages run on it in this process."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from simulated_poses import recorded, write_poses
from small_study import run_stages, write_plans, write_study
from stage_runs import fit_hand, of_plan

from shukotsu.simulate.written_truth import write_truth
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.plan import SubjectPlan, plan_of_results
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.parts import Part, read_part
from shukotsu.tables.typed_table import METADATA_KEY, Provenance, rows_of

QUICK = """model: quick
description: a whole hand, fitted in few frames
joints: {calibration: all}
planes: {cut: false}
fit: {whole_hand: true, frames: 30, steps: 10}
own_cmc: [thumb_cmc, index_cmc, middle_cmc, ring_cmc, little_cmc]
metacarpals: {unmeasured: fitted, measured: fitted}
"""
SHEETS = {
    "measurements": "subject\thand\tquantity\tvalue_mm\tsd_mm",
    "touches": "subject\thand\ttask\tdigit\tpart\tfrom_s\tto_s\tx_mm\ty_mm\tz_mm\tsd_mm\tmeets",
}
Row = dict[str, Any]


def _forget_inputs(path: Path) -> None:
    with pq.ParquetFile(path) as file:
        metadata = {**file.metadata.metadata}
        groups = [file.read_row_group(index) for index in range(file.num_row_groups)]
        schema = file.schema_arrow
    if METADATA_KEY not in metadata:
        return
    del metadata[b"ARROW:schema"]
    known = json.loads(metadata[METADATA_KEY]) | {"inputs": []}
    metadata[METADATA_KEY] = json.dumps(known).encode()
    with pq.ParquetWriter(path, schema.with_metadata(metadata)) as writer:
        for group in groups:
            writer.write_table(group, row_group_size=max(1, group.num_rows))


@dataclass(frozen=True)
class PlannedSubject:
    """Subject 01 in a folder of its own; a test that changes files works on a copy."""

    folder: Path

    @property
    def plan_file(self) -> Path:
        """The subject's plan."""
        return self.folder / "results" / "sub-01" / "plan.json"

    @property
    def plan(self) -> SubjectPlan:
        """The same, read."""
        return plan_of_results(self.plan_file)

    def poses(self, task: str, hand: str = "right") -> Path:
        """A recording's poses table."""
        return self.plan_file.parent / hand / task / "poses.parquet"

    def truth(self, task: str, hand: str = "right") -> Path:
        """Folder of a recording's truth."""
        return self.folder / "raw" / f"{hand}-{task}_truth"

    def fit_folder(self, hand: str = "right", model: str = "quick") -> Path:
        """Folder of the tables that the fit of a model writes."""
        return self.plan_file.parent / "fits" / hand / model

    def part(self, model: str, made_without: str = "", hand: str = "right") -> Part:
        """A skeleton."""
        return Part(hand, model, made_without, "01")

    def copied(self, folder: Path) -> PlannedSubject:
        """The same files elsewhere, the plan's paths among them.

        No table says what it was made from, so that a test may change one and leave the others.
        """
        copy = PlannedSubject(Path(shutil.copytree(self.folder, folder / "copy")))
        text = copy.plan_file.read_text("utf-8")
        for here, there in ((self.folder, copy.folder), *(map(os.path.relpath, (self.folder, copy.folder)),)):
            text = text.replace(str(here), str(there))
        copy.plan_file.write_text(text, "utf-8")
        for table in copy.folder.rglob("*.parquet"):
            _forget_inputs(table)
        return copy

    def run_stages(self, *, reference: bool = True) -> None:
        """Run every stage from the joints to the tips; reference : lay out the prior's hand too."""
        for hand in self.plan.hands:
            assert self.fit(hand) == 0
        run_stages(self.plan_file)
        for hand in self.plan.hands if reference else ():
            assert self.fit(hand, model=REFERENCE) == 0

    def fit(self, hand: str, *options: str, model: str = "quick") -> int:
        """Fit a hand under a model; give the exit code."""
        out = f"--out={self.fit_folder(hand, model)}"
        plan = of_plan("fit_hand", self.plan_file)
        return fit_hand([*plan, f"--hand={hand}", f"--model={model}", out, *options])

    def rows(self, path: Path, table: str, part: Part) -> list[Row]:
        """Rows of a part of a table."""
        return list(rows_of(read_part(path, TABLES[table], part)))


def planned_subject(
    folder: Path,
    recordings: Sequence[tuple[str, str, str]],
    models: Sequence[str],
    *,
    n_frames: int,
    seed: int = 4,
    quick: str = QUICK,
    **sheets: Sequence[str],
) -> PlannedSubject:
    """Simulate a subject's recordings and write their poses, truths and the plan.

    recordings : hand, task and role of each. models : names of those that ship, or quick, whose file that
    is. sheets : rows of measurements and touches, tab-separated.
    """
    subject, rows = PlannedSubject(folder), []
    for hand, task, role in recordings:
        made = recorded(hand, task, seed=seed, n_frames=n_frames)[0]
        write_poses(subject.poses(task, hand), made, hand, task)
        write_truth(subject.truth(task, hand), made, Provenance())
        rows.append(f"01 {hand} {task} {role} raw/{hand}-{task}.parquet")
    (folder / "quick.yaml").write_text(quick)
    study = write_study(
        folder,
        *rows,
        models=["quick.yaml" if model == "quick" else model for model in models],
        more=f"simulation: {{folder: raw, seed: {seed}}}\n",
        **{name: "\n".join([SHEETS[name], *lines]) for name, lines in sheets.items()},
    )
    write_plans(study)
    return subject
