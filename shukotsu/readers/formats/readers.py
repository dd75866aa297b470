"""Find what reads a recording; formats and their readers stand in `study.file_formats`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu.errors import InputError
from shukotsu.study.file_formats import AUTO, FORMATS, UNMAPPED, format_of, function_of
from shukotsu.tables.text_files import open_text

if TYPE_CHECKING:
    from shukotsu.readers.samples import Samples
    from shukotsu.study.layout import Layout
    from shukotsu.study.mapping import FileMapping
    from shukotsu.tracker.emulated_device import PlayedMotion

    PartsReader = Callable[[Path, Layout, FileMapping | None], Iterator[Samples]]


def find_parts_reader(path: Path, name: str, mapping: FileMapping | None = None) -> PartsReader:
    """Return the reader of the mapping's format, of the named one, or for "auto" that of the file's ending.

    The recording comes part by part, at least one; what a part notes is of the whole recording.
    Raises InputError where the ending is none that is known, or is one that needs a mapping.
    """
    from shukotsu.readers.samples import Samples

    if mapping is not None:
        chosen = FORMATS[mapping.format]
        function = chosen.mapped_reader or chosen.reader
    else:
        named = format_of(path) if name == AUTO else FORMATS[name]
        if named is None or named.needs_mapping:
            with suppress(OSError), open_text(path):  # a spreadsheet, or a pipe, is named as what it is
                pass
            endings = ", ".join(ending for name in UNMAPPED for ending in FORMATS[name].endings)
            raise InputError(
                f"{path}: the ending {path.suffix!r} does not say which format this is (known are "
                f"{endings}); give --format {' or '.join(UNMAPPED)}, or a mapping: "
                "`shukotsu inspect FILE --write-mapping mapping.yaml` writes one to edit"
            )
        function = named.reader
    read = function_of(__package__, function)

    def parts(path: Path, layout: Layout, mapping: FileMapping | None) -> Iterator[Samples]:
        samples = read(path, layout, mapping)
        return iter([samples]) if isinstance(samples, Samples) else samples

    return parts


def read_played_recording(path: Path, layout_name: str, *, loop: bool = False) -> PlayedMotion:
    """Read a recording in any format that needs no mapping; each segment plays on its receiver's station.

    Segments without a station are left out and noted. Raises InputError where the file is no recording, or
    where none of its segments has a station.
    """
    import numpy as np

    from shukotsu.readers.samples import join_samples
    from shukotsu.study.layout import read_layout
    from shukotsu.tracker.emulated_device import MAX_STATION, recorded_motion

    layout = read_layout(layout_name)
    samples = join_samples(find_parts_reader(path, AUTO)(path, layout, None))
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
