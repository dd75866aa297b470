"""A bug in any stage of a subject, in a part of it or outside: the study ends with a report that names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from planned_subject import PlannedSubject, planned_subject

from schemas.catalogue import PROBLEMS
from schemas.results import Results
from schemas.tables import read_table, rows_of
from stages.align_events.__main__ import main as align_events
from stages.check_recordings.__main__ import main as check_recordings
from stages.estimate_metacarpals.__main__ import main as estimate_metacarpals
from stages.evaluate_skeletons.__main__ import main as evaluate_skeletons
from stages.evaluate_tips.__main__ import main as evaluate_tips
from stages.export.__main__ import main as export
from stages.fit_hand.__main__ import main as fit_hand
from stages.fit_hand.prior import main as fit_prior
from stages.gather.__main__ import main as gather
from stages.measure_movement.__main__ import main as measure_movement
from stages.project_planes.__main__ import main as project_planes
from stages.report.__main__ import main as report
from stages.report.subject import main as subject_pages
from stages.solve_joints.__main__ import main as solve_joints
from stages.solve_joints.check_calibration import main as check_calibration

pytestmark = pytest.mark.slow

BUILT = {"joints": "joint_centres", "bones": "bone_lengths", "metacarpals": "metacarpals"}
STAGES: dict[str, tuple[Callable[[list[str]], int], dict[str, str]]] = {
    "check_recordings": (check_recordings, {"out": "findings"}),
    "align_events": (align_events, {"out": "events", "out-clocks": "clocks"}),
    "solve_joints.check_calibration": (check_calibration, {"out": "calibration_advice"}),
    "solve_joints": (solve_joints, {"out": "joint_solutions"}),
    "project_planes": (project_planes, {"joints": "joint_solutions", "out": "projected_joints"}),
    "fit_hand": (fit_hand, {}),
    "fit_hand.prior": (fit_prior, {}),
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
    "check_recordings": "stages.command_line.checked_poses",
    "align_events": "stages.align_events.recording_events.RecordingEvents.aligned",
    "solve_joints.check_calibration": "stages.solve_joints.calibration_advice.advise",
    "solve_joints": "stages.solve_joints.part_solutions.solution_rows",
    "project_planes": "stages.project_planes.place.place_joint",
    "fit_hand": "stages.fit_hand.calibration.fit_hand",
    "fit_hand.prior": "stages.fit_hand.prior.fit_prior",
    "estimate_metacarpals": "stages.estimate_metacarpals.hand.build_hand",
    "evaluate_tips": "stages.evaluate_tips.tip_tables.replay_recording",
    "evaluate_skeletons": "stages.evaluate_skeletons.evaluation.evaluate_hand",
    "measure_movement": "stages.measure_movement.recorded_movement.RecordedMovement.angles",
    "export": "stages.export.__main__.write_format",
    "report.subject": "stages.report.recording_page.recording_content.recording_page",
}
OUTSIDE = {
    **dict.fromkeys(STAGES, "stages.command_line.poses_files"),
    "project_planes": "stages.command_line.provenance_of",
    "export": "stages.export.plan_selection.chosen_recordings",
    "report.subject": "stages.report.study_results.read_subject",
}


def run(subject: PlannedSubject, stage: str) -> None:
    """Run one stage of the subject as a study does; a failure fails the test."""
    main, tables = STAGES[stage]
    folder = subject.plan_file.parent
    files = [f"--{option}={folder / name}.parquet" for option, name in tables.items()]
    own = [f"--plan={subject.plan_file}", "--record-failure", *files]
    if stage == "fit_hand":
        for hand in subject.plan.hands:
            assert main([*own, f"--hand={hand}", "--model=quick", f"--out={subject.fit_folder(hand)}"]) == 0
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
    sound: PlannedSubject,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stage: str,
    places: dict[str, str],
) -> None:
    subject = sound.copied(tmp_path)
    results, study = Results(subject.plan_file.parent.parent), f"--study={subject.folder / 'study.yaml'}"
    with monkeypatch.context() as planted:
        planted.setattr(places[stage], raising)
        run(subject, stage)
    after = [*STAGES]
    for later in after[after.index(stage) + 1 :]:
        run(subject, later)
    assert gather([study, f"--results={results.folder}"]) == 0
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
        name = {"fit_hand.prior": "fit_prior"}.get(stage, stage.rpartition(".")[2])
        assert {(row["subject"], row["stage"]) for row in problems} == {("01", name)}
    for pages in ("subject.html", "right/rom.html"):
        assert results.subject_pages("01").joinpath(pages).is_file()
