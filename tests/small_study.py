"""A small study on disk: its file and sheets, simulated poses and plans, and its stages in this process."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pipeline
import stage_runs
from stage_runs import of_plan, outputs

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.study.plan import StudyPlans, SubjectPlan, plan_text, read_plan
from shukotsu.study.results import Results
from shukotsu.study.study import read_study
from shukotsu.tables.whole_files import write_text

HEADER = "subject\thand\ttask\trole\tfile\ttrial\tlayout\texclude\taccept"


def write_study(
    folder: Path, *rows: str, models: Sequence[str] = ("rigid", "paper-fig4"), more: str = "", **sheets: str
) -> Path:
    """Write a study file whose recordings are the rows, their cells separated by blanks ('-' is empty).

    sheets : text of participants, corrections, measurements and touches, blanks for tabs. more : more lines
    of the study file.
    """
    sheet_folder = folder / "sheets"
    sheet_folder.mkdir(parents=True, exist_ok=True)
    lines = ["\t".join("" if cell == "-" else cell for cell in row.split(" ")) for row in rows]
    (sheet_folder / "recordings.tsv").write_text("\n".join([HEADER, *lines]), "utf-8")
    for name, text in sheets.items():
        (sheet_folder / f"{name}.tsv").write_text(text.replace(" ", "\t"), "utf-8")
        more += f"{name}: sheets/{name}.tsv\n"
    file = folder / "study.yaml"
    file.write_text(
        f"study: test\nrecordings: sheets/recordings.tsv\nlayout: liberty16\nmodels: [{', '.join(models)}]\n"
        + more
    )
    return file


def put(config: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """Return the configuration with one key, by its dotted path, set; None takes it out."""
    changed = copy.deepcopy(config)
    *groups, last = key.split(".")
    inner = changed
    for group in groups:
        inner = inner.setdefault(group, {})
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return changed


def write_plans(study_file: Path) -> dict[str, Path]:
    """Write the plan of every subject, results beside the study file; give the files by subject."""
    study, results = read_study(study_file), Results(study_file.parent / "results")
    plans = StudyPlans(study, results.folder)
    for subject in study.subjects:
        write_text(results.plan(subject), plan_text(plans.content(subject)))
    return {subject: results.plan(subject) for subject in study.subjects}


def write_poses(plan: SubjectPlan, n_frames: int = 300) -> None:
    """Simulate every recording of a plan that is not excluded, and import it."""
    for index, recording in enumerate(plan.recordings):
        if not recording.exclude:
            file = plan.poses(recording).with_name("recording.parquet")
            hand = recording.hand
            made = simulate(hand.subject, hand.hand, "rom", 5 + index, Realism.full(), n_frames)
            write_recording(file, made)
            pipeline.import_recording(
                file, plan.poses(recording), subject=hand.subject, hand=hand.hand, task=recording.task
            )


def run_stages(plan_file: Path, *options: str) -> SubjectPlan:
    """Run every stage of a subject from poses to tip errors by its plan; a failure fails the test."""
    plan = read_plan(plan_file)
    for stage in ("solve_joints", "project_planes", "estimate_metacarpals", "evaluate_tips"):
        argv = [*of_plan(stage, plan_file), *outputs(stage, plan.folder), *options]
        assert getattr(stage_runs, stage)(argv) == 0, stage
    return plan
