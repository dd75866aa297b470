"""Small tables that several pages of a subject are made from, read once as long as they stay the same."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import pyarrow as pa

from schemas.catalogue import TABLES
from schemas.files import file_state
from schemas.tables import Table, read_table


def small_table(path: Path, table: Table) -> pa.Table:
    """A whole table of a hand that has few rows. Raises InputError as `read_table` does."""
    return _table(path, table.name, file_state(path) if path.is_file() else None)


@lru_cache(maxsize=64)
def _table(path: Path, name: str, _state: tuple[int, int, int] | None) -> pa.Table:
    return read_table(path, TABLES[name])
