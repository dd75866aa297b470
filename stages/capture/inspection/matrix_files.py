"""4x4 matrices as text: how many, how far, and whether they can be poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.stages.capture.formats.matrices import Matrices, open_matrices
from shukotsu.stages.capture.inspection.description import CHECK, Description, draft, extent_line


@np.errstate(over="ignore", invalid="ignore")  # numbers without an end are said as such
def describe_matrices(path: Path) -> Description:
    """Describe the matrices of a file or folder. Raises InputError where there are none."""
    pattern, matrices = _open(path)
    values = matrices.values
    rotation = values[:, :3, :3]
    off = np.abs(np.swapaxes(rotation, 1, 2) @ rotation - np.eye(3)).max((1, 2))
    bottom = np.abs(values[:, 3] - [0, 0, 0, 1]).max(1) < 1e-6
    missing = np.isnan(values).any((1, 2))
    worst = np.nanmax(off, initial=0.0)
    turned = f"{int(np.sum(off < 0.01))} of {len(values)} are rotations within 0.01, worst {worst:.2g}"
    lines = [
        f"{len(values)} matrices of 4 x 4" + (f" in files {pattern}" if path.is_dir() else ""),
        f"last row 0 0 0 1 in {int(bottom.sum())}; {int(missing.sum())} lack a number",
        turned + ("; some are mirrored" if (np.linalg.det(rotation[~missing]) < 0).any() else ""),
        extent_line("last column, the position", values[:, :3, 3]),
        "it has no times and names no receivers: the mapping gives the rate and the receivers of a sample",
        "whether a matrix takes receiver coordinates to the transmitter or back is not known; the "
        "last column must be where the receiver was",
    ]
    return Description(tuple(lines), _draft(path, pattern, values))


def _open(path: Path) -> tuple[str, Matrices]:
    """The files of a folder of which all hold matrices, by their most common ending, or the file."""
    if not path.is_dir():
        return "*", open_matrices(path, "*")
    endings = [file.suffix for file in path.iterdir() if file.is_file() and not file.name.startswith(".")]
    if not endings:
        raise InputError(f"{path}: has no files; expected one with a matrix for each sample")
    pattern = f"*{max(sorted(set(endings)), key=endings.count)}"
    return pattern, open_matrices(path, pattern)


def _draft(path: Path, pattern: str, values: np.ndarray) -> str:
    extent = extent_line("the position", values[:, :3, 3])
    several = "a segment of the layout; several, one a line, in the order of their matrices"
    config: dict[str, Any] = {
        "format": "matrices",
        "position_unit": (CHECK, f"mm, cm, m or inch; {extent}"),
        "rate_hz": (CHECK, "matrices a second and receiver; leave the line out where nobody knows"),
        "orientation": {
            "kind": "matrix",
            "rotates": (CHECK, "receiver-to-transmitter (the usual), or transmitter-to-receiver"),
        },
        "receivers": {CHECK: ({}, several)},
    }
    if path.is_dir():
        config["matrices"] = {"pattern": (pattern, "files are taken in the order of their names")}
    return draft(path, config)
