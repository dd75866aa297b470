"""Hands whose motion is known, as the tables of a study, and a real browser to look at them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from report_samples.hand_tables import part_of, write_parts
from simulated_poses import write_poses

from shukotsu.report.hand_motion import HandMotion
from shukotsu.report.recording_results import read_recording
from shukotsu.report.study_results import StudyResults
from shukotsu.simulate.random_hand import BONES, DIGITS
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.simulate.written_truth import write_truth
from shukotsu.study.layout import FINGER_MM, read_layout
from shukotsu.study.model import read_model
from shukotsu.study.results import Results
from shukotsu.study.study import Recording
from shukotsu.study.verdict import judged_joint
from shukotsu.tables.catalogue import (
    BONE_POSES,
    JOINT_ANGLES,
    JOINT_CENTRES,
    JOINT_SOLUTIONS,
    POSED_TIPS,
    RECEIVERS,
    TIPS,
)
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Provenance, read_table, rows_of

LAYOUT = read_layout("liberty16")
MODELS = ("paper-fig3", "paper-fig4", "whole-hand")
UNSEEN = slice(50, 60)
"""Frames in which the index finger's distal receiver is not valid and its middle bone has no pose."""


@dataclass(frozen=True)
class KnownHand:
    """A recording with its truth, its subject's tables below `paths` under each of MODELS."""

    paths: Results
    recording: Recording
    made: Simulated
    joints: list[dict[str, Any]]
    worn: list[dict[str, Any]]

    def results(self, *models: str) -> StudyResults:
        """The results of a study of this recording under those models."""
        key = vars(self.recording.hand)
        row = key | {"task": "opposition", "trial": "", "status": "used", "message": ""}
        nothing: dict[str, list[Any]] = {
            name: []
            for name in (
                *("problems", "bones", "tip_errors", "scores", "joint_errors"),
                *("gains", "model_values", "model_differences"),
            )
        }
        return StudyResults(
            "known", (self.recording,), True, self.paths, {name: read_model(name) for name in models},
            {self.recording.hand: LAYOUT}, recording_rows=[row], joints=self.joints, receivers=self.worn,
            **nothing,
        )  # fmt: skip

    def motion(self, *models: str) -> HandMotion:
        """The recording's motion under those models."""
        read = read_recording(self.results(*models), self.recording)
        assert read.motion is not None, (read.trouble, read.left_out)
        return read.motion


def make_hand(folder: Path, hand: str, n_frames: int) -> KnownHand:
    """Write an exact recording of opposition, as seen through receivers that never slip, and its tables."""
    made = simulate("01", hand, "opposition", 7, Realism.exact(), n_frames)
    who, paths = Hand("01", hand), Results(folder)
    recording = Recording(
        who, "opposition", "", "both", folder / "x", "x", folder / "x", "csv", None, "+x", ""
    )
    key = vars(who)
    fitted = key | {"trial": "", "model": "whole-hand"}
    worn = [fitted | {"segment": f"{digit}_distal", "bone_tip_sd_mm": 2.5} for digit in DIGITS]
    write_truth(folder / "truth", made, Provenance())
    of_truth = {
        table: [
            (judged_joint(row | {"sd_mm": 1.5}, FINGER_MM) if "sd_mm" in row else row) | {"model": model}
            for model in MODELS
            for row in rows_of(read_table(folder / "truth" / f"{table.name}.parquet", table))
        ]
        for table in (JOINT_CENTRES, TIPS)
    }
    known = KnownHand(paths, recording, made, of_truth[JOINT_CENTRES], worn)
    results = known.results("whole-hand")
    poses = made.poses()
    poses.valid[UNSEEN, poses.index("index_distal")] = False
    write_poses(results.poses(recording), poses, hand, "opposition")
    for table, rows in ((TIPS, of_truth[TIPS]), (JOINT_SOLUTIONS, [])):
        parts = {part_of(who, model): [r for r in rows if r["model"] == model] for model in MODELS}
        write_parts(results.subject_table(who, table.name), table, parts)
    angles = [
        fitted | {"task": "opposition", "joint": "index_pip", "frame": int(frame)} for frame in made.frame
    ]
    for table, rows in (
        (RECEIVERS, worn),
        (JOINT_ANGLES, angles),
        (BONE_POSES, [*_elsewhere(_bone_rows(made, fitted)), *_bone_rows(made, fitted)]),
        (POSED_TIPS, [*_elsewhere(_tip_rows(made, fitted)), *_tip_rows(made, fitted)]),
    ):
        path = results.fit_table(who, "whole-hand", table.name)
        write_parts(path, table, {part_of(who, "whole-hand"): rows})
    return known


def _bone_rows(made: Simulated, key: dict[str, str]) -> list[dict[str, Any]]:
    rows = []
    for bone, segment in enumerate(BONES):
        for i, frame in enumerate(made.frame):
            posed = not (segment == "index_middle" and UNSEEN.start <= i < UNSEEN.stop)
            x, y, z = made.truth.bone_position_mm[i, bone] if posed else [None] * 3
            row = {**key, "task": "opposition", "segment": segment, "frame": int(frame)}
            rows.append(row | {"x_mm": x, "y_mm": y, "z_mm": z})
    return rows


def _tip_rows(made: Simulated, key: dict[str, str]) -> list[dict[str, Any]]:
    rows = []
    for d, digit in enumerate(DIGITS):
        for i, frame in enumerate(made.frame):
            x, y, z = made.truth.tip_mm[i, d]
            row = {**key, "task": "opposition", "digit": digit, "frame": int(frame), "error_mm": d + i / 100}
            rows.append(row | {"tip_x_mm": x, "tip_y_mm": y, "tip_z_mm": z})
    return rows


def _elsewhere(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The same of another task, a metre off: a reader that does not look at the task goes wrong."""
    return [
        {k: v + 1000.0 if k.endswith("_mm") and v is not None else v for k, v in row.items()}
        | {"task": "rom"}
        for row in rows
    ]


@pytest.fixture(scope="session", params=["right", "left"])
def known(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    return make_hand(tmp_path_factory.mktemp("known"), request.param, 120)


@pytest.fixture(scope="session")
def right(tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    return make_hand(tmp_path_factory.mktemp("right"), "right", 120)


@pytest.fixture(scope="session")
def make_known(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], KnownHand]:
    """Make a recording of so many frames of the right or the left hand."""
    return lambda hand, n_frames: make_hand(tmp_path_factory.mktemp(hand), hand, n_frames)
