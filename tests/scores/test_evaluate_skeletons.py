"""The evaluate_skeletons stage on one of the paper's skeletons and a fitted hand."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_study import PlannedSubject, planned_subject
from stage_runs import evaluate_skeletons as main
from stage_runs import of_plan, outputs

from shukotsu.study.config_files import REFERENCE
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import JOINT_CENTRES, JOINT_ERRORS, SKELETON_SCORES, TABLES, TIPS, table_in
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.typed_table import Provenance, read_table, rows_of

pytestmark = pytest.mark.slow

LAYOUT = read_layout("liberty16")
DIGITS = tuple(LAYOUT.digits)
TIP = ["tip_x_mm", "tip_y_mm", "tip_z_mm"]
REFERENCES = ("prior-only", "distal-receiver", "true-skeleton")
WHOLE = {"paper-fig4": "opposition", "quick": "rom;opposition"}
N_FRAMES = 39
Row = dict[str, Any]
Results = tuple[list[Row], list[Row]]


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> PlannedSubject:
    """A right hand with paper-fig4 and a whole-hand model, made from all tasks and without the evaluated
    one.
    """
    folder = tmp_path_factory.mktemp("subject")
    recordings = [("right", "rom", "calibration"), ("right", "opposition", "both")]
    planned = planned_subject(folder, recordings, ["paper-fig4", "quick"], n_frames=N_FRAMES)
    planned.run_stages()
    return planned


def run(subject: PlannedSubject, out: Path, *options: str) -> int:
    stage = "evaluate_skeletons"
    return main([*of_plan(stage, subject.plan_file), *outputs(stage, out), *options])


def evaluated(subject: PlannedSubject, out: Path) -> Results:
    assert run(subject, out) == 0
    part = Part("right", subject="01")
    tables = [out / f"{table.name}.parquet" for table in (SKELETON_SCORES, JOINT_ERRORS)]
    assert all(list(part_metadata(path, TABLES[path.stem])) == [part] for path in tables)
    scores, errors = (list(rows_of(read_table(path, TABLES[path.stem]))) for path in tables)
    return scores, errors


@pytest.fixture(scope="module")
def results(subject: PlannedSubject, tmp_path_factory: pytest.TempPathFactory) -> Results:
    return evaluated(subject, tmp_path_factory.mktemp("scores"))


def of(rows: list[Row], model: str, calibrated_on: str = "rom") -> dict[str, Row]:
    keys = (model, "" if model in REFERENCES else calibrated_on)
    return {row["digit"]: row for row in rows if (row["model"], row["calibrated_on"]) == keys}


def changed(path: Path, change: Callable[[Part, list[Row]], str]) -> None:
    """Rewrite a table; `change` edits a part's rows in place or returns the message of its failure."""
    table = table_in(path.stem)
    metadata = part_metadata(path, table)
    rows = {part: list(rows_of(read_part(path, table, part))) for part in metadata}
    with parts_writer(path, table, Provenance()) as write:
        for part, part_rows in rows.items():
            if message := change(part, part_rows):
                write.failure(part, message)
            else:
                write.rows(part, part_rows, **metadata[part])


def test_every_skeleton_and_reference_has_a_row_per_digit(results: Results) -> None:
    """Each row states whether the recording was held out."""
    scores, errors = results
    for table, rows in ((SKELETON_SCORES, scores), (JOINT_ERRORS, errors)):
        keys = [tuple(row[name] for name in table.key) for row in rows]
        assert len(set(keys)) == len(keys)
    skeletons = {(row["model"], row["task"], row["calibrated_on"], row["held_out"]) for row in scores}
    expected = {(name, "opposition", "", True) for name in REFERENCES}
    for model, calibrated_on in WHOLE.items():
        expected |= {(model, "opposition", calibrated_on, False), (model, "opposition", "rom", True)}
    assert skeletons == expected
    for model, _, calibrated_on, _ in skeletons:
        assert tuple(of(scores, model, calibrated_on)) == DIGITS
    assert {row["model"] for row in scores if row["reference"]} == set(REFERENCES)
    assert {row["message"] for row in scores} == {""}


