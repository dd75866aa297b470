"""The program's files as installed (the package and the files that a wheel adds), and running the program."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "shukotsu"
BESIDE = ("Snakefile", "config", "data", "profiles", "schemas", "stages")
"""Files and folders beside the package in a checkout, and inside it in a wheel (pyproject.toml)."""


def package_files(folder: Path = PACKAGE, suffix: str = "") -> Iterator[Path]:
    """Yield the files of a folder of the program in sorted order, except files left by runs."""
    for path in sorted(folder.iterdir()):
        if path.is_dir() and path.name not in ("__pycache__", "recordings"):
            yield from package_files(path, suffix)
        elif path.is_file() and path.name.endswith(suffix):
            yield path


def program_files(suffix: str = "") -> Iterator[Path]:
    """Yield all files of the program, including those beside the package."""
    for name in ("shukotsu", *BESIDE):
        path = REPOSITORY / name
        if path.is_dir():
            yield from package_files(path, suffix)
        elif path.name.endswith(suffix):
            yield path


def started(code: str, **how: Any) -> subprocess.Popen[str]:
    """Start Python code that can import the program, and wait until it prints 1."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    pipes = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
    process = subprocess.Popen([sys.executable, "-c", code], env=environment, text=True, **pipes, **how)
    assert process.stdout is not None
    assert process.stdout.readline() == "1\n"
    return process


def printed_by(*words: object, **how: Any) -> str:
    """Run a program, check that it succeeds and return its standard output."""
    done = subprocess.run(
        [*map(str, words)], capture_output=True, text=True, timeout=1500, check=False, **how
    )
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def run_python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, importing the program but nothing from that folder."""
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "COLUMNS": "100"}
    command = [sys.executable, "-P", *words]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
