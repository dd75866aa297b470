"""Tables in plain text, the pages of the guide that contain them, and processes with their resources."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from typing import Any, TypeVar

from shukotsu.tables.text_files import replaced_between
from shukotsu.tables.whole_files import write_text

T = TypeVar("T")
Cell = str | float | int | None
Row = tuple[Cell, ...]

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
_WIDTH = 110


@dataclass(frozen=True)
class PrintedTable:
    """A table in plain text.

    Attributes
    ----------
    title : str
        First line.
    columns : sequence of str
        For each column "name", or "name:format" with a format as in an f-string.
    rows : sequence of Row
        Cells; None is printed as a dash.
    meaning : str
        Explanation of the numbers, printed below the table.

    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Row]
    meaning: str

    def __str__(self) -> str:
        heads = [column.rpartition(":")[0] or column for column in self.columns]
        forms = [column.rpartition(":")[2] if ":" in column else "" for column in self.columns]
        body = [
            ["-" if cell is None else format(cell, form) for cell, form in zip(row, forms, strict=True)]
            for row in self.rows
        ]
        widths = [max(map(len, column)) for column in zip(heads, *body, strict=True)]
        aligns = [">" if form else "<" for form in forms]
        lines = [
            "  ".join(f"{c:{a}{w}}" for c, a, w in zip(cells, aligns, widths, strict=True)).rstrip()
            for cells in [heads, ["-" * width for width in widths], *body]
        ]
        return "\n".join([self.title, *lines, *textwrap.wrap(self.meaning, _WIDTH)])


def percent(values: Iterable[Any]) -> float:
    """Return the mean of numbers in percent: of booleans, the share of those that are true."""
    return 100.0 * fmean(values)


def write_tables(page: str, tables: Sequence[PrintedTable], command: str, section: str) -> None:
    """Write the tables of a command into a page of docs/, with the machine on which they were measured.

    section : name of the marks in the page between which the tables are.
    """
    path = DOCS / page
    blocks = [f"As printed by `{command}` on {machine()}."]
    blocks += [f"```text\n{table}\n```" for table in tables]
    start, end = (f"<!-- {section}: {end} -->" for end in ("start", "end"))
    write_text(path, replaced_between(path.read_text("utf-8"), start, end, "\n\n".join(blocks)))


def machine() -> str:
    """Describe this machine: cores, processor, memory, system, Python and packages."""
    memory_kb = _entry("/proc/meminfo", "MemTotal").removesuffix(" kB")
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "pyarrow", "scipy", "snakemake"))
    return (
        f"{os.cpu_count()} cores of {_entry('/proc/cpuinfo', 'model name') or platform.processor()}, "
        f"{round(int(memory_kb or 0) / 1e6) or '?'} GB, {platform.system()} {platform.release()}, "
        f"Python {platform.python_version()}, {packages}"
    )


def _entry(file: str, name: str) -> str:
    """Return the first value of that name in a file of `name : value` lines; empty if there is none."""
    path = Path(file)
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), "")


def of_each_person(measured: Callable[[int], T], n_people: int, seed: int) -> list[T]:
    """Return the results of `measured` for the seeds of n_people drawn people."""
    return in_two_processes(measured, range(seed, seed + n_people))


def in_two_processes(measured: Callable[..., T], *arguments: Iterable[Any]) -> list[T]:
    """Map a function over its arguments, like `map`, in two processes, which are new interpreters."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        return list(pool.map(measured, *arguments))


# A separate small process, because Linux attributes the memory of a forking parent to its child.
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
    """Resources and output of a process.

    Attributes
    ----------
    seconds, processor_s : float
        Wall-clock time; processor time including child processes.
    memory_mb : float
        Memory of the largest of these processes.
    output : str
        Standard output and error.

    """

    seconds: float
    processor_s: float
    memory_mb: float
    output: str


def run_python(*arguments: str, folder: Path = ROOT, **environment: str) -> Usage:
    """Run this Python with one thread and this project importable; raise RuntimeError if it fails."""
    command = [sys.executable, *arguments]
    launcher = [sys.executable, "-c", _LAUNCHER, *command]
    variables = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)} | environment
    text = subprocess.check_output(launcher, cwd=folder, env=variables, stderr=subprocess.STDOUT, text=True)
    output, _, measured = text.rstrip().rpartition("\n")
    code, seconds, processor_s, memory_mb = measured.split()
    if int(code):
        raise RuntimeError(f"{' '.join(command)} ended with {code}:\n{output[-4000:]}")
    return Usage(float(seconds), float(processor_s), float(memory_mb), output)


def run_study(folder: Path, cores: int, *options: str, **environment: str) -> Usage:
    """Run the folder's study.yaml by Snakemake; raise RuntimeError if it fails."""
    words = [f"--snakefile={ROOT / 'Snakefile'}", f"--cores={cores}", f"--configfile={folder / 'study.yaml'}"]
    return run_python("-m", "snakemake", *words, *options, folder=folder, **environment)