def test_a_fitted_hands_tables_equal_those_of_its_fit(subject: PlannedSubject) -> None:
    """Joints, lengths and metacarpal postures are copied, including gaps."""
    part, fitted = subject.part("quick"), subject.fit_folder()
    for name, table, key, columns in (
        ("fitted_joints", "joint_centres", "joint", ("child_x_mm", "parent_x_mm", "status")),
        ("fitted_bones", "bone_lengths", "bone", ("starts_at", "ends_at", "length_mm", "sd_mm")),
    ):
        rows = {row[key]: row for row in subject.rows(subject.plan.table(table), table, part)}
        fitted_rows = list(rows_of(read_part(fitted / f"{name}.parquet", table_in(name), part)))
        assert fitted_rows
        for row in fitted_rows:
            assert [rows[row[key]][column] for column in columns] == [row[column] for column in columns]
    turns = [f"q{axis}" for axis in "wxyz"]
    bones = subject.rows(fitted / "bone_poses.parquet", "bone_poses", part)
    posed = {(row["task"], row["segment"], row["frame"]): [row[turn] for turn in turns] for row in bones}
    for row in subject.rows(subject.plan.table("metacarpals"), "metacarpals", part):
        expected = posed[row["task"], f"{row['digit']}_metacarpal", row["frame"]]
        assert [row[turn] for turn in turns] == expected
        assert (row["flags"] == "gap") == (expected[0] is None)


def test_the_replays_scores_equal_tip_errors(subject: PlannedSubject, results: Results) -> None:
    part = subject.part("paper-fig4", "opposition")
    for row in subject.rows(subject.plan.table("tip_errors"), "tip_errors", part):
        if row["binding"] == "least-squares":
            score = of(results[0], "paper-fig4")[row["digit"]]
            assert score["replay_mean_mm"] == score["left_out_mean_mm"] == pytest.approx(row["mean_mm"])
            assert score["replay_p95_mm"] == score["left_out_p95_mm"] == pytest.approx(row["p95_mm"])
            assert (score["posed_mean_mm"], score["n_frames"]) == (None, row["n_frames"])


def test_scores_against_the_truth_equal_direct_comparisons(subject: PlannedSubject, results: Results) -> None:
    """Tip errors are recomputed from the tables of tips and of the truth."""
    true = read_table(subject.truth("opposition") / "tips.parquet", TIPS).to_pandas()
    for model, path in (
        ("paper-fig4", subject.plan.table("tips")),
        ("quick", subject.fit_folder() / "posed_tips.parquet"),
    ):
        tips = read_part(path, TABLES[path.stem], subject.part(model, "opposition")).to_pandas()
        both = tips.merge(true, on=["digit", "frame"], suffixes=("", "_true"))
        apart = both[TIP].to_numpy() - both[[f"{name}_true" for name in TIP]].to_numpy()
        both["off"] = np.linalg.norm(apart, axis=1)
        for digit, off in both.groupby("digit")["off"]:
            row = of(results[0], model)[str(digit)]
            assert len(off) == N_FRAMES
            assert row["true_tip_mean_mm"] == pytest.approx(off.mean())
            assert row["true_tip_p95_mm"] == pytest.approx(np.percentile(off, 95))
            assert 0 < row["metacarpal_deg"] < 30


def test_a_fitted_hand_predicts_the_true_tips(results: Results) -> None:
    """The fitted hand is closer to the true tips than the distal receivers and the paper's skeleton are, and
    its left-out error is larger than its posed error.
    """
    mean = {
        model: np.mean([row["true_tip_mean_mm"] for row in of(results[0], model).values()])
        for model in ("true-skeleton", "quick", "distal-receiver", "paper-fig4")
    }
    assert mean["true-skeleton"] < 1.0 < mean["quick"] < 5.0 < mean["distal-receiver"]
    assert mean["paper-fig4"] > 5.0
    for row in of(results[0], "quick").values():
        assert 0 < row["posed_mean_mm"] < row["left_out_mean_mm"] < 2.0
        assert row["n_frames"] == N_FRAMES
    for model in ("paper-fig4", "quick"):
        assert all(0 < row["wrist_mcp_sd_mm"] < 5 for row in of(results[0], model).values())


