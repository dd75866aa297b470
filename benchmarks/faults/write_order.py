"""What a power cut would leave: the order in which a stage's writes reach the disk, as strace sees them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.faults.outcome import Limit, Row, Tries, not_tried
from benchmarks.faults.small_study import Command, SmallStudy, commands_of
from benchmarks.processes import ROOT

FAULT = "the power cut at any moment (strace)"
PROMISED = "a file is synced, then renamed, then its folder synced; nothing else writes under a name"
CALLS = (
    "open,openat,creat,rename,renameat,renameat2,link,linkat,write,pwrite64,writev,ftruncate,fsync,fdatasync"
)
_BY_DESCRIPTOR = re.compile(r"\b(write|pwrite64|writev|ftruncate|fsync|fdatasync)\(\d+<([^>]+)>")
_BY_NAME = re.compile(r"\b(open|openat|creat|rename|renameat2?|link|linkat)\((.*)")
_TEXT = re.compile(r'"((?:[^"\\]|\\.)*)"')


def rows(_: Limit, __: int, study: SmallStudy) -> list[Row]:
    """Trace every command once."""
    if shutil.which("strace") is None:
        return [not_tried(FAULT, "strace is not installed")]
    tries = Tries(FAULT, PROMISED)
    for command in commands_of(study):
        trace = study.folder.with_name(f"{command.name}.trace")
        problem = _traced(study, command, trace) or "; ".join(
            violations(trace.read_text("utf-8", "replace"), study.folder)
        )
        tries.add(f"{command.name}: {problem}" if problem else "")
    return [tries.row()]


def _traced(study: SmallStudy, command: Command, trace: Path) -> str:
    strace = ["strace", "-f", "-y", "-s", "4096", "-e", f"trace={CALLS}", "-o", str(trace)]
    done = subprocess.run(
        [*strace, sys.executable, "-m", "workflow.job", *command.argv],
        cwd=study.folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    return f"exit {done.returncode}: {done.stderr[-300:]}" if done.returncode else ""


def violations(trace: str, folder: Path) -> list[str]:
    """Name what of a traced process below the folder would not be there, or half, after a power cut."""
    unsynced: set[Path] = set()
    renamed: dict[Path, str] = {}  # folders that hold a new name which is not on the disk
    found = []
    for call, paths in _calls(trace, folder):
        if call in ("fsync", "fdatasync"):
            unsynced.discard(paths[0])
            renamed.pop(paths[0], None)
        elif call in ("write", "pwrite64", "writev", "ftruncate"):
            unsynced.add(paths[0])
        elif call.startswith("rename"):
            if paths[0] in unsynced:
                found.append(f"{paths[1].name} is renamed before its bytes are on the disk")
            renamed[paths[1].parent] = paths[1].name
        elif not _passing(paths[0]):
            found.append(f"{paths[0].name} is written under its own name")
    return found + [f"the name {name} is never on the disk" for name in renamed.values()]


def _passing(path: Path) -> bool:
    """Whether a file is a temporary one, or a capture, which grows under its name by whole batches."""
    return path.name.startswith(".") or path.suffix == ".arrows"


def _calls(trace: str, folder: Path) -> Iterator[tuple[str, list[Path]]]:
    """The calls that concern files below the folder, in turn: links and openings for reading left out."""
    for line in trace.splitlines():
        if " = -1 " in line:
            continue
        paths: list[Path] = []
        if match := _BY_DESCRIPTOR.search(line):
            paths = [Path(match[2])]
        elif match := _BY_NAME.search(line):
            writes = "O_WRONLY" in line or "O_RDWR" in line
            if (match[1].startswith("open") and not writes) or match[1].startswith("link"):
                continue
            paths = [Path(os.path.normpath(folder / text)) for text in _TEXT.findall(match[2])]
        if match and paths and all(path.is_relative_to(folder) for path in paths):
            yield match[1], paths
