"""Which format is read by what. A new tracker's format is one more line here and one module."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import InputError

if TYPE_CHECKING:
    from schemas.layout import Layout
    from stages.capture.samples import Samples

    Reader = Callable[[Path, Layout], Samples]


@dataclass(frozen=True)
class Format:
    """One file format: the endings that mean it, and the reader's module and function."""

    endings: tuple[str, ...]
    module: str
    function: str


FORMATS = {
    "csv": Format((".csv",), "stages.capture.tidy", "read_csv"),
    "parquet": Format((".parquet", ".pq"), "stages.capture.tidy", "read_parquet"),
}
AUTO = "auto"


def find_reader(path: Path, name: str) -> Reader:
    """Give the reader of the named format, or for "auto" that of the file's ending.

    Raises InputError where the ending is none that is known.
    """
    if name == AUTO:
        name = _format_by_ending(path)
    reader: Reader = getattr(importlib.import_module(FORMATS[name].module), FORMATS[name].function)
    return reader


def _format_by_ending(path: Path) -> str:
    for name, candidate in FORMATS.items():
        if path.suffix.lower() in candidate.endings:
            return name
    endings = ", ".join(ending for candidate in FORMATS.values() for ending in candidate.endings)
    raise InputError(
        f"{path}: the ending {path.suffix!r} does not say which format this is (known are {endings}); "
        f"give --format {' or '.join(FORMATS)}"
    )
