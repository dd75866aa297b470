"""Recording live: 16 receivers at 240 Hz through a pseudo-terminal and a network port, the view on."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.benchmark_table import TextTable
from benchmarks.processes import ROOT, Usage, run_python
from trackers.archive import open_archive
from trackers.decode.survey import survey_archive

SECONDS = 120.0
TRANSPORTS = {"pseudo-terminal": ("--pty",), "socket://": ("--tcp", "0")}
_ON_A_TERMINAL = "import pty, sys; sys.exit(pty.spawn(sys.argv[1:]) >> 8)"


def run(seconds: float = SECONDS) -> Iterator[TextTable]:
    """Give the table."""
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
    yield TextTable(
        f"capture_live: {seconds:.0f} s of 16 receivers at 240 Hz, 56 bytes a record, with the live view",
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
