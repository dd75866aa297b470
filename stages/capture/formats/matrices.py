"""4x4 matrices as text: one file, or a folder with a file a sample."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.text_files import read_text
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.mapping import FileMapping
from shukotsu.skeleton.rotations import Array, from_matrix
from shukotsu.stages.capture.formats.mapped import (
    Integers,
    Track,
    mapped_segments,
    required_mapping,
    samples_of_tracks,
)
from shukotsu.stages.capture.formats.orientation import proper_rotations
from shukotsu.stages.capture.samples import Samples

_BOTTOM = (0.0, 0.0, 0.0, 1.0)
_BOTTOM_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Matrices:
    """N matrices in the order of the text: (N, 4, 4), and (N,) the line where each begins in its file.

    files : with how many matrices each has.
    """

    values: Array
    lines: Integers
    files: tuple[tuple[Path, int], ...]

    def place(self, index: int) -> str:
        """File and line in words."""
        ends = np.cumsum([count for _, count in self.files])
        path, _ = self.files[int(np.searchsorted(ends, index, side="right"))]
        return f"{path}: line {self.lines[index]}"


def read_matrices(path: Path, layout: Layout, mapping: FileMapping | None) -> Samples:
    """Read matrices [R t; 0 0 0 1]; a sample has one for each of the mapping's receivers, in their order.

    Frames are counted from 0; times are frames over the mapping's rate_hz, or none. A matrix of NaN is a
    gap. Raises InputError at the first matrix that is no pose.
    """
    mapping = required_mapping(path, mapping, "a file of matrices")
    mapped_segments(mapping, layout)
    matrices = open_matrices(path, mapping.details["pattern"])
    numbers = _poses(matrices, mapping)
    count = len(mapping.receivers)
    if len(numbers) % count:
        raise InputError(
            f"{path}: has {len(numbers)} matrices; expected a multiple of {count}, one for each of "
            f"the receivers that {mapping.where} names"
        )
    frame = np.arange(len(numbers) // count)
    time_s = frame / (mapping.rate_hz or np.nan)
    tracks = [Track(frame * count + i, frame, time_s, numbers[i::count]) for i in range(count)]
    return samples_of_tracks(tracks, mapping, layout, matrices.place)


def open_matrices(path: Path, pattern: str) -> Matrices:
    """Read the matrices of a file, or of a folder's files in the order of their names, 2 before 10.

    Raises InputError where a line is none of a matrix, or there is no matrix at all.
    """
    parts = [_read_file(file) for file in _files(path, pattern)]
    matrices = parts[0]
    if len(parts) > 1:
        values, lines = (
            np.concatenate([getattr(own, name) for own in parts]) for name in ("values", "lines")
        )
        matrices = Matrices(values, lines, tuple(file for part in parts for file in part.files))
    if not len(matrices.values):
        raise InputError(
            f"{path}: has no matrix; expected four lines of four numbers each, or 16 numbers a line"
        )
    return matrices


def _files(path: Path, pattern: str) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = [file for file in path.glob(pattern) if file.is_file() and not file.name.startswith(".")]
    if not files:
        raise InputError(f"{path}: has no file that matches {pattern!r}; correct `pattern` in the mapping")
    return sorted(files, key=_natural)


def _natural(file: Path) -> list[tuple[int, str]]:
    """Numbers in a name by their value, so that 2 comes before 10."""
    return [(int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", file.name)]


def _read_file(path: Path) -> Matrices:
    text = read_text(path, "matrices as text, four lines of four numbers each")
    values, starts = array("d"), array("q")  # a list of numbers takes five times their text
    for start, numbers in _blocks(path, _lines(text)):
        values.extend(numbers)
        starts.append(start)
    return Matrices(np.asarray(values).reshape(-1, 4, 4), np.asarray(starts), ((path, len(starts)),))


def _lines(text: str) -> Iterator[str]:
    """Give one line after the other, and an empty one at the end."""
    start = 0
    while (end := text.find("\n", start)) >= 0:
        yield text[start:end]
        start = end + 1
    yield text[start:]
    yield ""


def _blocks(path: Path, lines: Iterable[str]) -> Iterator[tuple[int, list[float]]]:
    """Give each matrix's first line, counted from 1, and its 16 numbers."""
    start, cells = 0, list[float]()
    for line, text in enumerate(lines, 1):
        row = text.split()
        if not cells:
            start = line
        if len(row) not in (0, 4, 16) or (len(row) == 16 and cells):
            raise InputError(
                f"{path}: line {line}: has {len(row)} numbers; expected four, or sixteen in a line"
            )
        if not row and cells:
            raise InputError(
                f"{path}: line {line}: the matrix that begins in line {start} has {len(cells) // 4} lines; "
                "expected four (is it cut off?)"
            )
        cells = cells + [_number(word, f"{path}: line {line}") for word in row]
        if len(cells) == 16:
            yield start, cells
            cells = []


def _number(text: str, place: str) -> float:
    try:
        return float(text)
    except ValueError:
        hint = " with a decimal point, not a comma" if "," in text else ""
        raise InputError(f"{place}: is {text!r}; expected a number{hint}") from None


def _poses(matrices: Matrices, mapping: FileMapping) -> Array:
    """Positions in mm and quaternions, shape (N, 7)."""
    values = matrices.values
    off = np.abs(values[:, 3] - _BOTTOM).max(-1) > _BOTTOM_TOLERANCE  # False for NaN
    if off.any():
        first = int(np.argmax(off))
        row = " ".join(f"{number:g}" for number in values[first, 3])
        raise InputError(
            f"{matrices.place(first)}: the last row of the matrix is {row}; expected 0 0 0 1 "
            "(a matrix with the position in its last row is transposed)"
        )
    rotation, position = proper_rotations(values[:, :3, :3], matrices.place), values[:, :3, 3]
    if (mapping.orientation or {}).get("rotates") == "transmitter-to-receiver":
        rotation = np.swapaxes(rotation, 1, 2)
        position = -np.einsum("tij,tj->ti", rotation, position)
    return np.concatenate([position * mapping.mm_per_unit, from_matrix(rotation)], -1)
