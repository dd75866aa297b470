"""Text files with a row per line: CSV, and lines of tabs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.csv as pc

from shukotsu.tables.whole_files import replacing


def write_rows(path: Path, header: str, tables: Iterable[pa.Table], delimiter: str = ",") -> None:
    """Write a header and the rows of Arrow tables atomically.

    CSV has quotes where text needs them. With another delimiter there are none, and no text may need them.
    """
    quoting = "needed" if delimiter == "," else "none"
    options = pc.WriteOptions(include_header=False, delimiter=delimiter, quoting_style=quoting)
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(header.encode())
        for table in tables:
            pc.write_csv(table, stream, options)
