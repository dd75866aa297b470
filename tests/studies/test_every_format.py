"""One motion brought in five ways, in one study: the same poses, the same joints, whatever the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from studies.running import StudyRun, record

from schemas.catalogue import POSES
from schemas.tables import read_metadata, read_table
from stages.capture.__main__ import main

pytestmark = pytest.mark.slow

TASKS = ("tidy", "capture", "flipped", "wide", "bids", "unmapped")
NUMBERS = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]


def wide(tidy: pd.DataFrame, folder: Path) -> None:
    """The motion as another program's table: metres, xyzw, a row a frame; and the mapping that says so."""
    columns = {"t": tidy.groupby("frame").time_s.first() * 1000}
    receivers = {}
    for segment, rows in tidy.groupby("segment"):
        rows = rows.set_index("frame")
        for axis in "xyz":
            columns[f"{segment} {axis}"] = rows[f"{axis}_mm"] / 1000
        for part in "xyzw":
            columns[f"{segment} q{part}"] = rows[f"q{part}"]
        receivers[segment] = {
            "position": [f"{segment} {axis}" for axis in "xyz"],
            "orientation": [f"{segment} q{part}" for part in "xyzw"],
        }
    pd.DataFrame(columns).to_csv(folder / "wide.csv", index=False)
    mapping = {
        "format": "csv",
        "position_unit": "m",
        "orientation": {"kind": "quaternion", "order": "xyzw"},
        "receivers": receivers,
        "csv": {"time": "t", "time_unit": "ms"},
    }
    (folder / "wide.yaml").write_text(yaml.safe_dump(mapping), "utf-8")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    folder = tmp_path_factory.mktemp("formats")
    tidy = record(folder / "tidy.parquet", frames=600)
    table = pd.read_parquet(tidy)
    wide(table, folder)
    mirrored = table.copy()
    hidden = mirrored.frame.between(200, 399)
    mirrored.loc[hidden, ["x_mm", "y_mm", "z_mm"]] *= -1
    mirrored.to_parquet(folder / "mirrored.parquet")
    for name in ("tidy", "mirrored"):
        source, out = str(folder / f"{name}.parquet"), str(folder / f"{name}.arrows")
        assert main(["emulate", "--recording", source, "--layout", "liberty16", "--archive", out]) == 0
    words = ["--layout", "liberty16", "--subject", "01", "--hand", "right", "--task", "bids"]
    poses = folder / "poses.parquet"
    assert main(["import", "--in", str(tidy), *words, "--out", str(poses)]) == 0
    assert main(["export-bids", "--poses", str(poses), "--out", str(folder / "bids")]) == 0
    (motion,) = (folder / "bids").rglob("*_motion.tsv")
    rows = [
        "subject\thand\ttask\trole\tfile\tmapping\themisphere",
        "01\tright\ttidy\tboth\ttidy.parquet",
        "01\tright\tcapture\tevaluation\ttidy.arrows",
        "01\tright\tflipped\tevaluation\tmirrored.arrows\t\trepair",
        "01\tright\twide\tevaluation\twide.csv\twide.yaml",
        f"01\tright\tbids\tevaluation\t{motion.relative_to(folder)}",
        "01\tright\tunmapped\tevaluation\twide.csv\tnowhere.yaml",
    ]
    (folder / "formats.tsv").write_text("\n".join(rows) + "\n", "utf-8")
    lines = ["study: formats", "recordings: formats.tsv", "layout: liberty16", "models: [rigid]"]
    (folder / "formats.yaml").write_text("\n".join(lines) + "\n", "utf-8")
    made = StudyRun(folder / "formats.yaml", folder)
    made.run()
    return made


def poses(study: StudyRun, task: str) -> pd.DataFrame:
    """Poses by segment and frame and time from the recording's first, as a tracker counts them."""
    path = study.results.folder / "sub-01" / "right" / task / "poses.parquet"
    table = read_table(path, POSES).to_pandas()
    table["frame"] -= table["frame"].min()
    table["time_s"] -= table["time_s"].min()
    return table.set_index(["segment", "frame"])


@pytest.mark.parametrize("task", ["capture", "wide", "bids"])
def test_the_same_poses(study: StudyRun, task: str) -> None:
    """To the tracker's own numbers (a float of cm), to rounding of a division, to the last bit."""
    tolerance_mm = {"capture": 2e-4, "wide": 1e-9, "bids": 0.0}[task]
    expected, found = poses(study, "tidy"), poses(study, task)
    assert found.index.equals(expected.index)
    assert (found["valid"] == expected["valid"]).all()
    apart = np.abs(found[NUMBERS[:3]] - expected[NUMBERS[:3]]).to_numpy()
    assert np.nanmax(apart) <= tolerance_mm
    turned = np.abs(np.abs((found[NUMBERS[3:]] * expected[NUMBERS[3:]]).sum(axis=1)) - 1)
    assert turned[found["valid"]].max() < 1e-6
    np.testing.assert_allclose(found.time_s, expected.time_s, atol=1e-6)


def test_flips_are_put_back_where_the_sheet_asks_for_it(study: StudyRun) -> None:
    expected, found = poses(study, "tidy"), poses(study, "flipped")
    repaired = found["flags"].str.contains("hemisphere-repaired")
    assert set(found.index.get_level_values("frame")[repaired]) == set(range(199, 399))
    apart = np.abs(found[NUMBERS[:3]] - expected[NUMBERS[:3]]).to_numpy()
    assert np.nanmax(apart) <= 2e-4
    assert found["valid"].equals(expected["valid"])
    (row,) = study.rows_where("recordings", task="flipped")
    assert "jumped to the other side of the transmitter" in row["message"]


def test_the_same_tips(study: StudyRun) -> None:
    mean_mm = {
        task: {
            row["digit"]: row["mean_mm"]
            for row in study.rows_where("tip_errors", task=task, binding="least-squares")
        }
        for task in TASKS[:-1]
    }
    for task in TASKS[1:-1]:
        assert mean_mm[task] == pytest.approx(mean_mm["tidy"], abs=1e-4), task


def test_a_missing_mapping_costs_its_recording_alone(study: StudyRun) -> None:
    (row,) = study.rows_where("recordings", task="unmapped")
    assert row["status"] == "failed"
    assert "nowhere.yaml: no such file; expected a mapping file" in row["message"]


def test_what_a_table_was_made_from_is_in_it(study: StudyRun) -> None:
    path = study.results.folder / "sub-01" / "right" / "wide" / "poses.parquet"
    assert {given["file"] for given in read_metadata(path)["inputs"]} == {
        "wide.csv",
        "wide.yaml",
        "liberty16.yaml",
    }
