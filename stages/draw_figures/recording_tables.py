"""One recording's rows of a long table, without reading the rest of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from schemas.errors import InputError
from schemas.tables import Table, open_table


def rows_where(path: Path, table: Table, equal: Mapping[str, str], columns: Sequence[str]) -> pa.Table:
    """The columns of rows whose text columns hold just that, in the table's order.

    Only row groups that may hold such rows are read. Raises InputError as `schemas.tables.read_table` does.
    """
    with open_table(path, table) as file:
        groups = [index for index in range(file.num_row_groups) if _may_hold(file, index, equal)]
        try:
            data = file.read_row_groups(groups, columns=[*equal, *columns])
        except (OSError, ValueError, pa.ArrowException) as error:
            raise InputError(f"{path}: damaged Parquet file ({error}); make it again") from error
    for name, value in equal.items():
        data = data.filter(pc.equal(data.column(name), value))
    return data.select(list(columns))


def _may_hold(file: pq.ParquetFile, index: int, equal: Mapping[str, str]) -> bool:
    group = file.metadata.row_group(index)
    for name, value in equal.items():
        statistics = group.column(file.schema_arrow.get_field_index(name)).statistics
        if statistics is not None and statistics.has_min_max:
            low, high = statistics.min, statistics.max
            if not low.encode() <= value.encode() <= high.encode():  # Parquet orders text by its bytes
                return False
    return True
