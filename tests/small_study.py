"""A small study on disk: file, sheets, simulated poses and plans, and running its stages in this process."""

from __future__ import annotations

import copy
import json
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import stage_runs
from simulated_poses import recorded, write_poses
from stage_runs import of_plan, outputs

from shukotsu.__main__ import main as capture
from shukotsu.arrays import Array
from shukotsu.command_line import option_of
from shukotsu.simulate.recording import write_truth
from shukotsu.simulate.task_motion import TASK_FRAMES
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import StudyPlans, plan_of_results, plan_text
from shukotsu.study.results import Results
from shukotsu.study.study import read_study
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.parts import Part, open_parts, read_part
from shukotsu.tables.typed_table import METADATA_KEY, Provenance, Table, read_table, rows_of
from shukotsu.tables.whole_files import write_text

STAGES = ("solve_joints", "project_planes", "estimate_metacarpals", "evaluate_tips")
"""The stages from poses to tip errors, in order."""
HEADER = "subject hand task role file trial layout exclude accept"
SHEETS = {
    "measurements": "subject\thand\tquantity\tvalue_mm\tsd_mm",
    "touches": "subject\thand\ttask\tdigit\tpart\tfrom_s\tto_s\tx_mm\ty_mm\tz_mm\tsd_mm\tmeets",
}
QUICK = """model: quick
description: a whole hand, fitted in few frames
joints: {calibration: all}
planes: {cut: false}
fit: {whole_hand: true, frames: 30, steps: 10}
own_cmc: [thumb_cmc, index_cmc, middle_cmc, ring_cmc, little_cmc]
metacarpals: {unmeasured: fitted, measured: fitted}
"""
Row = dict[str, Any]


def write_study(
    folder: Path,
    *rows: str,
    header: str = HEADER,
    models: Sequence[str] = ("rigid", "paper-fig4"),
    more: str = "",
    **sheets: str,
) -> Path:
    """Write a study file with recordings given as rows of cells separated by blanks ('-' is an empty cell).

    header : columns of these rows. sheets : texts of the other sheets. Both have blanks for tabs. more :
    further lines of the study file.
    """
    sheet_folder = folder / "sheets"
    sheet_folder.mkdir(parents=True, exist_ok=True)
    lines = ["\t".join("" if cell == "-" else cell for cell in row.split(" ")) for row in rows]
    text = "\n".join([header.replace(" ", "\t"), *lines])
    (sheet_folder / "recordings.tsv").write_text(text, "utf-8")
    for name, text in sheets.items():
        (sheet_folder / f"{name}.tsv").write_text(text.replace(" ", "\t"), "utf-8")
        more += f"{name}: sheets/{name}.tsv\n"
    file = folder / "study.yaml"
    heads = (
        f"study: test\nrecordings: sheets/recordings.tsv\nlayout: liberty16\nmodels: [{', '.join(models)}]\n"
    )
    file.write_text(heads + more)
    return file


def write_plans(study_file: Path) -> dict[str, Path]:
    """Write every subject's plan, with results beside the study file, and return the files by subject."""
    study, results = read_study(study_file), Results(study_file.parent / "results")
    plans = StudyPlans(study, results.folder)
    for subject in study.subjects:
        write_text(results.plan(subject), plan_text(plans.content(subject)))
    return {subject: results.plan(subject) for subject in study.subjects}


def put(config: Row, key: str, value: Any) -> Row:
    """Return the configuration with one key, given by its dotted path, set or, for None, removed."""
    changed = copy.deepcopy(config)
    *groups, last = key.split(".")
    inner = changed
    for group in groups:
        inner = inner.setdefault(group, {})
    inner[last] = value
    if value is None:
        del inner[last]
    return changed


def run_stages(plan_file: Path, *options: str) -> None:
    """Run all stages of a subject from poses to tip errors by its plan, and check that they succeed."""
    for stage in STAGES:
        argv = [*of_plan(stage, plan_file), *outputs(stage, plan_file.parent), *options]
        assert getattr(stage_runs, stage)(argv) == 0, stage


