"""A study with a bug in any stage still ends with a report that names the bug."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import stage_runs
from small_study import PlannedSubject, planned_subject
from stage_runs import of_plan, outputs, subject_pages

from shukotsu.study.config_files import REFERENCE
from shukotsu.study.results import Results
from shukotsu.tables.catalogue import PROBLEMS
from shukotsu.tables.typed_table import read_table, rows_of

pytestmark = pytest.mark.slow

STAGES: dict[str, Sequence[str]] = {
    "check_recordings": (),
    "align_events": (),
    **dict.fromkeys(("solve_joints", "project_planes", "fit_hand", "estimate_metacarpals"), ()),
    **dict.fromkeys(("evaluate_tips", "evaluate_skeletons"), ()),
    "measure_movement": ("--events={}/events.parquet",),
    "export": ("--formats=csv", "--out={}/exports"),
    "subject_pages": (),
}
IN_A_PART = {
    "check_recordings": "shukotsu.checks.checked_subject.checked_poses",
    "align_events": "shukotsu.movement.recording_events.RecordingEvents.aligned",
    "solve_joints": "shukotsu.paper.part_solutions.solution_rows",
    "project_planes": "shukotsu.paper.plane.place_joint",
    "fit_hand": "shukotsu.fit.calibration.fit_hand",
    "estimate_metacarpals": "shukotsu.paper.skeleton.build_hand",
    "evaluate_tips": "shukotsu.paper.replay.replay_recording",
    "evaluate_skeletons": "shukotsu.scores.evaluation.evaluate_hand",
    "measure_movement": "shukotsu.hand.recorded_movement.RecordedMovement.joints",
    "export": "shukotsu.export.exported_plans.write_format",
    "subject_pages": "shukotsu.report.subject_page.recording_page",
}
OUTSIDE = {
    **dict.fromkeys(STAGES, "shukotsu.study.subject_stage.poses_files"),
    "project_planes": "shukotsu.study.subject_stage.provenance_of",
    "export": "shukotsu.export.exported_plans.chosen_recordings",
    "subject_pages": "shukotsu.report.subject_page.read_subject",
}
TOGETHER = (
    ("check_recordings", "solve_joints"),
    ("align_events", "project_planes"),
    ("fit_hand", "evaluate_tips", "subject_pages"),
    ("estimate_metacarpals",),
    ("evaluate_skeletons", "measure_movement", "export"),
)
"""Groups of stages whose bugs are planted in the same study, as none prevents the others from running."""


def run(subject: PlannedSubject, stage: str) -> None:
    """Run one stage of the subject as a study does, and check that it succeeds."""
    folder = subject.plan_file.parent
    argv = [*of_plan(stage, subject.plan_file), "--record-failure"]
    argv += [option.format(folder) for option in STAGES[stage]]
    if stage == "fit_hand":
        for model in ("quick", REFERENCE):
            assert subject.fit_hands("--record-failure", model=model) == 0
    elif stage == "subject_pages":
        assert subject_pages([*argv, f"--out={Results(folder.parent).subject_pages('01')}"]) == 0
    else:
        argv += outputs(stage, folder) if stage != "export" else []
        assert getattr(stage_runs, stage)(argv) == 0


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> PlannedSubject:
    recordings, models = [("right", "rom", "both")], ["paper-fig4", "quick"]
    subject = planned_subject(tmp_path_factory.mktemp("sound"), recordings, models, n_frames=90)
    for stage in STAGES:
        run(subject, stage)
    return subject


def raising(*_: Any, **__: Any) -> None:
    raise RuntimeError("planted")


@pytest.mark.parametrize("places", [IN_A_PART, OUTSIDE], ids=["in-a-part", "outside"])
@pytest.mark.parametrize("stages", TOGETHER, ids=" and ".join)
def test_the_study_ends_with_a_report_that_names_the_bug(
    sound: PlannedSubject,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stages: Sequence[str],
    places: dict[str, str],
) -> None:
    subject = sound.copied(tmp_path)
    results, study = Results(subject.plan_file.parent.parent), f"--study={subject.folder / 'study.yaml'}"
    every = [*STAGES]
    for stage in every[every.index(stages[0]) :]:
        if stage == "fit_hand" and not {"check_recordings", stage} & {*stages}:
            continue  # of all tables it reads findings only, so that it would be the same
        with monkeypatch.context() as planted:
            if stage in stages:
                planted.setattr(places[stage], raising)
            run(subject, stage)
    for make in (stage_runs.gather, stage_runs.compare_models):
        assert make([study, f"--results={results.folder}"]) == 0
    assert stage_runs.report([study, f"--results={results.folder}", f"--out={results.report}"]) == 0
    page = results.report.read_text("utf-8")
    problems = [*rows_of(read_table(results.study_table("problems"), PROBLEMS))]
    for stage in stages:
        sentence = f"internal error in {stage} (RuntimeError: planted); please report it with the log"
        if stage == "export":
            files = (subject.plan_file.parent / "exports").glob("*.failed.txt")
            assert {file.read_text() for file in files} == {f"{sentence}\n"}
            continue
        assert sentence in page
        if stage != "subject_pages":
            named = [row for row in problems if sentence in row["message"]]
            assert {(row["subject"], row["stage"]) for row in named} == {("01", stage)}
    for pages in ("subject.html", "right/rom.html"):
        assert results.subject_pages("01").joinpath(pages).is_file()
