"""What studies, long recordings and the joint solve cost, into the guide's page with the machine's name."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

from benchmarks import joint_solve, long_recordings, studies
from benchmarks.benchmark_table import TextTable, write_tables


def run() -> Iterator[TextTable]:
    """Give the tables as they come; put them into the page at the end."""
    tables = []
    for table in chain(studies.run(), long_recordings.run(), joint_solve.run()):
        tables.append(table)
        yield table
    write_tables("benchmarks.md", tables, "make bench")
