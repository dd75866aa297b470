"""A faulty recording of one hand leaves all results of the other as if that hand had not been recorded."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pytest
import stage_runs
from small_study import PlannedSubject, planned_subject, run_stages
from stage_runs import of_plan, outputs

from shukotsu.study.config_files import REFERENCE
from shukotsu.study.findings import SUSPECT, finding_of_text
from shukotsu.study.results import FIT_TABLES, SUBJECT_TABLES
from shukotsu.tables.catalogue import FINDINGS, POSES, TABLES, table_in
from shukotsu.tables.parts import part_metadata
from shukotsu.tables.typed_table import Provenance, columns_from_rows, read_table, write_failure, write_table

pytestmark = pytest.mark.slow

RIGHT = [("right", "rom", "calibration"), ("right", "opposition", "both")]
LEFT = [("left", "rom", "calibration"), ("left", "opposition", "evaluation")]
MODELS = ("paper-fig4", "quick")
WRITTEN = [name for name in SUBJECT_TABLES if name not in ("findings", "events", "clocks")]
MAY_BE_EMPTY = ("movement_cycles", "cycle_curves", "moved_receivers", "event_strokes")
ALONE = "fitted without the left hand's bone lengths: "


def write_finding(subject: PlannedSubject, **finding: str) -> None:
    keys = {"subject": "01", "session": "", "hand": "left", "trial": ""}
    rows = [keys | finding_of_text("units", SUSPECT, "In inch.").columns | finding] if finding else []
    table = subject.plan_file.with_name("findings.parquet")
    write_table(table, FINDINGS, columns_from_rows(FINDINGS, rows), Provenance())


def run(subject: PlannedSubject) -> PlannedSubject:
    """Run all stages of the subject after the findings, as a study does."""
    folder = subject.plan_file.parent
    for model in ("quick", REFERENCE):
        assert subject.fit_hands("--record-failure", model=model) == 0
    run_stages(subject.plan_file, "--record-failure")
    for stage in ("evaluate_skeletons", "measure_movement"):
        argv = [*of_plan(stage, subject.plan_file), "--record-failure", *outputs(stage, folder)]
        assert getattr(stage_runs, stage)(argv) == 0
    return subject


def recorded_subject(folder: Path, recordings: Sequence[tuple[str, str, str]]) -> PlannedSubject:
    return planned_subject(folder, recordings, MODELS, n_frames=100)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> PlannedSubject:
    """The right hand of a person without recordings of the left hand."""
    subject = recorded_subject(tmp_path_factory.mktemp("alone"), RIGHT)
    write_finding(subject)
    return run(subject)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the same person with both hands, before any stage was run."""
    return recorded_subject(tmp_path_factory.mktemp("both"), RIGHT + LEFT).folder


def of_the_right_hand(subject: PlannedSubject, name: str) -> pa.Table:
    path = subject.plan_file.with_name(f"{name}.parquet")
    if name in FIT_TABLES:
        path = subject.fit_folder() / path.name
    table = read_table(path, table_in(name)).replace_schema_metadata(None)
    return table.filter(pc.equal(table.column("hand"), "right"))


def notes(subject: PlannedSubject, hand: str = "right") -> set[str]:
    parts = part_metadata(subject.fit_folder(hand) / "receivers.parquet", TABLES["receivers"])
    return {part.get("note", "") for part in parts.values()}


def assert_right_hand_equals_one_alone(subject: PlannedSubject, alone: PlannedSubject) -> None:
    for name in (*WRITTEN, *FIT_TABLES):
        expected = of_the_right_hand(alone, name)
        assert expected.num_rows or name in MAY_BE_EMPTY, name
        assert of_the_right_hand(subject, name).equals(expected), name


@pytest.mark.parametrize(
    ("task", "severity"), [("rom", "suspect"), ("rom", "refused"), ("opposition", "suspect")]
)
def test_a_finding_on_one_hand_does_not_change_the_other(
    both: Path, alone: PlannedSubject, tmp_path: Path, task: str, severity: str
) -> None:
    subject = PlannedSubject(both).copied(tmp_path)
    write_finding(subject, task=task, severity=severity)
    assert_right_hand_equals_one_alone(run(subject), alone)
    assert notes(subject) == {f"{ALONE}there is a finding on the left hand's {task}"}


def test_an_unreadable_recording_does_not_change_the_other_hand(
    both: Path, alone: PlannedSubject, tmp_path: Path
) -> None:
    subject = PlannedSubject(both).copied(tmp_path)
    write_finding(subject)
    parameters = {"subject": "01", "hand": "left", "task": "opposition", "trial": ""}
    write_failure(subject.poses("opposition", "left"), POSES, "b.csv: is cut", Provenance((), parameters))
    assert_right_hand_equals_one_alone(run(subject), alone)
    assert notes(subject) == {f"{ALONE}b.csv: is cut"}


def test_hands_without_findings_share_their_lengths(
    both: Path, alone: PlannedSubject, tmp_path: Path
) -> None:
    subject = PlannedSubject(both).copied(tmp_path)
    write_finding(subject, task="rom", severity="note")
    assert subject.fit("right") == 0
    assert notes(subject) == {""}
    sds = [
        of_the_right_hand(person, "fitted_bones").column("sd_mm").to_pylist() for person in (subject, alone)
    ]
    assert all(shared < single for shared, single in zip(*sds, strict=True))
