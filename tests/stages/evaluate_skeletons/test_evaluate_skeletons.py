"""The stage from files to both tables, on a simulated hand: a skeleton of the paper's and a fitted hand."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import stage_chain
from schemas.catalogue import (
    BONE_LENGTHS,
    JOINT_CENTRES,
    JOINT_ERRORS,
    METACARPALS,
    POSED_TIPS,
    POSES,
    SKELETON_SCORES,
    TABLES,
    TIP_ERRORS,
    TIPS,
)
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.poses import Poses, read_poses
from schemas.tables import (
    Provenance,
    columns_from_rows,
    read_metadata,
    read_table,
    rows_of,
    write_failure,
    write_table,
)
from stages.evaluate_skeletons.__main__ import main
from stages.fit_hand.fit import HandFit, Settings, fit_hand
from stages.fit_hand.replaying import pose_hand
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate
from stages.simulate.truth import write_truth

TASKS = ("opposition", "rom")
LAYOUT = read_layout("liberty16")
DIGITS = tuple(LAYOUT.digits)
TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
REFERENCES = ("prior-only", "distal-receiver", "true-skeleton")
N_FRAMES = 200
Row = dict[str, Any]


@dataclass(frozen=True)
class MadeHand:
    """One hand's files; a test that changes some works on a copy."""

    folder: Path

    @property
    def skeletons(self) -> list[Path]:
        """Both skeletons' folders."""
        return [self.skeleton("paper-fig4"), self.skeleton("whole-hand", "opposition")]

    @property
    def outputs(self) -> tuple[Path, Path]:
        """Both tables' files."""
        return self.folder / "skeleton_scores.parquet", self.folder / "joint_errors.parquet"

    def poses(self, task: str) -> Path:
        """A recording's poses."""
        return self.folder / task / "poses.parquet"

    def truth(self, task: str) -> Path:
        """The folder of a recording's truth."""
        return self.folder / f"sub-01_hand-right_task-{task}_truth"

    def skeleton(self, model: str, without: str = "") -> Path:
        """A skeleton's folder."""
        return self.folder / "models" / model / "sub-01" / "right" / (without and f"without-{without}")

    def copied(self, folder: Path) -> MadeHand:
        """The same files elsewhere."""
        return MadeHand(Path(shutil.copytree(self.folder, folder / "copy")))

    def run(
        self,
        *more: str,
        skeletons: list[Path] | None = None,
        truth: tuple[str, ...] = TASKS,
        calibration: tuple[str, ...] = (),
    ) -> int:
        """Run the stage, with a calibration only where the prior is at test; give its exit code."""
        folders = self.skeletons if skeletons is None else skeletons
        words = ["--poses", *map(self.poses, TASKS), "--calibration", *map(self.poses, calibration)]
        words += ["--skeletons", *folders, "--truth", *map(self.truth, truth), "--layout", "liberty16"]
        out, joints = self.outputs
        return main([*map(str, words), f"--out={out}", f"--out-joints={joints}", *more])

    def rows(self) -> tuple[list[Row], list[Row]]:
        """Rows of both tables."""
        found = [list(rows_of(read_table(path, TABLES[path.stem]))) for path in self.outputs]
        return found[0], found[1]


def write_rows(path: Path, rows: list[Row], calibrated_on: list[str] | None = None) -> None:
    table = TABLES[path.stem]
    parameters = {} if calibrated_on is None else {"calibrated_on": calibrated_on}
    write_table(path, table, columns_from_rows(table, rows), Provenance((), parameters))


def fitted_rows(fit: HandFit) -> tuple[list[Row], list[Row]]:
    """Rows of joint_centres and bone_lengths."""
    names = {"subject": "01", "hand": "right", "model": "whole-hand", "message": ""}
    joints = []
    for joint in fit.joints.values():
        row = names | {"joint": joint.name, "parent_segment": joint.parent_segment, "sd_mm": joint.sd_mm}
        row |= {"child_segment": joint.child_segment, "dof": joint.dof, "n_frames": 40, "source": "fit"}
        for i, axis in enumerate("xyz"):
            row |= {f"parent_{axis}_mm": joint.parent_mm[i], f"child_{axis}_mm": joint.child_mm[i]}
            row |= {f"axis_parent_{axis}": joint.axis_parent[i], f"axis_child_{axis}": joint.axis_child[i]}
        joints.append(row | {"status": joint.status})
    bones = [
        names | {"digit": name.split("_")[0], "bone": name, "driven_by": "", "bone_mm": bone.length_mm}
        for name, bone in fit.bones.items()
    ]
    return joints, bones


