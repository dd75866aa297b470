"""What pages share is read once, and anew where its file was written anew."""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas.catalogue import PROBLEMS
from schemas.errors import InputError
from schemas.tables import Provenance, write_table
from stages.report.read_once import small_table


def _write(path: Path, n: int) -> None:
    columns = {column.name: ["x"] * n for column in PROBLEMS.columns}
    write_table(path, PROBLEMS, columns, Provenance())


def test_a_table_is_read_once_and_again_when_written_anew(tmp_path: Path) -> None:
    path = tmp_path / "problems.parquet"
    with pytest.raises(InputError, match="no such file"):
        small_table(path, PROBLEMS)
    _write(path, 1)
    first = small_table(path, PROBLEMS)
    assert small_table(path, PROBLEMS) is first
    _write(path, 2)
    assert small_table(path, PROBLEMS).num_rows == 2
