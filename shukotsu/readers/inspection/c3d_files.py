"""C3D files: points, rate, unit, labels, and which groups of markers are rigid."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from shukotsu.hand.rotations import Array
from shukotsu.readers.formats.c3d import open_c3d
from shukotsu.readers.inspection.description import CHECK, Description, draft, extent_line
from shukotsu.study.layout import Layout
from shukotsu.tables.limits import MM_PER_UNIT


@np.errstate(over="ignore", invalid="ignore")  # numbers without an end are said as such
def describe_c3d(path: Path, layout: Layout) -> Description:
    """Describe a C3D file. Raises InputError where it is none."""
    file = open_c3d(path)
    lines = [
        f"C3D: {len(file.labels)} points, {file.frames} frames numbered from {file.first_frame}",
        *(f"frames in doubt: {doubt}" for doubt in file.doubts),
        f"rate {file.rate_hz:g} Hz" if file.rate_hz > 0 else "no rate is stated: give rate_hz",
        f"unit {file.unit} (POINT:UNITS)" if file.unit else "no unit is stated",
        f"labels: {', '.join(file.labels) or 'none'}",
        extent_line("all points", file.points.reshape(-1, 3)),
    ]
    missing = np.isnan(file.points).any(-1).mean(0) * 100 if len(file.labels) else np.zeros(0)
    worst = sorted(zip(missing, file.labels, strict=False), reverse=True)[:5]
    lines.append(
        "missing: " + (", ".join(f"{label} {share:.0f} %" for share, label in worst if share) or "none")
    )
    if file.rotation_labels:
        ratio = len(file.matrices) / max(file.frames, 1)
        lines.append(f"ROTATION labels: {', '.join(file.rotation_labels)}, {ratio:g} a frame")
    groups = rigid_groups(file.points, file.labels)
    rigid = {label: [file.labels[index] for index in group] for label, group in groups.items()}
    lines += [
        f"markers {', '.join(names)}: keep their distances: a rigid cluster" for names in rigid.values()
    ]

    def key(label: str) -> str:
        return f"{CHECK}_" + re.sub(r"\W+", "_", label)

    is_length = file.unit in MM_PER_UNIT
    unit_why = "as the file states" if is_length else "mm, cm, m or inch; the file states none of these"
    receivers: dict[str, Any] = {key(label): {"rotation": label} for label in file.rotation_labels}
    receivers |= {key(stem): {"markers": labels} for stem, labels in rigid.items()}
    if not receivers:
        point = "no group of markers looks rigid: name three or more that are fixed to one receiver or bone"
        receivers = {key(label): ({"markers": [label]}, point) for label in file.labels}
    named = f"name each by its segment in layout {layout.name}: {', '.join(layout.measured)}"
    config = {
        "format": "c3d",
        "position_unit": (file.unit if is_length else CHECK, unit_why),
        **({} if file.rate_hz > 0 else {"rate_hz": (CHECK, "frames a second")}),
        "receivers": (receivers, named),
    }
    counted = "frames count from 1 at the first stored frame, whatever its number"
    more = ["# c3d:", f"#   last_frame: {file.frames}  # {counted}"]
    return Description(tuple(lines), draft(path, config, more))


RIGID_VARIATION = 0.02
"""Each distance in a group varies (interquartile) by less than this share of it, and of what the two move."""
_FRAMES, _MARKERS = 300, 200


def rigid_groups(points: Array, labels: Sequence[str]) -> dict[str, list[int]]:
    """Group markers of which all distances keep still while others change.

    points : (T, P, 3), NaN where a marker is not seen. Returns a group's first label, and its indices.
    There are none of markers that keep still, and none where there are too many markers.
    """
    if not 3 <= len(labels) <= _MARKERS:
        return {}
    points = points[:: max(1, len(points) // _FRAMES)]
    first, second = np.triu_indices(len(labels), 1)
    distance = np.linalg.norm(points[:, first] - points[:, second], axis=-1)
    seen = np.flatnonzero(np.isfinite(distance).mean(0) > 0.1)
    if not len(seen):
        return {}
    low, middle, high = np.nanpercentile(distance[:, seen], [25, 50, 75], axis=0)
    moved = np.full(len(labels), 0.0)
    for index in np.unique([first[seen], second[seen]]):
        moved[index] = np.subtract(*np.nanpercentile(points[:, index], [75, 25], axis=0)).max()
    least = np.minimum(middle, 5 * np.minimum(moved[first[seen]], moved[second[seen]]))
    variation = np.full(len(first), 1e9)
    variation[seen] = (high - low) / np.maximum(least, 1e-12)
    group = fcluster(linkage(variation, "complete"), RIGID_VARIATION, "distance")
    groups = [np.flatnonzero(group == number).tolist() for number in range(1, group.max() + 1)]
    return {labels[markers[0]]: markers for markers in sorted(groups) if len(markers) >= 3}