def test_joints_are_compared_with_the_truth(subject: PlannedSubject, results: Results) -> None:
    """Every solved joint is compared under every model and the prior; errors equal those from the tables."""
    table = read_table(subject.truth("rom") / "joint_centres.parquet", JOINT_CENTRES)
    true = {row["joint"]: row for row in rows_of(table)}
    by_model: dict[str, dict[str, Row]] = {}
    for row in results[1]:
        if row["calibrated_on"] in ("", "rom"):
            by_model.setdefault(row["model"], {})[row["joint"]] = row
    assert set(by_model) == {"paper-fig4", "quick", "prior-only"}
    for model, rows in by_model.items():
        assert set(rows) == set(true) - {"wrist"}, model
        assert {name for name, row in rows.items() if row["axis_deg"] is not None} == {
            name for name in rows if name.endswith(("_pip", "_dip", "_ip"))
        }
    part = subject.part("paper-fig4", "opposition")
    for row in subject.rows(subject.plan.table("joint_centres"), "joint_centres", part):
        if row["joint"] != "wrist":
            off = [row[f"child_{axis}_mm"] - true[row["joint"]][f"child_{axis}_mm"] for axis in "xyz"]
            error = by_model["paper-fig4"][row["joint"]]
            assert error["error_mm"] == pytest.approx(np.linalg.norm(off))
            assert np.hypot(error["along_mm"], error["across_mm"]) == pytest.approx(error["error_mm"])
    assert by_model["paper-fig4"]["index_dip"]["bone"] == ""
    assert by_model["quick"]["index_dip"]["bone"] == "index_distal"
    assert by_model["prior-only"]["index_pip"]["bone"] == "index_middle"
    assert {row["within_95"] for row in by_model["prior-only"].values()} == {None}
    assert np.mean([row["within_95"] for row in by_model["quick"].values()]) > 0.6
    assert np.median([row["error_mm"] for row in by_model["quick"].values()]) < 2.5


def test_failed_parts_lose_only_their_own_numbers(subject: PlannedSubject, tmp_path: Path) -> None:
    """Their rows remain with the reasons, and the other skeletons keep their numbers."""
    copy = subject.copied(tmp_path)
    paper = copy.part("paper-fig4", "opposition")
    for name, message in (("joint_centres", "the dog ate it"), ("tips", "no tips")):
        changed(copy.plan.table(name), lambda part, _, text=message: text if part == paper else "")
    changed(copy.fit_folder() / "posed_tips.parquet", lambda *_: "not posed")
    changed(copy.fit_folder(model=REFERENCE) / "fitted_joints.parquet", lambda *_: "no prior")
    scores, errors = evaluated(copy, tmp_path)
    for digit in DIGITS:
        row = of(scores, "paper-fig4")[digit]
        assert (row["replay_mean_mm"], row["wrist_mcp_sd_mm"], row["n_frames"]) == (None, None, 0)
        assert row["metacarpal_deg"] is not None
        assert row["message"] == "the dog ate it; no tips"
        assert of(scores, "paper-fig4", WHOLE["paper-fig4"])[digit]["message"] == ""
        row = of(scores, "quick")[digit]
        assert row["message"] == "not posed"
        assert row["replay_mean_mm"] is not None
        assert (row["posed_mean_mm"], row["left_out_mean_mm"], row["true_tip_mean_mm"]) == (None, None, None)
        row = of(scores, "prior-only")[digit]
        assert (row["message"], row["posed_mean_mm"], row["n_frames"]) == ("no prior", None, 0)
    null = {(row["model"], row["calibrated_on"]) for row in errors if row["error_mm"] is None}
    assert null == {("paper-fig4", "rom"), ("prior-only", "")}
