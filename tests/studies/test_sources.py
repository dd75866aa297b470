"""A recorded hand, emulated and recorded again, is the same hand."""

from pathlib import Path

import numpy as np
import pytest
from studies.running import StudyRun, record, write_study
from tracker_processes import emulator, shukotsu

from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.poses import Poses, read_poses
from shukotsu.tables.typed_table import read_table

SECONDS = 4
NEAR_MM, NEAR = 1e-4, 1e-6
"""The tracker sends 32-bit numbers."""


def poses_of(study: StudyRun, subject: str) -> Poses:
    (file,) = (study.results.folder / f"sub-{subject}").rglob("poses.parquet")
    return read_poses(file, read_layout("liberty16").measured)


@pytest.mark.slow
def test_a_hand_recorded_from_the_emulator_has_the_same_poses(tmp_path: Path) -> None:
    file = record(tmp_path / "rom.parquet", frames=SECONDS * 240)
    with emulator("--recording", str(file), "--loop", port=("--tcp", "0")) as port:
        words = ("record", "--port", port, "--out", str(tmp_path / "sent.arrows"))
        assert shukotsu(*words, "--duration", str(SECONDS)).returncode == 0
    rows = ["came\tright\trom\tboth\tsent.arrows", "file\tright\trom\tboth\trom.parquet"]
    study = write_study(tmp_path, "sent", rows, ["rigid"])
    findings = [f"results/sent/sub-{subject}/findings.parquet" for subject in ("came", "file")]
    study.run(*findings)
    assert [read_table(study.folder / file, TABLES["findings"]).num_rows for file in findings] == [0, 0]
    sent = poses_of(study, "file")
    there = np.flatnonzero(sent.valid.all(0))  # the layout's forearm has no receiver
    assert len(there) == 16
    came = poses_of(study, "came")
    assert came.valid[:, there].all()
    off_mm = np.abs(sent.position_mm - came.position_mm[0])[:, there].sum((1, 2))
    rows_sent = (came.frame - came.frame[0] + off_mm.argmin()) % len(sent.frame)
    np.testing.assert_allclose(came.position_mm, sent.position_mm[rows_sent], atol=NEAR_MM)
    alike = np.abs((came.quaternion * sent.quaternion[rows_sent]).sum(-1))
    np.testing.assert_allclose(alike[:, there], 1, atol=NEAR)
