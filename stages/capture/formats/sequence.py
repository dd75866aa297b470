"""Sequence files of PLUS and 3D Slicer (.mha, .nrrd): transforms, their status and times in the header."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from shukotsu.errors import InputError, listed
from shukotsu.files.limits import LINE_LETTERS, check_memory
from shukotsu.files.text_files import open_text, reading, undecodable
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
from shukotsu.stages.capture.samples import Samples, did_you_mean

EXPECTED = "a sequence file of PLUS or 3D Slicer (.mha, .nrrd)"
_FIELD = re.compile(r"Seq_Frame(\d{1,9})_(\w+?)\s*:?=\s*(.*)")
_TRANSFORM = re.compile(r"(?P<name>(?P<tool>\w+?)To[A-Z]\w*?)Transform(?P<status>Status)?")


@dataclass(frozen=True)
class Sequence:
    """Hold the frames of a sequence's header.

    transforms : name, such as ProbeToTracker -> (T, 4, 4), NaN where it has none or its status is not OK.
    lost : name -> in how many frames it has another status. time_s : (T,), NaN where there is none.
    lines : (T,) where each frame begins, from 1.
    """

    path: Path
    transforms: dict[str, Array]
    lost: dict[str, int]
    time_s: Array
    lines: list[int]

    def place(self, frame: int) -> str:
        """File and line in words."""
        return f"{self.path}: line {self.lines[frame]}"

    def named(self, wanted: str) -> list[str]:
        """The transforms of that name or of that tool, as it is written or as a segment would be."""
        if wanted in self.transforms:
            return [wanted]
        return [name for name in self.transforms if wanted in (tool_of(name), snake_case(tool_of(name)))]


def tool_of(name: str) -> str:
    """Name the tool of a transform: index_distal of index_distalToTracker."""
    found = _TRANSFORM.fullmatch(f"{name}Transform")
    return found["tool"] if found else name


def read_sequence(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read the transforms of the mapping's receivers, or of all tools that are segments of the layout.

    They are in mm. Frames are counted from 0. A transform whose status is not OK is a gap. Raises
    InputError where the header is cut off or a transform that is OK is no pose.
    """
    sequence = open_sequence(path)
    if mapping is None:
        own = [name for name in layout.measured if sequence.named(name)]
        if not own:
            tools = listed([tool_of(name) for name in sequence.transforms])
            raise InputError(
                f"{path}: no tool is a segment of layout {layout.name}; it has {tools}; "
                f"`shukotsu inspect {path} --write-mapping mapping.yaml` writes a mapping to edit"
            )
        mapping = implied_mapping(str(path), "sequence", "value", own)
    mapped_segments(mapping, layout)
    frame, notes, tracks, used = np.arange(len(sequence.time_s)), list[str](), list[Track](), set[str]()
    for segment, receiver in mapping.receivers.items():
        name = _chosen(sequence, str(receiver.get("value", segment)), f"{mapping.where}: receivers.{segment}")
        used.add(name)
        notes += [f"{name}: its status is not OK in {sequence.lost[name]} frames"] * bool(sequence.lost[name])
        matrices = without_marks(sequence.transforms[name], name, notes)
        turned = from_matrix(proper_rotations(matrices[:, :3, :3], sequence.place))
        position_mm = matrices[:, :3, 3] * (mapping.mm_per_unit or 1.0)
        tracks.append(Track(frame, frame, sequence.time_s, np.concatenate([position_mm, turned], -1)))
    left = [name for name in sequence.transforms if name not in used]
    notes += [f"transforms that no segment is named for are left out: {listed(left)}"] * bool(left)
    return samples_of_tracks(tracks, mapping, layout, sequence.place, notes)


def _chosen(sequence: Sequence, wanted: str, place: str) -> str:
    names = sequence.named(wanted)
    if len(names) != 1:
        known = listed(list(sequence.transforms)) + did_you_mean(wanted, sequence.transforms)
        has = f"has the transforms {known}" if not names else f"has {listed(names)}"
        raise InputError(f"{place}: which transform is {wanted!r}? {sequence.path} {has}; say it as value")
    return names[0]


def open_sequence(path: Path) -> Sequence:
    """Read the header of a sequence, and nothing of its images.

    Raises InputError where the file is none, is cut off in its header or has no transform.
    """
    values: dict[str, dict[int, Array]] = {}
    bad: dict[str, set[int]] = {}
    times: dict[int, float] = {}
    lines: dict[int, int] = {}
    with reading(path, EXPECTED), open_text(path, EXPECTED) as stream:
        for number, line in enumerate(_header(path, stream), 1):
            field = _FIELD.fullmatch(line)
            if field is None:
                continue
            frame, key, text = int(field[1]), field[2], field[3].strip()
            lines.setdefault(frame, number)
            found = _TRANSFORM.fullmatch(key)
            if key == "Timestamp":
                times[frame] = _numbers(text, 1, f"{path}: line {number}")[0]
            elif found and not found["status"]:
                own = _numbers(text, 16, f"{path}: line {number}").reshape(4, 4)
                values.setdefault(found["name"], {})[frame] = own
            elif found and text.upper() != "OK":
                bad.setdefault(found["name"], set()).add(frame)
    if not values:
        raise InputError(f"{path}: its header has no transform of a frame; expected {EXPECTED}")
    frames = sorted(lines)
    check_memory(path, 16 * 8 * len(frames) * len(values), EXPECTED)
    none = np.full((4, 4), np.nan)
    transforms = {
        name: np.stack([none if i in bad.get(name, ()) else own.get(i, none) for i in frames])
        for name, own in values.items()
    }
    time_s = np.array([times.get(frame, np.nan) for frame in frames])
    lost = {name: len(bad.get(name, ())) for name in values}
    return Sequence(path, transforms, lost, time_s, [lines[frame] for frame in frames])


def _header(path: Path, stream: BinaryIO) -> Iterator[str]:
    """Give the header's lines: of MetaIO up to where its data are, of NRRD up to an empty line."""
    meta = False
    for number in range(1, 1 << 31):
        data = stream.readline(LINE_LETTERS)
        try:
            line = data.decode("utf-8").rstrip("\r\n")
        except UnicodeDecodeError as error:
            raise undecodable(path, number) from error
        if number == 1:
            meta = not line.startswith("NRRD")
            if meta and not re.match(r"\w+\s*=", line):
                raise InputError(f"{path}: line 1: is no header; expected {EXPECTED}")
        if not data.endswith(b"\n"):
            raise InputError(f"{path}: line {number}: the header is cut off; copy the file again")
        if not meta and not line:
            return
        yield line
        if meta and re.match(r"ElementDataFile\s*=", line):
            return


def _numbers(text: str, count: int, place: str) -> Array:
    try:
        numbers = np.array(text.split(), float)
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) != count:
        raise InputError(f"{place}: has no {count} numbers; expected them separated by blanks")
    return numbers
