"""The stages' command lines, run in this process by their names, for tests of all rooms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from shukotsu import command_line
from shukotsu.commands.run_stage import STAGES
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.plan import SubjectPlan, option_of, read_plan
from shukotsu.study.results import FIT_TABLES

Stage = Callable[[Sequence[str]], int]


def _stage(name: str) -> Stage:
    return partial(command_line.run_script, STAGES / f"{name}.py")


align_events = _stage("align_events")
check_recordings = _stage("check_recordings")
compare_models = _stage("compare_models")
compare_movement = _stage("compare_movement")
estimate_metacarpals = _stage("estimate_metacarpals")
evaluate_skeletons = _stage("evaluate_skeletons")
evaluate_tips = _stage("evaluate_tips")
export = _stage("export")
fit_hand = _stage("fit_hand")
gather = _stage("gather")
measure_movement = _stage("measure_movement")
print_figures = _stage("print_figures")
project_planes = _stage("project_planes")
report = _stage("report")
simulate = _stage("simulate")
plan = _stage("plan")
collect_exports = _stage("collect_exports")
export_tables = _stage("export_tables")
subject_pages = _stage("subject_pages")
solve_joints = _stage("solve_joints")

READS: dict[str, Sequence[str]] = {
    "solve_joints": ("findings",),
    "project_planes": ("findings", "joint_solutions"),
    "fit_hand": ("findings",),
    "estimate_metacarpals": ("findings", "projected_joints", "fitted_joints", "fitted_bones", "bone_poses"),
    "evaluate_tips": ("findings", "joint_centres", "bone_lengths", "metacarpals"),
    "evaluate_skeletons": (
        "findings", "joint_centres", "bone_lengths", "metacarpals", "tips", "tip_errors", "posed_tips",
        "bone_poses", "fitted_joints", "fitted_bones",
    ),
    "measure_movement": (
        "findings", "joint_centres", "bone_lengths", "metacarpals", "joint_angles", "posed_tips",
        "bone_poses", "moved_receivers",
    ),
}  # fmt: skip
"""Tables of a subject that a stage reads, as its rule names them."""


WRITES = {
    "check_recordings": {"out": "findings"},
    "align_events": {"out": "events", "out-clocks": "clocks"},
    "solve_joints": {"out": "joint_solutions"},
    "project_planes": {"out": "projected_joints"},
    "estimate_metacarpals": {"out-joints": "joint_centres", "out-bones": "bone_lengths"}
    | {"out": "metacarpals"},
    "evaluate_tips": {"out": "tips", "out-errors": "tip_errors"},
    "evaluate_skeletons": {"out": "skeleton_scores", "out-joints": "joint_errors"},
}
"""Tables that a stage writes, by the names of its options."""


def outputs(stage: str, folder: Path) -> list[str]:
    """Return the options of a stage that name what it writes into a folder: tables, or the folder itself."""
    if stage not in WRITES:
        return [f"--out={folder}"]
    return [f"--{option}={folder / table}.parquet" for option, table in WRITES[stage].items()]


def of_plan(stage: str, plan_file: Path) -> list[str]:
    """Return the options of a stage that name a plan and those of the tables beside it that are there."""
    plan = read_plan(plan_file)
    options = [f"--plan={plan_file}"]
    for name in READS.get(stage, ()):
        files = list(filter(Path.is_file, _files(plan, name)))
        options += [option_of(name), *map(str, files)] if files else []
    return options


def _files(plan: SubjectPlan, name: str) -> Iterable[Path]:
    if name not in FIT_TABLES:
        return [plan.table(name)]
    models = (*plan.fitted_models, REFERENCE)
    return [plan.table(name, hand, model) for hand in plan.hands for model in models]