def posed_rows(fit: HandFit, poses: Poses, task: str) -> Iterator[tuple[Row, Row]]:
    """Rows of posed_tips, left out in every tenth frame, and of metacarpals."""
    words = {"subject": "01", "hand": "right", "task": task, "trial": "", "model": "whole-hand"}
    tried = np.arange(0, len(poses.frame), 10)
    tips = {digit.tip: (0.0, 1.0) for digit in LAYOUT.digits.values()}
    posed, blind = pose_hand(fit, poses), pose_hand(fit, poses.take(tried), tips)
    for digit in LAYOUT.digits.values():
        measured, receiver = poses.position_mm[:, poses.index(digit.tip)], posed.receivers.index(digit.tip)
        error = np.linalg.norm(posed.receiver_mm[:, receiver] - measured, axis=-1)
        left_out = np.full(len(error), np.nan)
        left_out[tried] = np.linalg.norm(blind.receiver_mm[:, receiver] - measured[tried], axis=-1)
        bone = posed.bone_quaternion[:, posed.bones.index(digit.segments[0])]
        tip_mm = posed.tip_mm[:, posed.tips.index(digit.name)]
        for i, frame in enumerate(poses.frame.tolist()):
            row = words | {"digit": digit.name, "frame": frame}
            errors = {"error_mm": error[i], "error_left_out_mm": left_out[i], "residual_mm": 0.0}
            turn = dict(zip(("qw", "qx", "qy", "qz"), bone[i], strict=True))
            yield row | dict(zip(TIP, tip_mm[i], strict=True)) | errors, row | turn | {"flags": ""}


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> MadeHand:
    """Seed 4, right hand; paper-fig4, and a whole hand without opposition, both made from
    rom. The whole hand's replay is paper-fig4's, as that stage is not at test here.
    """
    made = MadeHand(tmp_path_factory.mktemp("made_hand"))
    for task in TASKS:
        simulated = simulate("01", "right", task, 4, Realism.full(), N_FRAMES)
        write_recording(made.folder / f"{task}.parquet", simulated)
        write_truth(made.truth(task), simulated.truth, simulated.written(), Provenance())
        captured = stage_chain.capture(made.folder / f"{task}.parquet", made.poses(task), "right", task)
        stage_chain.run_here([captured])
    paper, evaluated = made.skeleton("paper-fig4"), [made.poses(task) for task in TASKS]
    stage_chain.run_here(stage_chain.joints(paper, "paper-fig4", made.poses("rom")))
    projected = paper / "projected_joints.parquet"
    stage_chain.run_here(stage_chain.skeleton(projected, paper, "paper-fig4", made.poses("rom"), evaluated))
    rom = read_poses(made.poses("rom"), LAYOUT.measured)
    fit = fit_hand([rom], LAYOUT, "right", settings=Settings(n_frames=30, rounds=0))
    whole = made.skeleton("whole-hand", "opposition")
    whole.mkdir(parents=True)
    for name in ("tips", "tip_errors"):
        shutil.copy(paper / f"{name}.parquet", whole)
    opposition = read_poses(made.poses("opposition"), LAYOUT.measured)
    tips, metacarpals = zip(*posed_rows(fit, opposition, "opposition"), strict=True)
    joints, bones = fitted_rows(fit)
    for table, rows in ((POSED_TIPS, tips), (METACARPALS, metacarpals), (BONE_LENGTHS, bones)):
        write_rows(whole / f"{table.name}.parquet", list(rows))
    write_rows(whole / "joint_centres.parquet", joints, ["rom"])
    rows = list(rows_of(read_table(paper / "joint_centres.parquet", JOINT_CENTRES)))
    write_rows(paper / "joint_centres.parquet", rows, ["rom"])
    return made


@pytest.fixture(scope="session")
def results(made: MadeHand) -> tuple[list[Row], list[Row]]:
    assert made.run(calibration=("rom",)) == 0
    return made.rows()


def of(rows: list[Row], model: str, task: str = "opposition") -> dict[str, Row]:
    """A model's rows in one recording, by digit."""
    return {row["digit"]: row for row in rows if (row["model"], row["task"]) == (model, task)}


