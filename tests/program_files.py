"""Files of the program as they are installed: the package, and what beside it a wheel carries; running it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "shukotsu"
BESIDE = ("Snakefile", "config", "data", "profiles", "schemas", "stages")
"""What lies beside the package in a checkout, and inside it in a wheel (pyproject.toml)."""


def package_files(folder: Path = PACKAGE, suffix: str = "") -> Iterator[Path]:
    """Return every file of a folder of the program, sorted; none that a run has left."""
    for path in sorted(folder.iterdir()):
        if path.is_dir() and path.name not in ("__pycache__", "recordings"):
            yield from package_files(path, suffix)
        elif path.is_file() and path.name.endswith(suffix):
            yield path


def program_files(suffix: str = "") -> Iterator[Path]:
    """Return every file of the program, those beside the package too."""
    for name in ("shukotsu", *BESIDE):
        path = REPOSITORY / name
        if path.is_dir():
            yield from package_files(path, suffix)
        elif path.name.endswith(suffix):
            yield path


def started(code: str, **how: Any) -> subprocess.Popen[str]:
    """Start code that has the program to import, and wait until it has printed 1."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    pipes = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
    process = subprocess.Popen([sys.executable, "-c", code], env=environment, text=True, **pipes, **how)
    assert process.stdout is not None
    assert process.stdout.readline() == "1\n"
    return process


def printed_by(*words: object, **how: Any) -> str:
    """Run a program to its end; return what it prints."""
    done = subprocess.run(
        [*map(str, words)], capture_output=True, text=True, timeout=1500, check=False, **how
    )
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def run_python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python to its end in a folder from which it imports nothing, with the program to import."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "COLUMNS": "100"}
    command = [sys.executable, "-P", *words]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
