"""Fixtures for the coach: a browser, an archive of a simulated calibration, and quick fits."""

from pathlib import Path

import pytest
from browser import browser, watched_page  # noqa: F401
from simulated_poses import recorded, write_poses

from shukotsu.__main__ import main
from shukotsu.coach import coach


@pytest.fixture(autouse=True)
def _few_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coach, "MOST_FITTED", 20)


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Archive of 3 s of a right hand moving through the range of its joints."""
    folder = tmp_path_factory.mktemp("archive")
    played = write_poses(folder / "a.parquet", recorded(seed=7001, n_frames=720)[1], "right", "rom")
    out = folder / "recording.arrows"
    assert main(["emulate", f"--archive={out}", f"--recording={played}"]) == 0
    return out
