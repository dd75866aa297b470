"""An hour of 16 receivers at 240 Hz: the raw capture to Parquet, beside copying the same bytes."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.made_up_capture import STATIONS, write_capture
from benchmarks.text_table import TextTable

ROOT = Path(__file__).resolve().parent.parent
HOUR_S = 3600.0
COPY = """
import sys
with open(sys.argv[1], "rb") as source, open(sys.argv[2], "wb") as target:
    while piece := source.read(1 << 20):
        target.write(piece)
"""


def run(rounds: int = 3, seconds: float = HOUR_S) -> Iterator[TextTable]:
    """Give the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        capture, table, copy = folder / "hour.arrows", folder / "hour.parquet", folder / "copy"
        sent = write_capture(capture, seconds)
        decode = ["-m", "stages.capture", "decode", "--in", str(capture), "--out", str(table)]
        taken = [(_process(decode), _process(["-c", COPY, str(capture), str(copy)])) for _ in range(rounds)]
        written = table.stat().st_size
    best = min(decoded.seconds for decoded, _ in taken)
    ratio = sorted(decoded.seconds / copied.seconds for decoded, copied in taken)[rounds // 2]
    records = len(STATIONS) * int(seconds * 240)
    yield TextTable(
        f"decode_capture: {seconds:.0f} s of 16 receivers at 240 Hz, {rounds} rounds in turns",
        (
            ("what", ""),
            ("records", ",d"),
            ("MB sent", ".0f"),
            ("MB written", ".0f"),
            ("best s", ".2f"),
            ("MB/s", ".0f"),
            ("most memory MB", ".0f"),
            ("x copying", ".1f"),
        ),
        [
            (
                "decode",
                records,
                sent / 1e6,
                written / 1e6,
                best,
                sent / 1e6 / best,
                max(decoded.memory_mb for decoded, _ in taken),
                ratio,
            )
        ],
        "From the raw capture to the table of records, in two passes, a process with its start-up. Copying "
        "reads the same file and writes it again, 1 MB at a time; the ratio is the median of the rounds.",
    )


@dataclass(frozen=True)
class _Run:
    """One process: wall seconds and the most memory it had."""

    seconds: float
    memory_mb: float


def _process(words: Sequence[str]) -> _Run:
    started = time.perf_counter()
    child = subprocess.Popen([sys.executable, *words], cwd=ROOT, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    seconds = time.perf_counter() - started
    if os.waitstatus_to_exitcode(status):
        raise RuntimeError(f"{' '.join(words)} ended with {os.waitstatus_to_exitcode(status)}")
    child.returncode = 0
    return _Run(seconds, usage.ru_maxrss * 1024 / 1e6)
