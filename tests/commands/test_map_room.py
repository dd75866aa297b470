"""`shukotsu wand` on captures: what it prints and writes, and what it says of others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from coached_hands import archive
from wands import bar

from shukotsu.commands.map_room import main
from shukotsu.schemas.catalogue import ROOM_MAP
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.tables import column_array, read_table

SEGMENTS = ("index_middle", "index_distal")


def capture(folder: Path, *segments: str) -> Path:
    """Write what a tracker sends of a bar, as its raw capture."""
    own, n = bar(steel=True), len(segments)
    valid = np.ones((len(own.time_s), n), bool)
    frame = np.arange(len(own.time_s))
    return archive(
        folder, Poses(segments, frame, frame / 240, own.position_mm[:, :n], own.quaternion[:, :n], valid)
    )


def test_a_room_with_steel_is_said_drawn_and_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording, out = capture(tmp_path, *SEGMENTS), tmp_path / "room.parquet"
    assert main([str(recording), f"--out={out}"]) == 0
    said = capsys.readouterr().out
    assert "receivers 6 and 7, 100.1 mm apart, 14400 frames" in said
    assert "largest trusted box: " in said
    assert "+52 cm in x" in said.split("\noff by", 1)[1].splitlines()[0], "beside the steel"
    assert "+++" in said.partition("slices")[2]
    table = read_table(out, ROOM_MAP)
    assert column_array(table, "bar_mm")[0] == pytest.approx(100.0, abs=0.2)
    trusted, error_mm = (np.array(table.column(name)) for name in ("trusted", "error_mm"))
    assert trusted.any()
    assert np.nanmax(error_mm) > 2.0
    assert main([str(recording)]) == 0, "the map need not be written"


def test_one_receiver_is_no_wand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(capture(tmp_path, SEGMENTS[0]))]) == 2
    assert "recording.arrows: has receivers " in (said := capsys.readouterr().err)
    assert said.count("\n") <= 2
    assert "expected two, on one rigid bar" in said
