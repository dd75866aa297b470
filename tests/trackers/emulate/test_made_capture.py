"""Recordings through the emulated device into raw captures, and what they give when they are read."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shukotsu.__main__ import main
from shukotsu.schemas.layout import read_layout
from shukotsu.trackers.archive import END, RECEIVED, SENT, SETTINGS, open_archive
from shukotsu.trackers.decode.stream import Tally, blocks_of
from shukotsu.trackers.emulate.pose_sources import built_in_motion
from shukotsu.trackers.protocols.records import concatenated

FRAMES = 500


def test_poses_come_back_within_float32_centimetres_in_rows_of_a_recorder(tmp_path: Path) -> None:
    """Settings, commands, pieces of about 10 ms in rising time that end anywhere, the end."""
    layout, out, tidy = read_layout("liberty16"), tmp_path / "out.arrows", tmp_path / "rec.parquet"
    segments = {layout.segments[name].receiver: name for name in layout.measured}
    position, quaternion = built_in_motion().poses(np.arange(FRAMES), range(1, 17))
    numbers = np.concatenate([position, quaternion], -1).reshape(-1, 7)
    columns = dict(zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), numbers.T, strict=True))
    columns["frame"] = np.repeat(np.arange(1017, 1017 + FRAMES), 16)
    columns["time_s"] = columns["frame"] / 240
    pq.write_table(pa.table({**columns, "segment": [segments[s] for s in range(1, 17)] * FRAMES}), tidy)
    assert main(["emulate", "--archive", str(out), "--recording", str(tidy)]) == 0
    blocks = list(blocks_of(open_archive(out), Tally()))
    assert not any(block.skipped for block in blocks)
    records = concatenated([block.records for block in blocks]).take(slice(16 * FRAMES))
    assert not records.doubtful.any()
    assert (records.frame.reshape(FRAMES, 16) == np.arange(FRAMES)[:, None]).all()
    assert (records.station.reshape(FRAMES, 16) == np.arange(1, 17)).all()
    assert np.abs(records.position_mm.reshape(FRAMES, 16, 3) - position).max() < 1e-4
    assert np.abs(records.quaternion.reshape(FRAMES, 16, 4) - quaternion).max() < 1e-7
    pieces = list(open_archive(out).pieces())
    kinds, times = (np.concatenate([getattr(p, name) for p in pieces]) for name in ("kind", "host_ns"))
    assert kinds[:2].tolist() == [SETTINGS, SENT]
    assert kinds[-3:].tolist() == [SENT, RECEIVED, END]
    arrivals = np.diff(times[kinds == RECEIVED])[:-2]
    assert len(arrivals) == pytest.approx(FRAMES / 240 * 100, abs=3)
    assert 8e6 < arrivals.min() < arrivals.max() < 12e6
    assert any(len(data) % 16 for piece in pieces for data in piece.data)