def test_every_skeleton_and_reference_has_its_rows(results: tuple[list[Row], list[Row]]) -> None:
    """A row for every digit, model and recording; what was made without opposition in opposition alone."""
    scores, errors = results
    for table, rows in ((SKELETON_SCORES, scores), (JOINT_ERRORS, errors)):
        keys = [tuple(row[name] for name in table.key) for row in rows]
        assert len(set(keys)) == len(keys)
    found = {(row["model"], row["task"], row["calibrated_on"], row["held_out"]) for row in scores}
    references = {(name, task, "", True) for name in REFERENCES for task in TASKS}
    assert found == references | {
        ("paper-fig4", "opposition", "rom", True),
        ("paper-fig4", "rom", "rom", False),
        ("whole-hand", "opposition", "rom", True),
    }
    for model, task, *_ in found:
        assert tuple(of(scores, model, task)) == DIGITS
    assert {row["model"] for row in scores if row["reference"]} == set(REFERENCES)
    assert {row["message"] for row in scores} == {""}


def test_the_replays_numbers_are_those_of_tip_errors(
    made: MadeHand, results: tuple[list[Row], list[Row]]
) -> None:
    for row in rows_of(read_table(made.skeleton("paper-fig4") / "tip_errors.parquet", TIP_ERRORS)):
        if row["binding"] == "least-squares":
            found = of(results[0], "paper-fig4", row["task"])[row["digit"]]
            assert found["replay_mean_mm"] == found["left_out_mean_mm"] == pytest.approx(row["mean_mm"])
            assert found["replay_p95_mm"] == found["left_out_p95_mm"] == pytest.approx(row["p95_mm"])
            assert (found["posed_mean_mm"], found["n_frames"]) == (None, row["n_frames"])


def test_tips_and_metacarpals_against_the_truth(made: MadeHand, results: tuple[list[Row], list[Row]]) -> None:
    """The same numbers from whole tables, read and compared without the stage."""
    own = {"paper-fig4": TIPS, "whole-hand": POSED_TIPS}
    truth = made.truth("opposition") / "tips.parquet"
    for folder in made.skeletons:
        model = folder.relative_to(made.folder).parts[1]
        places = (folder / f"{own[model].name}.parquet", own[model]), (truth, TIPS)
        found, true = (read_table(path, table).to_pandas() for path, table in places)
        both = found[found.task == "opposition"].merge(true, on=["digit", "frame"], suffixes=("", "_true"))
        apart = both[list(TIP)].to_numpy() - both[[f"{name}_true" for name in TIP]].to_numpy()
        both["off"] = np.linalg.norm(apart, axis=1)
        for digit, off in both.groupby("digit")["off"]:
            row = of(results[0], model)[str(digit)]
            assert len(off) == N_FRAMES
            assert row["true_tip_mean_mm"] == pytest.approx(off.mean())
            assert row["true_tip_p95_mm"] == pytest.approx(np.percentile(off, 95))
            assert 0 < row["metacarpal_deg"] < 30


def test_a_fitted_hand_knows_the_end_of_its_bones(results: tuple[list[Row], list[Row]]) -> None:
    """Fitted hand and true skeleton beat the distal receiver and the paper's skeleton at the true tip, and
    the left-out error is larger than the posed one.
    """
    mean = {
        model: np.mean([row["true_tip_mean_mm"] for row in of(results[0], model).values()])
        for model in ("true-skeleton", "whole-hand", "distal-receiver", "paper-fig4")
    }
    assert mean["true-skeleton"] < 1.0 < mean["whole-hand"] < 5.0 < mean["distal-receiver"]
    assert mean["paper-fig4"] > 5.0
    for row in of(results[0], "whole-hand").values():
        assert 0 < row["posed_mean_mm"] < row["left_out_mean_mm"] < 2.0
        assert row["wrist_mcp_sd_mm"] is None
        assert row["n_frames"] == N_FRAMES
    for row in of(results[0], "paper-fig4").values():
        assert 0 < row["wrist_mcp_sd_mm"] < 5


def test_joints_are_held_against_the_truth(made: MadeHand, results: tuple[list[Row], list[Row]]) -> None:
    """Every solved joint under every model and the prior; the numbers are those of the tables."""
    table = read_table(made.truth("rom") / "joint_centres.parquet", JOINT_CENTRES)
    true = {row["joint"]: row for row in rows_of(table)}
    by_model: dict[str, dict[str, Row]] = {}
    for row in results[1]:
        by_model.setdefault(row["model"], {})[row["joint"]] = row
    assert set(by_model) == {"paper-fig4", "whole-hand", "prior-only"}
    for model, rows in by_model.items():
        assert set(rows) == set(true) - {"wrist"}, model
        assert {name for name, row in rows.items() if row["axis_deg"] is not None} == {
            name for name in rows if name.endswith(("_pip", "_dip", "_ip"))
        }
    for row in rows_of(read_table(made.skeletons[0] / "joint_centres.parquet", JOINT_CENTRES)):
        if row["joint"] != "wrist":
            off = [row[f"child_{axis}_mm"] - true[row["joint"]][f"child_{axis}_mm"] for axis in "xyz"]
            found = by_model["paper-fig4"][row["joint"]]
            assert found["error_mm"] == pytest.approx(np.linalg.norm(off))
            assert np.hypot(found["along_mm"], found["across_mm"]) == pytest.approx(found["error_mm"])
    assert by_model["paper-fig4"]["thumb_cmc"]["bone"] == by_model["paper-fig4"]["index_dip"]["bone"] == ""
    assert by_model["whole-hand"]["index_dip"]["bone"] == "index_distal"
    assert by_model["prior-only"]["index_pip"]["bone"] == "index_middle"
    assert {row["within_95"] for row in by_model["prior-only"].values()} == {None}
    assert np.mean([row["within_95"] for row in by_model["whole-hand"].values()]) > 0.6
    assert np.median([row["error_mm"] for row in by_model["whole-hand"].values()]) < 2.5


