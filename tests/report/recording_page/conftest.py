"""A made-up study whose subjects have every table that a recording's page reads, and its pages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_samples.hand_tables import part_of, write_parts, write_subject_tables
from report_samples.made_study import HOSTILE, make_study
from report_samples.pages import rows_where

from shukotsu.report.recording_page import recording_page
from shukotsu.report.recording_results import RecordingResults, read_recording
from shukotsu.report.study_results import StudyResults, read_subject
from shukotsu.study.layout import read_layout
from shukotsu.study.plan import read_plan
from shukotsu.study.results import FIT_TABLES, Results
from shukotsu.study.study import Recording, Study, read_study
from shukotsu.tables.catalogue import BONE_POSES, JOINT_ANGLES, JOINT_SOLUTIONS, POSED_TIPS, POSES, TIPS
from shukotsu.tables.parts import Part
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Provenance, Table, read_table, rows_of, write_failure

N_FRAMES = 300
GAP = slice(100, 160)
"""Frames in which no tip error and no angle of the index finger is known."""
PEAK_FRAME = 217
LAYOUT = read_layout("liberty16")
ANGLES = ("flexion_deg", "abduction_deg", "rotation_deg")


@dataclass(frozen=True)
class MadeHands:
    """The study, where its results are, and the file that names it."""

    file: Path
    study: Study
    paths: Results

    def subject(self, subject: str = "S01") -> StudyResults:
        """That subject's results."""
        return read_subject(read_plan(self.paths.plan(subject)))

    def recording(self, subject: str = "S01", hand: str = "right") -> Recording:
        """That hand's evaluated recording."""
        return next(r for r in self.study.shown if (r.hand.subject, r.hand.hand) == (subject, hand))

    def results(self, subject: str = "S01", hand: str = "right") -> RecordingResults:
        """What its page is made from."""
        return read_recording(self.subject(subject), self.recording(subject, hand))

    def path(self, table: Table, model: str, hand: Hand) -> Path:
        """The file of a table of a hand under a model."""
        results = self.subject(hand.subject)
        if table.name in FIT_TABLES:
            return results.fit_table(hand, model, table.name)
        return results.subject_table(hand, table.name)

    def rows(self, model: str, table: Table, **wanted: Any) -> list[dict[str, Any]]:
        """Rows of a table of S01's right hand, those of which columns have these values."""
        wanted |= {"hand": "right", "model": model}
        return rows_where(rows_of(read_table(self.path(table, model, Hand("S01", "right")), table)), **wanted)


def make_hands(folder: Path) -> MadeHands:
    """Two subjects, one with a hostile name; two models that fit the hand, one that does not."""
    second = folder / "whole-hand-b.yaml"
    shipped = Path("config/models/whole-hand.yaml").read_text("utf-8")
    second.write_text(shipped.replace("model: whole-hand", "model: whole-hand-b"), "utf-8")
    file, results = make_study(folder, n_frames=N_FRAMES, models=("paper-fig4", "whole-hand", str(second)))
    study, paths = read_study(file), Results(results)
    write_subject_tables(study, paths)
    made = MadeHands(file, study, paths)
    for subject in study.subjects:
        _write_long_tables(made, subject)
    failed = made.subject(HOSTILE).poses(made.recording(HOSTILE, "left"))
    write_failure(failed, POSES, "left.csv: row 7 <is> not a number", Provenance())
    return made


