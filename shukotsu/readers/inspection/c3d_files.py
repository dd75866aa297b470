"""Describe C3D files: points, rate, unit, labels, and which groups of markers are rigid."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import count_of
from shukotsu.readers.formats.c3d import open_c3d, rigid_groups
from shukotsu.readers.formats.mapped import snake_case
from shukotsu.readers.inspection.description import CHECK, Description, draft, extent_line
from shukotsu.study.layout import Layout
from shukotsu.tables.limits import MM_PER_UNIT


@np.errstate(over="ignore", invalid="ignore")  # infinite numbers are printed as such
def describe_c3d(path: Path, layout: Layout) -> Description:
    """Describe a C3D file. Raises InputError if it is not a C3D file."""
    file = open_c3d(path)
    lines = [
        f"C3D: {count_of(len(file.labels), 'point')}, {count_of(file.frames, 'frame')} numbered "
        f"from {file.first_frame}",
        *(f"in doubt: {doubt}" for doubt in file.doubts),
        f"rate {file.rate_hz:g} Hz" if file.rate_hz > 0 else "no rate is stated: give rate_hz",
        f"unit {file.unit} (POINT:UNITS)" if file.unit else "no unit is stated",
        f"labels: {', '.join(file.labels) or 'none'}",
        extent_line("all points", file.points.reshape(-1, 3)),
    ]
    missing = np.isnan(file.points).any(-1).mean(0) * 100
    worst = sorted(zip(missing, file.labels, strict=False), reverse=True)[:5]
    shares = ", ".join(f"{label} {share:.0f} %" for share, label in worst if share)
    lines.append(f"missing: {shares or 'none'}")
    if file.rotation_labels:
        ratio = len(file.matrices) / file.frames
        lines.append(f"ROTATION labels: {', '.join(file.rotation_labels)}, {ratio:g} a frame")
    segments = [_named_segment(label, layout) for label in file.labels]
    groups = rigid_groups(file.points, segments)
    rigid = [[file.labels[index] for index in group] for group in groups]
    lines += [f"markers {', '.join(names)}: keep their distances: a rigid cluster" for names in rigid]

    def key(label: str) -> str:
        return f"{CHECK}_" + re.sub(r"\W+", "_", label)

    is_length = file.unit in MM_PER_UNIT
    unit_why = "as the file states" if is_length else "mm, cm, m or inch; the file states none of these"
    receivers: dict[str, Any] = {key(label): {"rotation": label} for label in file.rotation_labels}
    named = [{*map(segments.__getitem__, group)} for group in groups]
    for labels, names in zip(rigid, named, strict=True):
        alone = len(names) == 1 and named.count(names) == 1 and names != {""}
        receivers[names.pop() if alone else key(labels[0])] = {"markers": labels}
    if not receivers:
        point = "no group of markers looks rigid: name three or more that are fixed to one receiver or bone"
        receivers = {key(label): ({"markers": [label]}, point) for label in file.labels}
    why = f"name each by its segment in layout {layout.name}: {', '.join(layout.measured)}"
    config = {
        "format": "c3d",
        "position_unit": (file.unit if is_length else CHECK, unit_why),
        **({} if file.rate_hz > 0 else {"rate_hz": (CHECK, "frames a second")}),
        "receivers": (receivers, why),
    }
    counted = "frames count from 1 at the first stored frame, whatever its number"
    more = ["# c3d:", f"#   last_frame: {file.frames}  # {counted}"]
    return Description(tuple(lines), draft(path, config, more))


def _named_segment(label: str, layout: Layout) -> str:
    """Return the segment named in a marker's label, as in `Index_Proximal1`, or ""."""
    words = f"_{re.sub(r'[0-9]+', '_', snake_case(label))}_".replace("__", "_")
    return max((name for name in layout.measured if f"_{name}_" in words), key=len, default="")
