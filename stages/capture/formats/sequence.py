"""Sequence files of PLUS and 3D Slicer (.mha, .nrrd): transforms, their status and times in the header."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError, listed
from shukotsu.files.limits import LINE_LETTERS, check_memory
from shukotsu.files.text_files import open_text, reading
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.mapping import FileMapping
from shukotsu.skeleton.rotations import Array, from_matrix
from shukotsu.stages.capture.formats.mapped import (
    Track,
    implied_mapping,
    mapped_segments,
    samples_of_tracks,
    snake_case,
    without_marks,
)
from shukotsu.stages.capture.formats.orientation import proper_rotations
from shukotsu.stages.capture.samples import Samples

EXPECTED = "a sequence file of PLUS or 3D Slicer (.mha, .nrrd)"
_FIELD = re.compile(rb"Seq_Frame(\d{1,9})_(Timestamp|(\w+?)Transform(Status)?)\s*:?=\s*(.*?)\s*")


@dataclass(frozen=True)
class Sequence:
    """Hold T frames of a sequence's header.

    transforms : name, such as ProbeToTracker -> (T, 4, 4), NaN where there is none or its status is not OK.
    time_s : (T,), NaN where there is none. lines : (T,) where each frame begins, from 1.
    """

    path: Path
    transforms: dict[str, Array]
    time_s: Array
    lines: list[int]

    def named(self, wanted: str) -> list[str]:
        """The transforms of that name or of that tool, as it is written or as a segment would be."""
        tools = {name: tool_of(name) for name in self.transforms}
        return [name for name in tools if wanted in (name, tools[name], snake_case(tools[name]))]


def tool_of(name: str) -> str:
    """Name the tool of a transform: index_distal of index_distalToTracker."""
    return re.sub(r"(?<=.)To[A-Z]\w*$", "", name)


def read_sequence(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read the transforms of the mapping's receivers, or of all tools that are segments of the layout, in mm.

    Frames are counted from 0. A transform whose status is not OK is a gap. Raises InputError where the
    header is cut off or a transform that is OK is no pose.
    """
    sequence = open_sequence(path)
    known = listed(list(sequence.transforms))
    if mapping is None:
        own = [name for name in layout.measured if sequence.named(name)]
        if not own:
            raise InputError(
                f"{path}: none of its tools is a segment of layout {layout.name}; it has {known}; "
                f"`shukotsu inspect {path} --write-mapping mapping.yaml` writes a mapping to edit"
            )
        mapping = implied_mapping(str(path), "sequence", "value", own)
    mapped_segments(mapping, layout)
    frame, notes, tracks = np.arange(len(sequence.time_s)), list[str](), list[Track]()

    def place(row: int) -> str:
        return f"{path}: line {sequence.lines[row]}"

    for segment, receiver in mapping.receivers.items():
        wanted = str(receiver.get("value", segment))
        names = sequence.named(wanted)
        if len(names) != 1:
            raise InputError(
                f"{mapping.where}: receivers.{segment}: {wanted!r} is {len(names) or 'none'} of the transforms "
                f"of {path}, which are {known}; say which as value"
            )
        matrices = without_marks(sequence.transforms[names[0]], names[0], notes)
        turned = from_matrix(proper_rotations(matrices[:, :3, :3], place))
        position_mm = matrices[:, :3, 3] * (mapping.mm_per_unit or 1.0)
        tracks.append(Track(frame, frame, sequence.time_s, np.concatenate([position_mm, turned], -1)))
    return samples_of_tracks(tracks, mapping, layout, place, notes)


def open_sequence(path: Path) -> Sequence:
    """Read a sequence's header and nothing of its images; InputError where it is cut off or none."""
    values: dict[str, dict[int, Array]] = {}
    times: dict[int, float] = {}
    lines: dict[int, int] = {}
    for number, line in enumerate(_header(path), 1):
        if (found := _FIELD.fullmatch(line)) is None:
            continue
        frame, key, name, status, text = (
            int(found[1]),
            found[2],
            (found[3] or b"").decode(),
            found[4],
            found[5],
        )
        lines.setdefault(frame, number)
        if status and text.upper() != b"OK":
            values.setdefault(name, {})[frame] = np.full((4, 4), np.nan)
        elif not status:
            try:
                numbers = np.array(text.split(), float).reshape(() if key == b"Timestamp" else (4, 4))
            except ValueError:
                raise InputError(f"{path}: line {number}: expected 16 numbers, or a time") from None
            if key == b"Timestamp":
                times[frame] = float(numbers)
            else:
                values.setdefault(name, {}).setdefault(frame, numbers)
    if not values:
        raise InputError(f"{path}: its header has no transform of a frame; expected {EXPECTED}")
    frames = sorted(lines)
    check_memory(path, 16 * 8 * len(frames) * len(values), EXPECTED)
    none = np.full((4, 4), np.nan)
    transforms = {name: np.stack([own.get(frame, none) for frame in frames]) for name, own in values.items()}
    time_s = np.array([times.get(frame, np.nan) for frame in frames])
    return Sequence(path, transforms, time_s, [lines[frame] for frame in frames])


def _header(path: Path) -> Iterator[bytes]:
    """Give the header's lines: of NRRD up to an empty line, of MetaIO up to where its data are."""
    with reading(path, EXPECTED), open_text(path, EXPECTED) as stream:
        nrrd = stream.read(4) == b"NRRD"
        stream.seek(0)
        while (line := stream.readline(LINE_LETTERS)).endswith(b"\n"):
            yield line
            if (nrrd and not line.strip()) or line.startswith(b"ElementDataFile"):
                return
        raise InputError(f"{path}: its header has no end; expected {EXPECTED}, copied whole")
