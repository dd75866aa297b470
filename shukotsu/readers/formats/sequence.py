"""Read sequence files of PLUS and 3D Slicer (.mha, .nrrd): transforms, status and times from the header."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.hand.rotations import Array, from_matrix
from shukotsu.readers.formats import mapped
from shukotsu.readers.samples import Samples
from shukotsu.study.layout import Layout
from shukotsu.study.mapping import FileMapping
from shukotsu.tables.limits import LINE_LETTERS, check_expansion
from shukotsu.tables.text_files import open_text, reading

EXPECTED = "a sequence file of PLUS or 3D Slicer (.mha, .nrrd)"
_FIELD = re.compile(rb"Seq_Frame(\d{1,9})_(?:Timestamp|(\w+?)Transform(Status)?)\s*:?=\s*(.*?)\s*")


def read_sequence(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read the transforms of the mapping's receivers; without a mapping, of all tools named as segments (mm).

    Frames are counted from 0. Raises InputError if the header is truncated, or a transform with status OK is
    not a rigid pose.
    """
    transforms, time_s = open_sequence(path)
    tools = tools_of(transforms)
    worn = [name for name in tools if name in layout.measured] or list(tools)
    mapping = mapping or mapped.implied_mapping(str(path), "sequence", worn)
    wanted = {segment: str(group.get("value", segment)) for segment, group in mapping.receivers.items()}
    named = {segment: {"value": tools.get(name, name)} for segment, name in wanted.items()}
    mapping = replace(mapping, receivers=named)
    mapped.segments_of(mapping, layout)
    frame, tracks = np.arange(len(time_s)), list[mapped.Track]()

    def locate(row: int) -> str:
        return f"{path}: Seq_Frame{row:04d}"

    for segment in mapping.receivers:
        matrices = transforms[mapped.name_in_file(mapping, segment, list(transforms), str(path))]
        turned = from_matrix(mapped.proper_rotations(matrices[:, :3, :3], locate))
        position_mm = matrices[:, :3, 3] * (mapping.mm_per_unit or 1.0)
        tracks.append(mapped.Track(frame, frame, time_s, np.concatenate([position_mm, turned], -1)))
    return replace(mapped.samples_of_tracks(tracks, mapping, layout, locate), orientation="matrix")


def tools_of(transforms: dict[str, Array]) -> dict[str, str]:
    """Return tool names of transforms: index_distal for IndexDistalToTracker, the full name if ambiguous."""
    short = [mapped.snake_case(re.sub(r"(?<=.)To[A-Z]\w*$", "", name)) for name in transforms]
    pairs = zip(short, transforms, strict=True)
    return {tool if short.count(tool) == 1 else mapped.snake_case(name): name for tool, name in pairs}


def open_sequence(path: Path) -> tuple[dict[str, Array], Array]:
    """Read transforms by name, (T, 4, 4), NaN if missing or not OK, and times in s, (T,), NaN if missing.

    Images are not read. Raises InputError if the header is truncated or is not a sequence's header.
    """
    values: dict[str, dict[int, Array]] = {}
    for number, line in enumerate(_header(path), 1):
        match = _FIELD.fullmatch(line)
        if match is None or (match[3] and match[4].upper() == b"OK"):
            continue
        frame, name = int(match[1]), (match[2] or b"").decode()
        shape = (4, 4) if name else (1,)
        try:
            numbers = np.full(shape, np.nan) if match[3] else np.array(match[4].split(), float).reshape(shape)
        except ValueError:
            what = "16 numbers" if name else "a time"
            raise InputError(f"{path}: line {number}: expected {what}") from None
        by_frame = values.setdefault(name, {})
        by_frame[frame] = numbers + 0 * by_frame.get(frame, 0.0)  # stays NaN if the status was not OK
    frames = sorted(set[int]().union(*values.values()))
    times = values.pop("", {})
    if not values:
        raise InputError(f"{path}: its header has no transforms; expected {EXPECTED}")
    check_expansion(path, 16 * 8 * len(frames) * len(values), lambda: "its transforms hardly share a frame")
    missing = np.full((4, 4), np.nan)
    transforms = {
        name: np.stack([by_frame.get(frame, missing) for frame in frames])
        for name, by_frame in values.items()
    }
    return transforms, np.array([times.get(frame, missing[0])[0] for frame in frames])


def _header(path: Path) -> Iterator[bytes]:
    """Yield the header's lines: up to an empty line (NRRD), or up to `ElementDataFile` (MetaIO)."""
    with reading(path, EXPECTED), open_text(path, EXPECTED) as stream:
        nrrd = stream.read(4) == b"NRRD"
        stream.seek(0)
        while (line := stream.readline(LINE_LETTERS)).endswith(b"\n"):
            yield line
            if (nrrd and not line.strip()) or line.startswith(b"ElementDataFile"):
                return
        raise InputError(f"{path}: its header is cut off; expected {EXPECTED}; copy it again")
