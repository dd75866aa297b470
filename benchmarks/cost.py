"""What the stages and whole studies cost, all of it, into the guide's page with the machine it ran on."""

from __future__ import annotations

import importlib
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from benchmarks.page import write_tables
from benchmarks.text_table import TextTable

PARTS = ("studies", "long_recordings", "solve_hand", "joint_solve")
PACKAGES = ("numpy", "pyarrow", "scipy", "snakemake")


def run() -> Iterator[TextTable]:
    """Give the tables of every part as they come; put them into the page at the end."""
    made = []
    for part in PARTS:
        for table in importlib.import_module(f"benchmarks.{part}").run():
            made.append(table)
            yield table
    write_tables("benchmarks.md", made, [f"As printed by `make bench` on {machine()}."])


def machine() -> str:
    """Say what this machine is: processor, cores, memory, system, Python and packages."""
    from os import cpu_count

    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    python = ".".join(map(str, sys.version_info[:3]))
    return (
        f"{cpu_count()} cores of {_entry('/proc/cpuinfo', 'model name') or platform.processor()}, "
        f"{_memory_gb()} GB, {platform.system()} {platform.release()}, Python {python}, {packages}"
    )


def _memory_gb() -> str:
    kilobytes = _entry("/proc/meminfo", "MemTotal").removesuffix(" kB")
    return str(round(int(kilobytes) / 1e6)) if kilobytes else "?"


def _entry(file: str, name: str) -> str:
    """The first value of that name in a file of `name : value` lines; empty where there is none."""
    path = Path(file)
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    values = [line.partition(":")[2].strip() for line in lines if line.startswith(name)]
    return values[0] if values else ""
