"""Reading a raw capture: its parts, and its memory; what decoding gives is tested with the trackers."""

from __future__ import annotations

from pathlib import Path

import captures
import numpy as np
import pyarrow.parquet as pq
import pytest

from benchmarks.processes import run_python
from shukotsu.commands.import_file import main
from shukotsu.errors import InputError
from shukotsu.readers.formats.raw_capture import read_capture
from shukotsu.readers.samples import joined
from shukotsu.study.layout import read_layout
from shukotsu.study.mapping import mapping_from_config
from shukotsu.tables.typed_table import read_metadata
from shukotsu.tracker.archive import ArchiveWriter
from shukotsu.tracker.liberty.replies import HEADER_BYTES, record_type
from shukotsu.tracker.protocols.stream_settings import StreamSettings

LIBERTY = read_layout("liberty16")
STATIONS = tuple(range(1, 17))
ITEMS = (8, 9, 11, 3, 7)


def write_capture(path: Path, seconds: float) -> None:
    """Write a capture of 16 receivers at 240 Hz, every record the protocol's, the poses smooth and random."""
    lists = dict.fromkeys(STATIONS, ITEMS)
    settings = StreamSettings("liberty", "binary", "cm", 240.0, STATIONS, lists, {}, {})
    writer = ArchiveWriter(path, {"made_up": True}, utc_offset_ns=lambda: 0)
    writer.settings(settings.to_json(), 0)
    random = np.random.default_rng(0)
    period_ns = 1e9 / 240.0
    for first in range(0, int(seconds * 240.0), 240):
        rows = _second(first, random)
        for start in range(0, 240, 3):
            piece = rows[start : start + 3].tobytes()
            late_ns = int(random.integers(0, 2_000_000))
            writer.received(piece, int((first + start + 3) * period_ns) + late_ns)
        writer.flush()
    writer.close({"reason": "duration"}, int(seconds * 1e9))


def _second(first: int, random: np.random.Generator) -> np.ndarray:
    """Records of 240 frames, (240, 16)."""
    rows = np.zeros((240, len(STATIONS)), record_type(ITEMS))
    raw = rows.view(np.uint8).reshape(240, len(STATIONS), -1)
    raw[..., :2] = np.frombuffer(b"LY", np.uint8)
    rows["station"] = STATIONS
    rows["command"] = ord("C")
    rows["size"] = rows.dtype.itemsize - HEADER_BYTES
    frame = np.arange(first, first + 240)[:, None]
    rows["frame"] = frame
    rows["device_ms"] = frame * 1000 // 240
    phase = frame / 240 + np.arange(len(STATIONS)) / 3
    for index, axis in enumerate("xyz"):
        rows[axis] = 25 + 5 * np.sin(phase + index) + random.normal(0, 0.005, phase.shape)
    half = 0.5 * np.sin(phase) + random.normal(0, 0.001, phase.shape)
    rows["qw"], rows["qx"] = np.cos(half), np.sin(half) * 0.6
    rows["qy"] = np.sin(half) * 0.8
    return rows


def test_the_tracker_is_named(tmp_path: Path) -> None:
    """In the samples, and in the metadata of the poses table that is made of them."""
    path, out = tmp_path / "rom.arrows", tmp_path / "poses.parquet"
    write_capture(path, 0.2)
    assert joined(read_capture(path, LIBERTY, None)).tracker == "LIBERTY"
    names = "--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"
    assert main([f"--in={path}", f"--out={out}", "--record-failure", *names]) == 0
    assert read_metadata(out)["parameters"]["tracker"] == "LIBERTY"


@pytest.mark.parametrize(
    ("receivers", "segments", "note"),
    [
        (None, {"hand": 1, "thumb_metacarpal": 2, "thumb_proximal": 3}, ""),
        ({"hand": 3, "ring_distal": 2}, {"hand": 3, "ring_distal": 2}, "receiver 1: not in layout"),
        ({"hand": 9}, None, "'9' is not in"),
    ],
)
def test_whose_receiver_is_which_is_said_by_a_mapping_or_the_layout(
    tmp_path: Path, receivers, segments, note
) -> None:
    path = captures.write(tmp_path / "a.arrows", [captures.cycle(frame) for frame in range(20)])
    mapping = receivers and mapping_from_config(
        {
            "format": "capture",
            "position_unit": "cm",
            "receivers": {segment: {"value": value} for segment, value in receivers.items()},
        },
        "m.yaml",
    )
    if segments is None:
        with pytest.raises(InputError, match=note):
            joined(read_capture(path, LIBERTY, mapping))
        return
    samples = joined(read_capture(path, LIBERTY, mapping))
    stations = np.rint(samples.numbers[:, 0] / 10).astype(int) - 20
    placed = {(samples.segments[at], n) for at, n in zip(samples.segment, stations.tolist(), strict=True)}
    assert placed == {*segments.items()}
    assert any(note in told for told in samples.notes) or not note


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """Of six minutes of 16 receivers, 117 MB of rows, one receiver at a time is in memory."""
    memory_mb = []
    for minutes in (1, 6):
        path, out = tmp_path / f"{minutes}.arrows", tmp_path / f"{minutes}.parquet"
        write_capture(path, minutes * 60.0)
        names = "--layout=liberty16", "--subject=01", "--hand=right", "--task=rom"
        argv = ["-m", "shukotsu", "import", f"--in={path}", f"--out={out}", *names]
        memory_mb.append(run_python(*argv).memory_mb)
        assert pq.ParquetFile(out).metadata.num_rows == 16 * minutes * 60 * 240
    assert memory_mb[1] - memory_mb[0] < 50
