"""Each source of the recorder through a study to a report: one hand, sent in every way, is the same hand."""

from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from lsl_here import LSL_HERE
from studies.running import StudyRun, record, write_study
from tracker_processes import PATIENCE_S, emulator, started

from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import Poses, read_poses

SECONDS = 10
SOURCES = {
    "socket": ("--tcp", "0"),
    "transform": ("--igtl", "0"),
    "qtdata": ("--igtl", "0", "--message", "qtdata"),
    "lsl": ("--lsl", f"hand of {Path(__file__).stem}"),
}
NEAR_MM, NEAR = 1e-4, 1e-6
"""Numbers of 32 bits came."""


def poses_of(study: StudyRun, subject: str) -> Poses:
    """Poses of a subject's one recording."""
    (file,) = (study.results.folder / f"sub-{subject}").rglob("poses.parquet")
    return read_poses(file, read_layout("liberty16").measured)


@pytest.mark.slow
def test_a_hand_is_the_same_by_every_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lsl.cfg").write_text(LSL_HERE)
    monkeypatch.setenv("LSLAPICFG", str(tmp_path / "lsl.cfg"))
    known = record(tmp_path / "rom.parquet", frames=SECONDS * 240)
    sources = {name: port for name, port in SOURCES.items() if name != "lsl" or find_spec("pylsl")}
    with ExitStack() as running:
        recorders = []
        for name, port in sources.items():
            device = running.enter_context(emulator("--recording", str(known), "--loop", port=port))
            out = str(tmp_path / f"{name}.arrows")
            words = ("record", "--port", device.name, "--out", out, "--duration", str(SECONDS))
            recorders.append(running.enter_context(started(*words)))
        for recorder in recorders:
            assert recorder.wait(PATIENCE_S) == 0
    rows = [f"{name}\tright\trom\tboth\t{name}.arrows" for name in sources]
    study = write_study(tmp_path, "sent", [*rows, "file\tright\trom\tboth\trom.parquet"], ["rigid"])
    study.run()
    assert study.results.report.is_file()
    assert study.rows("problems") == []
    sent = poses_of(study, "file")
    there = np.flatnonzero(sent.valid.all(0))  # the layout's forearm has no receiver
    assert len(there) == 16
    for name in sources:
        came = poses_of(study, name)
        assert came.valid[:, there].all()
        off_mm = np.abs(sent.position_mm - came.position_mm[0])[:, there].sum((1, 2))
        rows = (came.frame - came.frame[0] + off_mm.argmin()) % len(sent.frame)
        np.testing.assert_allclose(came.position_mm, sent.position_mm[rows], atol=NEAR_MM, err_msg=name)
        alike = np.abs((came.quaternion * sent.quaternion[rows]).sum(-1))
        np.testing.assert_allclose(alike[:, there], 1, atol=NEAR, err_msg=name)