@dataclass(frozen=True)
class PlannedSubject:
    """Subject 01 in a separate folder; tests that change files use a copy."""

    folder: Path

    @property
    def plan_file(self) -> Path:
        """The file of the subject's plan."""
        return self.folder / "results" / "sub-01" / "plan.json"

    @property
    def plan(self) -> SubjectPlan:
        """The subject's plan."""
        return plan_of_results(self.plan_file)

    def poses(self, task: str, hand: str = "right") -> Path:
        """Return a recording's poses table."""
        return self.plan_file.parent / hand / task / "poses.parquet"

    def truth(self, task: str, hand: str = "right") -> Path:
        """Return the folder of a recording's truth."""
        return self.folder / "raw" / f"{hand}-{task}_truth"

    def fit_folder(self, hand: str = "right", model: str = "quick") -> Path:
        """Return the folder of the tables written by the fit of a model."""
        return self.plan_file.parent / "fits" / hand / model

    def part(self, model: str, made_without: str = "", hand: str = "right") -> Part:
        """Return the key of a skeleton."""
        return Part(hand, model, made_without, "01")

    def copied(self, folder: Path) -> PlannedSubject:
        """Return a copy of the files in another folder, with the plan's paths changed.

        The tables' lists of inputs are removed, so that a test may change one table and keep the others.
        """
        copied = PlannedSubject(Path(shutil.copytree(self.folder, folder / "copy")))
        text = copied.plan_file.read_text("utf-8")
        for old, new in (
            (self.folder, copied.folder),
            *(map(os.path.relpath, (self.folder, copied.folder)),),
        ):
            text = text.replace(str(old), str(new))
        copied.plan_file.write_text(text, "utf-8")
        for table in copied.folder.rglob("*.parquet"):
            _forget_inputs(table)
        return copied

    def run_stages(self) -> None:
        """Fit the hands, run every stage from joints to tips, and make the reference hand."""
        assert self.fit_hands() == 0
        run_stages(self.plan_file)
        assert self.fit_hands(model=REFERENCE) == 0

    def fit(self, hand: str, *options: str, model: str = "quick") -> int:
        """Fit a hand under a model; return the exit code."""
        argv = [*of_plan("fit_hand", self.plan_file), f"--hand={hand}", f"--model={model}"]
        return stage_runs.fit_hand([*argv, f"--out={self.fit_folder(hand, model)}", *options])

    def fit_hands(self, *options: str, model: str = "quick") -> int:
        """Fit every hand under a model in one job, as a study does; return the exit code."""
        hand, *others = self.plan.hands
        folders = [f"--out-other={self.fit_folder(other, model)}" for other in others]
        return self.fit(hand, *options, *folders, model=model)

    def rows(self, path: Path, table: str, part: Part) -> list[Row]:
        """Return the rows of a part of a table."""
        return list(rows_of(read_part(path, TABLES[table], part)))


def _forget_inputs(path: Path) -> None:
    with pq.ParquetFile(path) as file:
        metadata = {**file.metadata.metadata}
        groups = [file.read_row_group(index) for index in range(file.num_row_groups)]
        schema = file.schema_arrow
    if METADATA_KEY in metadata:
        del metadata[b"ARROW:schema"]
        metadata[METADATA_KEY] = json.dumps(json.loads(metadata[METADATA_KEY]) | {"inputs": []}).encode()
        with pq.ParquetWriter(path, schema.with_metadata(metadata)) as writer:
            for group in groups:
                writer.write_table(group, row_group_size=max(1, group.num_rows))


def planned_subject(
    folder: Path,
    recordings: Sequence[tuple[str, ...]],
    models: Sequence[str],
    *,
    n_frames: int,
    seed: int = 4,
    quick: str = QUICK,
    **sheets: Sequence[str],
) -> PlannedSubject:
    """Simulate a subject's recordings and write their poses, truths and the plan.

    recordings : hand, task, role and further cells of each; for tasks that the simulator lacks, the test
    writes the poses. models : names of shipped models, or "quick". quick : the file of that model. sheets :
    tab-separated rows of measurements and touches.
    """
    subject, rows = PlannedSubject(folder), []
    for hand, task, role, *cells in recordings:
        if task in TASK_FRAMES:
            simulated = recorded(hand, task, seed=seed, n_frames=n_frames)[0]
            write_poses(subject.poses(task, hand), simulated, hand, task)
            write_truth(subject.truth(task, hand), simulated, Provenance())
        rows.append(" ".join(["01", hand, task, role, f"raw/{hand}-{task}.parquet", *cells]))
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


@dataclass(frozen=True)
class HandResults:
    """The folder of the tables of a hand processed without a plan."""

    folder: Path

    def path(self, name: str) -> Path:
        """Return a table's file."""
        return self.folder / f"{name}.parquet"

    def rows(self, name: str) -> list[Row]:
        """Return all rows of a table."""
        return list(rows_of(read_table(self.path(name), TABLES[name])))

    def joints(self) -> dict[str, Row]:
        """Return the rows of joint_centres by joint."""
        return {row["joint"]: row for row in self.rows("joint_centres")}

    def errors(self, binding: str = "least-squares") -> dict[str, Row]:
        """Return the rows of tip_errors of the only recording by digit."""
        return {row["digit"]: row for row in self.rows("tip_errors") if row["binding"] == binding}


def recording_numbers(path: Path, table: Table, *which: Any, **more: Any) -> dict[str, Array]:
    """Return the numbers of one recording in a subject's table; see `PartsReader.recording`."""
    with open_parts(path, table) as parts:
        return parts.recording(*which, **more)


def import_recording(
    file: Path, out: Path, *, hand: str = "right", task: str = "task", layout: str = "liberty16"
) -> Path:
    """Import a recording of subject 01 and return its poses table."""
    words = ["import", f"--in={file}", f"--out={out}", f"--layout={layout}", "--subject=01"]
    assert capture([*words, f"--hand={hand}", f"--task={task}"]) == 0
    return out


def run_hand(poses: Path, model: str, folder: Path) -> HandResults:
    """Run all stages from poses to tip errors without a plan, calibrated on the evaluated recording."""
    results = HandResults(folder)
    for stage in STAGES:
        tables = [name for name in stage_runs.reads(stage) if results.path(name).is_file()]
        argv = ["--layout=liberty16", f"--model={model}"]
        argv += [f"{option_of(name)}={results.path(name)}" for name in tables]
        argv += [f"--poses={poses}"] if stage != "project_planes" else []
        argv += [f"--calibration={poses}"] if stage in STAGES[2:] else []
        assert getattr(stage_runs, stage)([*argv, *outputs(stage, folder)]) == 0, stage
    return results