def test_without_truth_its_columns_are_null(made: MadeHand, tmp_path: Path) -> None:
    copy = made.copied(tmp_path)
    assert copy.run(truth=()) == 0
    scores, errors = copy.rows()
    assert errors == []
    assert {row["model"] for row in scores} == {"paper-fig4", "whole-hand", *REFERENCES[:2]}
    for name in ("true_tip_mean_mm", "true_tip_p95_mm", "metacarpal_deg"):
        assert {row[name] for row in scores} == {None}
    assert not {None} & {row["replay_mean_mm"] for row in scores if row["model"] != "prior-only"}


def test_a_truth_of_one_task_serves_that_task(
    made: MadeHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its joints are held against the only truth there is, though calibrated on another task."""
    copy = made.copied(tmp_path)
    shutil.rmtree(copy.truth("rom"))
    assert copy.run() == 0
    assert "no truth" in capsys.readouterr().err
    scores, errors = copy.rows()
    assert {row["task"] for row in scores if row["true_tip_mean_mm"] is not None} == {"opposition"}
    assert {row["model"] for row in errors} == {"paper-fig4", "whole-hand", "prior-only"}


def test_tables_that_are_missing_or_failed_cost_their_numbers(made: MadeHand, tmp_path: Path) -> None:
    """Rows and reasons stay, and the other skeletons' numbers."""
    copy = made.copied(tmp_path)
    paper, whole = copy.skeletons
    write_failure(paper / "joint_centres.parquet", JOINT_CENTRES, "the dog ate it", Provenance())
    (paper / "tips.parquet").unlink()
    (paper / "bone_lengths.parquet").write_bytes(b"PAR1 no more")
    write_failure(whole / "posed_tips.parquet", POSED_TIPS, "not posed", Provenance())
    gone = copy.skeleton("gone")
    assert copy.run(skeletons=[paper, whole, gone]) == 0
    scores, errors = copy.rows()
    for digit in DIGITS:
        row = of(scores, "paper-fig4")[digit]
        assert (row["replay_mean_mm"], row["wrist_mcp_sd_mm"], row["n_frames"]) == (None, None, 0)
        assert row["metacarpal_deg"] is not None
        for word in ("the dog ate it", "tips.parquet: no such file", "bone_lengths.parquet: not a readable"):
            assert row["message"].count(word) == 1
        assert (row["calibrated_on"], row["held_out"]) == ("", True)  # as tip_errors says
        row = of(scores, "whole-hand")[digit]
        assert row["message"] == "not posed"
        assert row["replay_mean_mm"] is not None
        assert (row["posed_mean_mm"], row["left_out_mean_mm"], row["true_tip_mean_mm"]) == (None, None, None)
        assert (
            of(scores, "gone")[digit]["message"]
            == f"{gone}: no such folder; expected the tables of a skeleton"
        )
    assert {row["error_mm"] for row in errors if row["model"] in ("paper-fig4", "gone")} == {None}
    assert None not in {row["error_mm"] for row in errors if row["model"] == "whole-hand"}


def test_a_recording_that_cannot_be_read_costs_its_own_numbers(made: MadeHand, tmp_path: Path) -> None:
    copy = made.copied(tmp_path)
    names = {"subject": "01", "hand": "right", "task": "opposition", "trial": ""}
    write_failure(copy.poses("opposition"), POSES, "no frames came", Provenance((), names))
    assert copy.run(calibration=("rom",)) == 0
    scores, _ = copy.rows()
    for name in ("prior-only", "distal-receiver", "paper-fig4"):
        assert all("no frames came" in row["message"] for row in of(scores, name).values())
        assert {row["message"] for row in of(scores, name, "rom").values()} == {""}
    assert of(scores, "true-skeleton") == {}
    assert set(of(scores, "true-skeleton", "rom")) == set(DIGITS)


def test_one_receiver_that_cannot_be_read_costs_its_recording(made: MadeHand, tmp_path: Path) -> None:
    """The tables of the skeletons were made before; what needs poses is null."""
    copy = made.copied(tmp_path)
    path = copy.poses("opposition")
    metadata, data = read_metadata(path), read_table(path, POSES)
    columns = {name: data.column(name) for name in data.column_names}
    shifted = np.array(data.column("segment").to_pylist()) == "index_middle"
    columns["frame"] = data.column("frame").to_numpy() + shifted
    write_table(path, POSES, columns, Provenance((), metadata["parameters"]), row_group_rows=N_FRAMES)
    assert copy.run() == 0
    scores, _ = copy.rows()
    for row in of(scores, "distal-receiver").values():
        assert "index_middle does not have the frames of the others" in row["message"]
        assert row["replay_mean_mm"] is None
    for row in of(scores, "paper-fig4").values():
        assert row["replay_mean_mm"] is not None
        assert row["wrist_mcp_sd_mm"] is None


def test_frames_may_be_counted_from_another_number(
    made: MadeHand, results: tuple[list[Row], list[Row]], tmp_path: Path
) -> None:
    """As in a recording captured from a tracker's stream: the truth is found by what it says of receivers."""
    copy = made.copied(tmp_path)
    later = [*(copy.poses(task) for task in TASKS), *copy.folder.glob("models/**/*tips.parquet")]
    later += copy.folder.glob("models/**/metacarpals.parquet")
    for path in later:
        table = next(table for table in (POSES, TIPS, POSED_TIPS, METACARPALS) if table.name == path.stem)
        metadata, data = read_metadata(path), read_table(path, table)
        columns = {name: data.column(name) for name in data.column_names}
        columns["frame"] = data.column("frame").to_numpy() - 1
        groups = N_FRAMES if table is POSES else 1 << 17
        write_table(path, table, columns, Provenance((), metadata["parameters"]), row_group_rows=groups)
    assert copy.run() == 0
    rows = [[row for row in rows if row["model"] != "prior-only"] for rows in (copy.rows()[0], results[0])]
    for row, before in zip(*rows, strict=True):
        assert row == pytest.approx(before)


def test_a_truth_of_another_recording_is_refused(
    made: MadeHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = made.copied(tmp_path)
    other = simulate("01", "right", "opposition", 5, Realism.full(), N_FRAMES)
    write_truth(copy.truth("opposition"), other.truth, other.written(), Provenance())
    assert copy.run() == 2
    assert "is not the truth of this recording" in capsys.readouterr().err


@pytest.mark.parametrize("changed", ["skeleton", "posed tips", "truth", "asked"])
def test_files_of_two_hands_are_refused(
    made: MadeHand, tmp_path: Path, capsys: pytest.CaptureFixture[str], changed: str
) -> None:
    copy = made.copied(tmp_path)
    path = {
        "skeleton": copy.skeletons[0] / "joint_centres.parquet",
        "posed tips": copy.skeletons[1] / "posed_tips.parquet",
        "truth": copy.truth("rom") / "bone_lengths.parquet",
    }.get(changed)
    if path is not None:
        rows = list(rows_of(read_table(path, TABLES[path.stem])))
        write_rows(path, [row | {"hand": "left"} for row in rows])
    assert copy.run(*(["--hand=left"] if path is None else [])) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {path or copy.poses('opposition')}: is of ")
    assert "left hand" in error


def test_a_failure_is_recorded_where_asked_for(made: MadeHand, tmp_path: Path) -> None:
    copy = made.copied(tmp_path)
    assert copy.run("--hand-length-mm=19", "--record-failure") == 0
    for path in copy.outputs:
        with pytest.raises(InputError, match=r"--hand-length-mm: is 19; expected millimetres"):
            read_table(path, TABLES[path.stem])


def test_one_skeleton_given_twice_has_its_rows_once(made: MadeHand, tmp_path: Path) -> None:
    """A model that never used a task is the same with and without it."""
    copy = made.copied(tmp_path)
    paper = copy.skeleton("paper-fig4")
    shutil.copytree(paper, paper / "without-opposition")
    assert copy.run(skeletons=[paper, paper / "without-opposition"]) == 0
    tasks = [row["task"] for row in copy.rows()[0] if row["model"] == "paper-fig4"]
    assert tasks == 5 * ["opposition"] + 5 * ["rom"]
