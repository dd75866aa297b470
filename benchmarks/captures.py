"""16 receivers at 240 Hz: an hour's raw capture to Parquet beside copying it; recording live, the view on."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.benchmark_table import TextTable
from benchmarks.processes import ROOT, Usage, run_python
from trackers.archive import ArchiveWriter, open_archive
from trackers.decode.survey import survey_archive
from trackers.liberty.items import HEADER_BYTES, OUTPUT_ITEMS
from trackers.protocols.stream_settings import StreamSettings

HOUR_S = 3600.0
STATIONS = tuple(range(1, 17))
RATE_HZ = 240.0
ITEMS = (8, 9, 11, 3, 7)
"""48 bytes a record, the list that the field's drivers ask for."""

CHUNK_FRAMES = 3
"""Frames in what one read returns: 12.5 ms."""
COPY = """
import sys
with open(sys.argv[1], "rb") as source, open(sys.argv[2], "wb") as target:
    while piece := source.read(1 << 20):
        target.write(piece)
"""

LIVE_S = 120.0
TRANSPORTS = {"pseudo-terminal": ("--pty",), "socket://": ("--tcp", "0")}
_ON_A_TERMINAL = "import pty, sys; sys.exit(pty.spawn(sys.argv[1:]) >> 8)"


def run(rounds: int = 3, seconds: float = HOUR_S, live_s: float = LIVE_S) -> Iterator[TextTable]:
    """Give the tables."""
    yield decoding(rounds, seconds)
    yield live(live_s)


def decoding(rounds: int, seconds: float) -> TextTable:
    """Time the decoding of a capture of that length."""
    with tempfile.TemporaryDirectory() as name:
        capture, table, copy = (str(Path(name, file)) for file in ("hour.arrows", "hour.parquet", "copy"))
        sent = write_capture(Path(capture), seconds)
        decode = ("-m", "stages.capture", "decode", "--in", capture, "--out", table)
        usages = [(run_python(*decode), run_python("-c", COPY, capture, copy)) for _ in range(rounds)]
        written = Path(table).stat().st_size
    best_s = min(decoded.seconds for decoded, _ in usages)
    memory_mb = max(decoded.memory_mb for decoded, _ in usages)
    ratio = sorted(decoded.seconds / copied.seconds for decoded, copied in usages)[rounds // 2]
    records = len(STATIONS) * int(seconds * 240)
    return TextTable(
        f"captures: {seconds:.0f} s of 16 receivers at 240 Hz, {rounds} rounds in turns",
        (
            "records:,d",
            "MB sent:.0f",
            "MB written:.0f",
            "best s:.2f",
            "MB/s:.0f",
            "most memory MB:.0f",
            "x copying:.1f",
        ),
        [(records, sent / 1e6, written / 1e6, best_s, sent / 1e6 / best_s, memory_mb, ratio)],
        "From the raw capture to the table of records, in two passes, a process with its start-up. Copying "
        "reads the same file and writes it again, 1 MB at a time; the ratio is the median of the rounds.",
    )


def live(seconds: float) -> TextTable:
    """Record for so long."""
    rows = []
    for name, options in TRANSPORTS.items():
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder, "live.arrows")
            usage = record(options, out, seconds)
            survey = survey_archive(open_archive(out))
        lost = survey.missing_frames + len(survey.partial_frames)
        frames = survey.last_frame - survey.first_frame + 1
        cpu_percent = 100 * usage.processor_s / usage.seconds
        delay_ms = survey.clock.delay_ms if survey.clock else None
        rows.append((name, frames, lost, survey.skipped_bytes, cpu_percent, usage.memory_mb, delay_ms))
    return TextTable(
        f"captures: {seconds:.0f} s of 16 receivers at 240 Hz, 56 bytes a record, with the live view",
        (
            "through",
            "frames:,d",
            "lost:d",
            "skipped bytes:d",
            "% of one core:.1f",
            "most memory MB:.0f",
            "median delay ms:.1f",
        ),
        rows,
        "The recorder as a process on a terminal of its own, start-up and all, on an emulated tracker in "
        "another. Lost are frames of which a receiver's record is missing. The delay is that of a record's "
        "last byte behind the clock that was fitted to the frame counter.",
    )


def record(options: tuple[str, ...], out: Path, seconds: float) -> Usage:
    """Record from an emulated tracker with these options; give what the recorder took."""
    command = [sys.executable, "-m", "stages.capture"]
    emulator = subprocess.Popen([*command, "emulate", *options], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert emulator.stdout is not None
        port = next(part for part in emulator.stdout.readline().split() if "/" in part)
        recorder = [*command, "record", f"--port={port}", f"--out={out}", f"--duration={seconds}"]
        return run_python("-c", _ON_A_TERMINAL, *recorder)
    finally:
        emulator.terminate()
        emulator.wait()


def write_capture(path: Path, seconds: float, seed: int = 0) -> int:
    """Write a capture of 16 receivers at 240 Hz, every record the protocol's, the poses smooth and random.

    Gives the number of bytes that the tracker sent.
    """
    lists = dict.fromkeys(STATIONS, ITEMS)
    settings = StreamSettings("liberty", "binary", "cm", RATE_HZ, STATIONS, lists, {}, {})
    writer = ArchiveWriter(path, {"made_up": True, "seed": seed}, utc_offset_ns=lambda: 0)
    writer.settings(settings.to_json(), 0)
    random = np.random.default_rng(seed)
    period_ns = 1e9 / RATE_HZ
    sent = 0
    for first in range(0, int(seconds * RATE_HZ), 240):
        rows = _second(first, random)
        for start in range(0, 240, CHUNK_FRAMES):
            piece = rows[start : start + CHUNK_FRAMES].tobytes()
            late_ns = int(random.integers(0, 2_000_000))
            writer.received(piece, int((first + start + CHUNK_FRAMES) * period_ns) + late_ns)
            sent += len(piece)
        writer.flush()
    writer.close({"reason": "duration"}, int(seconds * 1e9))
    return sent


def _second(first: int, random: np.random.Generator) -> np.ndarray:
    """Records of 240 frames, (240, 16)."""
    rows = np.zeros((240, len(STATIONS)), OUTPUT_ITEMS.record_type(ITEMS))
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
