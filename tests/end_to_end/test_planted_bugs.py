"""A bug in any stage of a subject, in a part of it or outside: the study ends with a report that names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from planned_subject import PlannedSubject, planned_subject

from shukotsu.schemas.catalogue import PROBLEMS
from shukotsu.schemas.config_files import REFERENCE
from shukotsu.schemas.results import Results
from shukotsu.schemas.tables import read_table, rows_of
from shukotsu.stages.align_events.__main__ import main as align_events
from shukotsu.stages.check_recordings.__main__ import main as check_recordings
from shukotsu.stages.compare_models.__main__ import main as compare_models
from shukotsu.stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from shukotsu.stages.evaluate_skeletons.__main__ import main as evaluate_skeletons
from shukotsu.stages.evaluate_tips.__main__ import main as evaluate_tips
from shukotsu.stages.export.__main__ import main as export
from shukotsu.stages.fit_hand.__main__ import main as fit_hand
from shukotsu.stages.gather.__main__ import main as gather
from shukotsu.stages.measure_movement.__main__ import main as measure_movement
from shukotsu.stages.project_planes.__main__ import main as project_planes
from shukotsu.stages.report.__main__ import main as report
from shukotsu.stages.report.subject import main as subject_pages
from shukotsu.stages.solve_joints.__main__ import main as solve_joints

pytestmark = pytest.mark.slow

BUILT = {"joints": "joint_centres", "bones": "bone_lengths", "metacarpals": "metacarpals"}
STAGES: dict[str, tuple[Callable[[list[str]], int], dict[str, str]]] = {
    "check_recordings": (check_recordings, {"out": "findings"}),
    "align_events": (align_events, {"out": "events", "out-clocks": "clocks"}),
    "solve_joints": (solve_joints, {"out": "joint_solutions"}),
    "project_planes": (project_planes, {"joints": "joint_solutions", "out": "projected_joints"}),
    "fit_hand": (fit_hand, {}),
    "estimate_metacarpals": (
        estimate_metacarpals,
        {"joints": "projected_joints", "out-joints": "joint_centres", "out-bones": "bone_lengths"}
        | {"out": "metacarpals"},
    ),
    "evaluate_tips": (evaluate_tips, {**BUILT, "out": "tips", "out-errors": "tip_errors"}),
    "evaluate_skeletons": (evaluate_skeletons, {"out": "skeleton_scores", "out-joints": "joint_errors"}),
    "measure_movement": (measure_movement, {"events": "events"}),
    "export": (export, {}),
    "report.subject": (subject_pages, {}),
}
"""In their order: the command line, and its tables by option."""

IN_A_PART = {
    "check_recordings": "shukotsu.checks.checked_poses.checked_poses",
    "align_events": "shukotsu.stages.align_events.recording_events.RecordingEvents.aligned",
    "solve_joints": "shukotsu.stages.solve_joints.part_solutions.solution_rows",
    "project_planes": "shukotsu.stages.project_planes.place.place_joint",
    "fit_hand": "shukotsu.stages.fit_hand.calibration.fit_hand",
    "estimate_metacarpals": "shukotsu.stages.estimate_metacarpals.hand.build_hand",
    "evaluate_tips": "shukotsu.stages.evaluate_tips.tip_tables.replay_recording",
    "evaluate_skeletons": "shukotsu.stages.evaluate_skeletons.evaluation.evaluate_hand",
    "measure_movement": "shukotsu.anatomy.recorded_movement.RecordedMovement.joints",
    "export": "shukotsu.stages.export.__main__.write_format",
    "report.subject": "shukotsu.stages.report.recording_page.recording_content.recording_page",
}
OUTSIDE = {
    **dict.fromkeys(STAGES, "shukotsu.stages.subject_stage.poses_files"),
    "project_planes": "shukotsu.stages.subject_stage.provenance_of",
    "export": "shukotsu.stages.export.plan_selection.chosen_recordings",
    "report.subject": "shukotsu.stages.report.study_results.read_subject",
}


def run(subject: PlannedSubject, stage: str) -> None:
    """Run one stage of the subject as a study does; a failure fails the test."""
    main, tables = STAGES[stage]
    folder = subject.plan_file.parent
    files = [f"--{option}={folder / name}.parquet" for option, name in tables.items()]
    own = [f"--plan={subject.plan_file}", "--record-failure", *files]
    if stage == "fit_hand":
        for hand in subject.plan.hands:
            for model in ("quick", REFERENCE):
                out = f"--out={subject.fit_folder(hand, model)}"
                assert main([*own, f"--hand={hand}", f"--model={model}", out]) == 0
    elif stage == "export":
        assert main([*own, "--formats=csv", f"--out={folder / 'exports'}"]) == 0
    elif stage == "report.subject":
        assert main([*own, f"--out={Results(folder.parent).subject_pages('01')}"]) == 0
    else:
        assert main([*own, *([] if "out" in tables else [f"--out={folder}"])]) == 0


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> PlannedSubject:
    """A subject of whom every stage was run."""
    recordings = [("right", "rom", "both"), ("left", "rom", "calibration")]
    subject = planned_subject(
        tmp_path_factory.mktemp("sound"), recordings, ["paper-fig4", "quick"], n_frames=90
    )
    for stage in STAGES:
        run(subject, stage)
    return subject


def raising(*_: Any, **__: Any) -> None:
    raise RuntimeError("planted")


@pytest.mark.parametrize("places", [IN_A_PART, OUTSIDE], ids=["in-a-part", "outside"])
@pytest.mark.parametrize("stage", STAGES)
def test_the_study_ends_with_a_report_that_names_it(
    sound: PlannedSubject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stage: str, places: dict[str, str]
) -> None:
    subject = sound.copied(tmp_path)
    results, study = Results(subject.plan_file.parent.parent), f"--study={subject.folder / 'study.yaml'}"
    with monkeypatch.context() as planted:
        planted.setattr(places[stage], raising)
        run(subject, stage)
    after = [*STAGES]
    for later in after[after.index(stage) + 1 :]:
        run(subject, later)
    for make in (gather, compare_models):
        assert make([study, f"--results={results.folder}"]) == 0
    assert report([study, f"--results={results.folder}", f"--out={results.report}"]) == 0
    sentence = f"internal error in {stage} (RuntimeError: planted); please report it with the log"
    if stage == "export":
        (text,) = {file.read_text() for file in (subject.plan_file.parent / "exports").glob("*.failed.txt")}
        assert text == f"{sentence}\n"
        return
    page = results.report.read_text("utf-8")
    assert sentence in page
    if stage != "report.subject":
        problems = [
            row
            for row in rows_of(read_table(results.study_table("problems"), PROBLEMS))
            if sentence in row["message"]
        ]
        assert {(row["subject"], row["stage"]) for row in problems} == {("01", stage.rpartition(".")[2])}
    for pages in ("subject.html", "right/rom.html"):
        assert results.subject_pages("01").joinpath(pages).is_file()
