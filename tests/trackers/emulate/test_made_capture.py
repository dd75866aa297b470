"""Recordings through the emulated device into raw captures, and what they give when they are read."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shukotsu.__main__ import main
from shukotsu.schemas.layout import read_layout
from shukotsu.trackers.archive import END, RECEIVED, SENT, SETTINGS, open_archive
from shukotsu.trackers.emulate.pose_sources import MAX_STATION, built_in_motion
from shukotsu.trackers.liberty.binary_decoder import BinaryDecoder
from shukotsu.trackers.protocols.records import Records, concatenated
from shukotsu.trackers.protocols.stream_settings import settings_from_json

LAYOUT = read_layout("liberty16")
SEGMENTS = {LAYOUT.segments[name].receiver: name for name in LAYOUT.measured}
FRAMES = 500


def write_capture(path: Path, out: Path, *words: str) -> None:
    """Write a capture of a LIBERTY with 16 connectors that measured this recording."""
    assert main(["emulate", "--archive", str(out), "--recording", str(path), *words]) == 0


def recording(
    path: Path, frames: list[int], stations: range = range(1, 17), *, lost: tuple[int, int] = (-1, 0)
) -> Path:
    """Write a tidy recording of the built-in motion; `lost` is a row and station without numbers."""
    position, quaternion = built_in_motion().poses(np.arange(len(frames)), range(1, MAX_STATION + 1))
    numbers = np.concatenate([position, quaternion], -1)
    if lost[0] >= 0:
        numbers[lost[0], lost[1] - 1] = np.nan
    chosen = numbers[:, [min(station, 16) - 1 for station in stations]].reshape(-1, 7)
    columns = dict(zip(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"), chosen.T, strict=True))
    names = [SEGMENTS[station] for station in stations] * len(frames)
    table = {
        "frame": np.repeat(frames, len(stations)),
        "time_s": np.repeat(np.array(frames) / 240, len(stations)),
    }
    pq.write_table(pa.table({**table, "segment": names, **columns}), path)
    return path


def rows(path: Path) -> list[tuple[int, int, bytes]]:
    """Host time, kind and data of every row."""
    return [
        row for piece in open_archive(path).pieces()
        for row in zip(piece.host_ns.tolist(), piece.kind.tolist(), piece.data, strict=True)
    ]  # fmt: skip


def decoded(path: Path) -> Records:
    """Decode what came behind the settings, piece by piece; no byte may be skipped."""
    import json

    found = rows(path)
    start = next(index for index, (_, kind, _) in enumerate(found) if kind == SETTINGS)
    decoder = BinaryDecoder(settings_from_json(json.loads(found[start][2]), str(path)))
    parts = [decoder.feed(data) for _, kind, data in found[start:] if kind == RECEIVED]
    parts.append(decoder.feed(b"", final=True))
    assert not any(part.skipped for part in parts)
    return concatenated([part.records for part in parts])


def test_poses_come_back_within_float32_centimetres(tmp_path: Path) -> None:
    path = recording(tmp_path / "rec.parquet", list(range(1017, 1017 + FRAMES)))
    out = tmp_path / "out.arrows"
    write_capture(path, out)
    records = decoded(out)
    assert len(records) == 16 * FRAMES
    assert not records.doubtful.any()
    frame, station = records.frame.reshape(FRAMES, 16), records.station.reshape(FRAMES, 16)
    assert (frame == np.arange(FRAMES)[:, None]).all()
    assert (station == np.arange(1, 17)).all()
    position, quaternion = built_in_motion().poses(np.arange(FRAMES), range(1, 17))
    assert np.abs(records.position_mm.reshape(FRAMES, 16, 3) - position).max() < 1e-4
    assert np.abs(records.quaternion.reshape(FRAMES, 16, 4) - quaternion).max() < 1e-7


def test_rows_are_those_of_a_recorder(tmp_path: Path) -> None:
    """Settings, commands, pieces of about 10 ms in rising time, the end."""
    out = tmp_path / "out.arrows"
    write_capture(recording(tmp_path / "rec.parquet", list(range(FRAMES))), out)
    captured = rows(out)
    times, kinds, _ = zip(*captured, strict=True)
    assert times == tuple(sorted(times))
    assert kinds[:2] == (SETTINGS, SENT)
    assert kinds[-3:] == (SENT, RECEIVED, END)
    pieces = [host_ns for host_ns, kind, _ in captured if kind == RECEIVED]
    assert len(pieces) == pytest.approx(FRAMES / 240 * 100, abs=2)
    assert min(np.diff(pieces)[:-2]) > 8e6
    assert max(np.diff(pieces)) < 12e6
    assert any(len(data) % 16 for _, kind, data in captured if kind == RECEIVED), "pieces end anywhere"
