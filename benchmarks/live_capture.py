"""Recording live: 16 receivers at 240 Hz through a pseudo-terminal and a network port, the view on."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.text_table import TextTable
from stages.capture.archive import open_archive
from stages.capture.decode.survey import Survey, survey_archive

ROOT = Path(__file__).resolve().parent.parent
SECONDS = 120.0
TRANSPORTS = {"pseudo-terminal": "--pty", "socket://": "--tcp"}


def run(seconds: float = SECONDS) -> Iterator[TextTable]:
    """Give the table."""
    rows = []
    for name, option in TRANSPORTS.items():
        with tempfile.TemporaryDirectory() as folder:
            recorded = _record(option, Path(folder, "live.arrows"), seconds)
        survey = recorded.survey
        lost = survey.missing_frames + len(survey.partial_frames)
        delay_ms = survey.clock.delay_ms if survey.clock else None
        frames = survey.last_frame - survey.first_frame + 1
        rows.append(
            (name, frames, lost, survey.skipped_bytes, recorded.cpu_percent, recorded.memory_mb, delay_ms)
        )
    yield TextTable(
        f"live_capture: {seconds:.0f} s of 16 receivers at 240 Hz, 56 bytes a record, with the live view",
        (
            ("through", ""),
            ("frames", ",d"),
            ("lost", "d"),
            ("skipped bytes", "d"),
            ("% of one core", ".1f"),
            ("most memory MB", ".0f"),
            ("median delay ms", ".1f"),
        ),
        rows,
        "The recorder as a process, start-up and all, on an emulated tracker in another. Lost are frames of "
        "which a receiver's record is missing. The delay is that of a record's last byte behind the clock "
        "that was fitted to the frame counter.",
    )


@dataclass(frozen=True)
class _Recorded:
    """What a recording cost and holds."""

    cpu_percent: float
    memory_mb: float
    survey: Survey


def _record(option: str, out: Path, seconds: float) -> _Recorded:
    where = [option, "0"] if option == "--tcp" else [option]
    emulator = subprocess.Popen(
        [sys.executable, "-m", "stages.capture", "emulate", *where],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert emulator.stdout is not None
        port = next(word for word in emulator.stdout.readline().split() if "/" in word)
        words = ["--port", port, "--out", str(out), "--duration", str(seconds)]
        return _on_a_terminal([sys.executable, "-m", "stages.capture", "record", *words], out)
    finally:
        emulator.terminate()
        emulator.wait()


def _on_a_terminal(command: list[str], out: Path) -> _Recorded:
    """Run the recorder on a terminal of its own, whose text is read and thrown away."""
    ours, theirs = pty.openpty()
    started = time.perf_counter()
    child = subprocess.Popen(command, cwd=ROOT, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    threading.Thread(target=_drain, args=(ours,), daemon=True).start()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    wall_s = time.perf_counter() - started
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {child.returncode}")
    cpu_percent = 100 * (usage.ru_utime + usage.ru_stime) / wall_s
    return _Recorded(cpu_percent, usage.ru_maxrss * 1024 / 1e6, survey_archive(open_archive(out)))


def _drain(terminal: int) -> None:
    try:
        while os.read(terminal, 4096):
            pass
    except OSError:  # the other end is closed
        os.close(terminal)
