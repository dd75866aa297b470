"""Hands whose motion is known, as the tables of a study, and a real browser to look at them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schemas.catalogue import BONE_POSES, JOINT_CENTRES, POSED_TIPS, POSES, RECEIVERS, TIPS
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import Results
from schemas.study import Hand, Recording
from schemas.tables import Provenance, Table, columns_from_rows, read_table, rows_of, write_table
from stages.report.viewer.motion import HandMotion, read_motion
from stages.simulate.anatomy import BONES, DIGITS
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate
from stages.simulate.truth import write_truth

LAYOUT = read_layout("liberty16")
MODELS = ("paper-fig3", "paper-fig4", "whole-hand")
UNSEEN = slice(50, 60)
"""Frames in which the index finger's distal receiver is not valid and its middle bone has no pose."""


@dataclass(frozen=True)
class KnownHand:
    """A recording with its truth, its tables below `paths` under each of MODELS."""

    paths: Results
    recording: Recording
    made: Simulated

    def motion(self, *models: str) -> HandMotion:
        """The recording's motion under those models."""
        return read_motion(self.paths, self.recording, LAYOUT, [read_model(name) for name in models])


def make_hand(folder: Path, hand: str, n_frames: int) -> KnownHand:
    """Write an exact recording of opposition, as seen through receivers that never slip, and its tables."""
    made = simulate("01", hand, "opposition", 7, Realism.exact(), n_frames)
    who, paths = Hand("01", hand), Results(folder)
    recording = Recording(
        who, "opposition", "", "both", folder / "x", "x", folder / "x", "csv", None, "+x", ""
    )
    _write(paths.poses(recording), POSES, _pose_columns(made))
    write_truth(folder / "truth", made.truth, made.written(), Provenance())
    for model in MODELS:
        for table in (JOINT_CENTRES, TIPS):
            rows = list(rows_of(read_table(folder / "truth" / f"{table.name}.parquet", table)))
            rows = [{**row, "model": model, **({"sd_mm": 1.5} if "sd_mm" in row else {})} for row in rows]
            _write(paths.hand_table(model, who, table.name), table, columns_from_rows(table, rows))
    key = {"subject": "01", "hand": hand, "trial": "", "model": "whole-hand"}
    worn = [
        {"subject": "01", "hand": hand, "model": "whole-hand", "segment": f"{digit}_distal"}
        | {"bone_tip_sd_mm": 2.5, "loose_task": "", "status": "ok", "message": ""}
        for digit in DIGITS
    ]
    for table, rows in (
        (RECEIVERS, worn),
        (BONE_POSES, [*_elsewhere(_bone_rows(made, key)), *_bone_rows(made, key)]),
        (POSED_TIPS, [*_elsewhere(_tip_rows(made, key)), *_tip_rows(made, key)]),
    ):
        _write(paths.hand_table("whole-hand", who, table.name), table, columns_from_rows(table, rows))
    return KnownHand(paths, recording, made)


def _write(path: Path, table: Table, columns: dict[str, Any]) -> None:
    segments = columns.get("segment", [])
    rows = len(columns["frame"]) // len(set(segments)) if table is POSES else 1 << 17
    write_table(path, table, columns, Provenance(), row_group_rows=rows)


def _pose_columns(made: Simulated) -> dict[str, Any]:
    n, count = len(made.frame), len(made.segments)
    valid = np.ones((count, n), bool)
    valid[made.segments.index("index_distal"), UNSEEN] = False
    numbers = np.concatenate([made.position_mm, made.quaternion], -1).swapaxes(0, 1).reshape(n * count, 7)
    names = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    return {
        "segment": np.repeat(made.segments, n).tolist(),
        "frame": np.tile(made.frame, count),
        "time_s": np.tile(made.time_s, count),
        **dict(zip(names, numbers.T, strict=True)),
        "valid": valid.ravel(),
        "flags": [""] * (n * count),
    }


def _bone_rows(made: Simulated, key: dict[str, str]) -> list[dict[str, Any]]:
    rows = []
    for bone, segment in enumerate(BONES):
        for i, frame in enumerate(made.frame):
            known = not (segment == "index_middle" and UNSEEN.start <= i < UNSEEN.stop)
            place = made.truth.bone_position_mm[i, bone] if known else [None] * 3
            row = {**key, "task": "opposition", "segment": segment, "frame": int(frame)}
            rows.append(row | dict(zip(("x_mm", "y_mm", "z_mm"), place, strict=True)))
    return rows


def _tip_rows(made: Simulated, key: dict[str, str]) -> list[dict[str, Any]]:
    rows = []
    for d, digit in enumerate(DIGITS):
        for i, frame in enumerate(made.frame):
            row = {**key, "task": "opposition", "digit": digit, "frame": int(frame), "error_mm": d + i / 100}
            place = zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), made.truth.tip_mm[i, d], strict=True)
            rows.append(row | dict(place))
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
    """A short recording of either hand."""
    return make_hand(tmp_path_factory.mktemp("known"), request.param, 120)


@pytest.fixture(scope="session")
def right(tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    """A short recording of a right hand."""
    return make_hand(tmp_path_factory.mktemp("right"), "right", 120)


@pytest.fixture(scope="session")
def make_known(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], KnownHand]:
    """Make a recording of so many frames of the right or the left hand."""
    return lambda hand, n_frames: make_hand(tmp_path_factory.mktemp(hand), hand, n_frames)


@pytest.fixture(scope="session")
def long_hand(tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    """A recording as long as the paper's."""
    return make_hand(tmp_path_factory.mktemp("long"), "right", 3774)
