"""Which format is read by what. A new format is one more line here and one module."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.errors import InputError
from shukotsu.tables.text_files import open_text

if TYPE_CHECKING:
    from shukotsu.readers.samples import Samples
    from shukotsu.study.layout import Layout
    from shukotsu.study.mapping import FileMapping
    from shukotsu.tracker.emulated_device import PlayedMotion

    Reader = Callable[[Path, Layout, FileMapping | None], Samples]
    PartsReader = Callable[[Path, Layout, FileMapping | None], Iterator[Samples]]


@dataclass(frozen=True)
class FileFormat:
    """One file format: the endings that mean it, and the reader's module and function.

    in_parts : whether the function gives the recording part by part, as a format can be long.
    """

    endings: tuple[str, ...]
    module: str
    function: str
    in_parts: bool = False


_FORMATS = "shukotsu.readers.formats"

FORMATS = {
    "csv": FileFormat((".csv", ".tsv", ".txt"), f"{_FORMATS}.tidy", "read_csv", in_parts=True),
    "parquet": FileFormat((".parquet", ".pq"), f"{_FORMATS}.tidy", "read_parquet", in_parts=True),
    "capture": FileFormat((".arrows",), f"{_FORMATS}.raw_capture", "read_capture", in_parts=True),
    "xdf": FileFormat((".xdf", ".xdfz"), f"{_FORMATS}.xdf", "read_xdf"),
    "sequence": FileFormat((".mha", ".nrrd"), f"{_FORMATS}.sequence", "read_sequence"),
}
"""Formats that say themselves what their numbers are."""
MAPPED = {
    "csv": FileFormat((".csv", ".txt", ".tsv"), f"{_FORMATS}.mapped_csv", "read_mapped_csv"),
    "c3d": FileFormat((".c3d",), f"{_FORMATS}.c3d", "read_c3d"),
    "capture": FORMATS["capture"],
    "xdf": FORMATS["xdf"],
    "sequence": FORMATS["sequence"],
}
"""Formats that are read by a mapping; the mapping says which."""
AUTO = "auto"


def find_parts_reader(path: Path, name: str, mapping: FileMapping | None = None) -> PartsReader:
    """Return the reader of the mapping's format, of the named one, or for "auto" that of the file's ending.

    The recording comes part by part, at least one; what a part notes is of the whole recording.
    Raises InputError where the ending is none that is known, or is one that needs a mapping.
    """
    if mapping is not None:
        chosen = MAPPED[mapping.format]
    else:
        by_ending = (key for key, form in FORMATS.items() if path.name.lower().endswith(form.endings))
        name = next(by_ending, "") if name == AUTO else name
        if not name:
            with suppress(OSError), open_text(path):  # a spreadsheet, or a pipe, is named as what it is
                pass
            endings = ", ".join(ending for form in FORMATS.values() for ending in form.endings)
            raise InputError(
                f"{path}: the ending {path.suffix!r} does not say which format this is (known are "
                f"{endings}); give --format {' or '.join(FORMATS)}, or a mapping: "
                "`shukotsu inspect FILE --write-mapping mapping.yaml` writes one to edit"
            )
        chosen = FORMATS[name]
    read = getattr(importlib.import_module(chosen.module), chosen.function)
    return read if chosen.in_parts else lambda path, layout, mapping: iter([read(path, layout, mapping)])


def find_reader(path: Path, name: str, mapping: FileMapping | None = None) -> Reader:
    """Return the same reader as `find_parts_reader`, one that gives the recording whole."""
    from shukotsu.readers.samples import join_samples

    read = find_parts_reader(path, name, mapping)
    return lambda path, layout, mapping: join_samples(read(path, layout, mapping))


def read_played_recording(path: Path, layout_name: str, *, loop: bool = False) -> PlayedMotion:
    """Read a recording in any format that needs no mapping; each segment plays on its receiver's station.

    Segments without a station are left out and noted. Raises InputError where the file is no recording, or
    where none of its segments has a station.
    """
    import numpy as np

    from shukotsu.study.layout import read_layout
    from shukotsu.tracker.emulated_device import MAX_STATION, recorded_motion

    layout = read_layout(layout_name)
    samples = find_reader(path, AUTO)(path, layout, None)
    receivers = np.array([layout.segments[name].receiver or 0 for name in samples.segments])
    receivers[receivers > MAX_STATION] = 0
    station = receivers[samples.segment]
    if not station.any():
        raise InputError(
            f"{path}: none of its segments has a station from 1 to {MAX_STATION} in layout {layout.name}; "
            "give the layout's segments such `receiver:` numbers"
        )
    notes = [
        f"segment {samples.segments[index]} has no station from 1 to {MAX_STATION}; not played"
        for index in np.unique(samples.segment[station == 0])
    ]
    poses = samples.numbers
    return recorded_motion(samples.frame, station, poses[:, :3], poses[:, 3:], loop=loop, notes=notes)
