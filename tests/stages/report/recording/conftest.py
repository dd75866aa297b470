"""A made-up study whose hands have every table that a recording's page reads, and its pages."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from report_samples.hand_tables import write_hand_tables
from report_samples.made_study import HOSTILE, make_study

from schemas.catalogue import (
    BONE_POSES,
    JOINT_ANGLES,
    JOINT_CENTRES,
    JOINT_SOLUTIONS,
    POSED_TIPS,
    POSES,
    TIPS,
)
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import Results
from schemas.study import Hand, Recording, Study, read_study
from schemas.tables import (
    Provenance,
    Table,
    columns_from_rows,
    read_table,
    rows_of,
    write_failure,
    write_table,
)
from stages.report.recording.page import recording_page
from stages.report.recording.reading import RecordingResults, evaluated_recording, read_recording

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

    def recording(self, subject: str = "S01", hand: str = "right") -> Recording:
        """That hand's evaluated recording."""
        return evaluated_recording(self.study, Hand(subject, hand), "opposition")

    def results(self, subject: str = "S01", hand: str = "right") -> RecordingResults:
        """What its page is made from."""
        return read_recording(self.study, self.paths, self.recording(subject, hand))

    def rows(self, model: str, table: Table, **wanted: Any) -> list[dict[str, Any]]:
        """Rows of a table of S01's right hand, those of which columns have these values."""
        path = self.paths.hand_table(model, Hand("S01", "right"), table.name)
        rows = rows_of(read_table(path, table))
        return [row for row in rows if all(row[name] == value for name, value in wanted.items())]


def make_hands(folder: Path) -> MadeHands:
    """Two subjects, one with a hostile name; two models that fit the hand, one that does not."""
    second = folder / "whole-hand-b.yaml"
    shipped = Path("config/models/whole-hand.yaml").read_text("utf-8")
    second.write_text(shipped.replace("model: whole-hand", "model: whole-hand-b"), "utf-8")
    file, results = make_study(folder, n_frames=N_FRAMES, models=("paper-fig4", "whole-hand", str(second)))
    study, paths = read_study(file), Results(results)
    write_hand_tables(study, paths)
    for hand in study.hands:
        for name, path in study.models.items():
            _write_solutions(paths, hand, name)
            if read_model(path.absolute()).fitting is not None:
                _write_fitted(paths, hand, name)
    failed = evaluated_recording(study, Hand(HOSTILE, "left"), "opposition")
    write_failure(paths.poses(failed), POSES, "left.csv: row 7 <is> not a number", Provenance())
    return MadeHands(file, study, paths)


def _write(paths: Results, hand: Hand, model: str, table: Table, rows: list[dict[str, Any]]) -> None:
    key = {"subject": hand.subject, "hand": hand.hand, "model": model, "task": "opposition", "trial": ""}
    rows = [key | row for row in rows]
    if "task" in table.key:  # the same of another task: a reader that does not look at it goes wrong
        rows = [{**row, "task": "rom", **{c: 77.0 for c in row if c.endswith("_deg")}} for row in rows] + rows
    path = paths.hand_table(model, hand, table.name)
    write_table(path, table, columns_from_rows(table, rows), Provenance())


def _write_solutions(paths: Results, hand: Hand, model: str) -> None:
    centres = rows_of(read_table(paths.hand_table(model, hand, "joint_centres"), JOINT_CENTRES))
    solved = [row for row in centres if row["parent_segment"] and row["status"] != "failed"]
    rows = [
        {name: row[name] for name in ("joint", "parent_segment", "child_segment", "status", "message")}
        | {"n_frames": 300, "singular_values": [1.41, 1.40, 1.39, 0.15 + 0.01 * n, 0.14, 0.0321]}
        for n, row in enumerate(solved)
    ]
    _write(paths, hand, model, JOINT_SOLUTIONS, rows)


def _write_fitted(paths: Results, hand: Hand, model: str) -> None:
    shift = 3.0 if model.endswith("b") else 0.0
    angles, bones, tips = [], [], []
    for frame in range(N_FRAMES):
        for j, joint in enumerate(j.name for j in LAYOUT.joints.values() if j.name != "wrist"):
            known = not (joint.startswith("index") and GAP.start <= frame < GAP.stop)
            turn = (20 + j + 30 * np.sin(frame / 25 + j), -3 + shift + j / 7 * np.cos(frame / 9), -frame / 31)
            angles.append(
                {"joint": joint, "frame": frame}
                | {name: angle if known else None for name, angle in zip(ANGLES, turn, strict=True)}
            )
        for s, segment in enumerate(LAYOUT.segments):
            place = dict(zip(("x_mm", "y_mm", "z_mm"), (200.0 + s, 30.0 + 2 * s, 40.0), strict=True))
            bones.append({"segment": segment, "frame": frame, **place})
        for d, digit in enumerate(LAYOUT.digits):
            known = not (digit == "index" and GAP.start <= frame < GAP.stop)
            error = 0.313 + d / 7 + shift + abs(np.sin(frame / 13 + d)) + 40.0 * (frame == PEAK_FRAME)
            tip = {"tip_x_mm": 250.0, "tip_y_mm": 30.0 + 9 * d, "tip_z_mm": 40.0}
            tips.append(
                {"digit": digit, "frame": frame, "time_s": frame / 240, **tip}
                | {"error_mm": error if known else None}
            )
    _write(paths, hand, model, JOINT_ANGLES, angles)
    _write(paths, hand, model, BONE_POSES, bones)
    _write(paths, hand, model, POSED_TIPS, tips)


def without_rows(paths: Results, model: str, hand: Hand, table: Table, task: str | None = None) -> None:
    """Take the rows of one task, or all, out of a table."""
    path = paths.hand_table(model, hand, table.name)
    whole = read_table(path, table)
    kept = whole.slice(0, 0) if task is None else whole.filter(pc.not_equal(whole["task"], task))
    columns: dict[str, pa.ChunkedArray] = {column.name: kept.column(column.name) for column in table.columns}
    write_table(path, table, columns, Provenance())


@pytest.fixture(scope="session")
def hands(tmp_path_factory: pytest.TempPathFactory) -> MadeHands:
    """The made-up study; not to be changed."""
    return make_hands(tmp_path_factory.mktemp("hands"))


@pytest.fixture
def make(hands: MadeHands) -> Callable[[Path], MadeHands]:
    """Copy the study, to be spoiled."""

    def copied(folder: Path) -> MadeHands:
        shutil.copytree(hands.file.parent, folder, dirs_exist_ok=True)
        file = folder / hands.file.name
        return MadeHands(
            file, read_study(file), Results(folder / hands.paths.folder.relative_to(hands.file.parent))
        )

    return copied


@pytest.fixture(scope="session")
def page(hands: MadeHands) -> str:
    """The page of S01's right hand."""
    return recording_page(hands.results())


@pytest.fixture
def spoil() -> Callable[..., None]:
    """Take rows out of a hand's table."""
    return without_rows


@pytest.fixture(scope="session")
def tip_error_mm(hands: MadeHands) -> dict[str, dict[tuple[str, int], float]]:
    """By model: the tip error that its plot shows, by digit and frame, as the tables have it."""
    fitted = ("whole-hand", "whole-hand-b")
    tables = {"paper-fig4": TIPS, **dict.fromkeys(fitted, POSED_TIPS)}
    return {
        model: {
            (row["digit"], row["frame"]): row["error_mm"]
            for row in hands.rows(model, table, task="opposition")
        }
        for model, table in tables.items()
    }
