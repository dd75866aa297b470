"""A process and its resource usage, the processes that it starts and waits for included."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# A small process of its own: Linux counts the memory of a parent that forks as the child's.
_LAUNCHER = """
import resource, subprocess, sys, time
started = time.perf_counter()
code = subprocess.call(sys.argv[1:])
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print()
print(code, time.perf_counter() - started, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6)
"""


@dataclass(frozen=True)
class Usage:
    """Hold what a process used: seconds by the clock, processor seconds of it and its children, the memory of
    the largest of them in MB; and what they printed.
    """

    seconds: float
    processor_s: float
    memory_mb: float
    output: str


def run_process(command: Sequence[str], folder: Path = ROOT, **environment: str) -> Usage:
    """Run a command in a folder, with this project importable and one thread; RuntimeError where it fails."""
    paths = os.pathsep.join(filter(None, [environment.pop("PYTHONPATH", ""), str(ROOT)]))
    launched = subprocess.run(
        [sys.executable, "-c", _LAUNCHER, *command],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": paths} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=True,
    )
    output, _, measured = launched.stdout.rstrip().rpartition("\n")
    code, seconds, processor_s, memory_mb = measured.split()
    if int(code):
        raise RuntimeError(f"{' '.join(command)} ended with {code}:\n{output[-4000:]}")
    return Usage(float(seconds), float(processor_s), float(memory_mb), output)


def run_python(*arguments: str, folder: Path = ROOT) -> Usage:
    """Run this Python with arguments, in the project's folder or another; RuntimeError where it fails."""
    return run_process([sys.executable, *arguments], folder)