def _write_long_tables(made: MadeHands, subject: str) -> None:
    results, paths = made.subject(subject), made.paths
    solutions = {part_of(*key): _solutions(rows) for key, rows in results.joints_of.items()}
    write_parts(paths.subject(subject) / "joint_solutions.parquet", JOINT_SOLUTIONS, solutions)
    tips = read_table(paths.study_table("tips"), TIPS).to_pylist()
    of_parts: dict[Part, list[dict[str, Any]]] = {}
    for row in tips:
        if row["subject"] == subject and row["model"] == "paper-fig4":
            of_parts.setdefault(part_of(Hand(subject, row["hand"]), row["model"]), []).append(row)
    for hand in results.hands:
        for model in results.fitted:
            key = {"subject": subject, "hand": hand.hand, "model": model, "task": "opposition", "trial": ""}
            of_parts[part_of(hand, model)] = [key | _replayed(row) for row in _fitted_rows(model)[POSED_TIPS]]
    write_parts(paths.subject(subject) / "tips.parquet", TIPS, _and_elsewhere(of_parts))
    for hand in results.hands:
        for model in results.fitted:
            for table, rows in _fitted_rows(model).items():
                key = {"subject": subject, "hand": hand.hand, "task": "opposition", "trial": ""}
                part = {part_of(hand, model): [key | row for row in rows]}
                write_parts(results.fit_table(hand, model, table.name), table, _and_elsewhere(part))


def _replayed(row: dict[str, Any]) -> dict[str, Any]:
    """A row of tips for one of posed_tips: the replay is off by 0.25 mm more than the posed hand."""
    error = row["error_mm"]
    return row | {"error_mm": None if error is None else error + 0.25}


def _and_elsewhere(parts: dict[Part, list[dict[str, Any]]]) -> dict[Part, list[dict[str, Any]]]:
    """The rows after the same of another task: a reader that does not look at it goes wrong."""
    return {
        part: [{**row, "task": "rom", **{c: 77.0 for c in row if c.endswith("_deg")}} for row in rows] + rows
        for part, rows in parts.items()
    }


def _solutions(joints: list[dict[str, Any]]) -> list[dict[str, Any]]:
    solved = [row for row in joints if row["parent_segment"] and row["status"] != "failed"]
    names = ("subject", "joint", "parent_segment", "child_segment", "status", "message")
    return [
        {name: row[name] for name in names}
        | {"n_frames": 300, "singular_values": [1.41, 1.40, 1.39, 0.15 + 0.01 * n, 0.14, 0.0321]}
        for n, row in enumerate(solved)
    ]


@cache
def _fitted_rows(model: str) -> dict[Table, list[dict[str, Any]]]:
    shift = 3.0 if model.endswith("b") else 0.0
    angles, bones, tips = [], [], []
    for frame in range(N_FRAMES):
        for j, joint in enumerate(j.name for j in LAYOUT.joints.values() if j.name != "wrist"):
            seen = not (joint.startswith("index") and GAP.start <= frame < GAP.stop)
            turn = (20 + j + 30 * np.sin(frame / 25 + j), -3 + shift + j / 7 * np.cos(frame / 9), -frame / 31)
            angles.append(
                {"joint": joint, "frame": frame}
                | {name: angle if seen else None for name, angle in zip(ANGLES, turn, strict=True)}
            )
        for s, segment in enumerate(LAYOUT.segments):
            pose = {"x_mm": 200.0 + s, "y_mm": 30.0 + 2 * s, "z_mm": 40.0, "qw": 1.0}
            bones.append({"segment": segment, "frame": frame, **pose, "qx": 0.0, "qy": 0.0, "qz": 0.0})
        for d, digit in enumerate(LAYOUT.digits):
            seen = not (digit == "index" and GAP.start <= frame < GAP.stop)
            error = 0.313 + d / 7 + shift + abs(np.sin(frame / 13 + d)) + 40.0 * (frame == PEAK_FRAME)
            tip = {"tip_x_mm": 250.0, "tip_y_mm": 30.0 + 9 * d, "tip_z_mm": 40.0}
            tips.append(
                {"digit": digit, "frame": frame, "time_s": frame / 240, **tip}
                | {"error_mm": error if seen else None}
            )
    return {JOINT_ANGLES: angles, BONE_POSES: bones, POSED_TIPS: tips}


@pytest.fixture(scope="session")
def hands(tmp_path_factory: pytest.TempPathFactory) -> MadeHands:
    """The made-up study; not to be changed."""
    return make_hands(tmp_path_factory.mktemp("hands"))


@pytest.fixture(scope="session")
def page(hands: MadeHands) -> str:
    return recording_page(hands.results())
