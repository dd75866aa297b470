"""SIGKILL at random moments of a recording: what was in the file before is decoded afterwards."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.faults.forked_job import prepare, run_forked
from benchmarks.faults.outcome import Limit, Row, Tries
from benchmarks.faults.small_study import SmallStudy
from benchmarks.processes import ROOT
from schemas.errors import InputError
from trackers.archive import RECEIVED, open_archive

LONGEST_S = 2.5
PROMISED = "all that was written before is read; the name is never written over"


def rows(limit: Limit, seed: int, study: SmallStudy) -> list[Row]:
    """Kill the recorder of an emulated tracker, so often."""
    prepare()
    chance, tries = random.Random(seed), Tries("SIGKILL of record", PROMISED)
    with emulator() as port:
        while not limit.reached(tries.tried):
            tries.add(kill_once(port, study.folder / f"{tries.tried}.arrows", chance.uniform(0, LONGEST_S)))
    return [tries.row()]


@contextmanager
def emulator() -> Iterator[str]:
    """An emulated tracker at a pseudo-terminal; gives its port."""
    command = [sys.executable, "-m", "stages.capture", "emulate", "--pty"]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield next(part for part in process.stdout.readline().split() if "/" in part)
    finally:
        process.terminate()
        process.communicate()


def kill_once(port: str, out: Path, seconds: float) -> str:
    """Kill a recorder after so long; give what was not as promised."""
    record = ["stages.capture", "record", f"--port={port}", f"--out={out}", "--duration=60"]
    ended = run_forked(record, out.parent, seconds)
    if ended.code != -signal.SIGKILL:
        return f"ended by itself with {ended.code}: {ended.said[-300:]}"
    if not out.exists():
        return ""
    before = out.read_bytes()
    try:
        pieces = list(open_archive(out).pieces())
    except InputError as error:
        return f"not to be read: {error}" if before else ""
    received = sum(kind == RECEIVED for piece in pieces for kind in piece.kind)
    if any(piece.spoilt_bytes or piece.missing_rows or piece.unreadable_bytes for piece in pieces):
        return "rows are damaged"
    decoded = out.with_suffix(".parquet")
    end = run_forked(["stages.capture", "decode", f"--in={out}", f"--out={decoded}"], out.parent)
    if end.refusal or (received and "settings" not in end.said and end.code not in (0, 2)):
        return f"decode: {end.refusal}"
    again = run_forked(record, out.parent)
    return "" if again.code == 2 and out.read_bytes() == before else "written over"
