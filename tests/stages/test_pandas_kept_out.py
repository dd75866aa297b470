"""A job of a study does without pandas, also where it is installed."""

import subprocess
import sys
from pathlib import Path

import pytest

CODE = """
import sys
from stages import command_line
command_line.keep_pandas_out()
import pyarrow as pa
pa.array([1.0, None], from_pandas=True)
assert "pandas" not in sys.modules
"""
REPOSITORY = Path(__file__).resolve().parents[2]


def test_pyarrow_works_and_finds_none() -> None:
    pytest.importorskip("pandas")
    done = subprocess.run([sys.executable, "-c", CODE], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
