"""C3D files: points, rate, unit, labels, and which groups of markers are rigid."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.schemas.layout import Layout
from shukotsu.schemas.units import MM_PER_UNIT
from shukotsu.stages.capture.formats.c3d import C3dFile, open_c3d
from shukotsu.stages.capture.inspection.description import CHECK, Description, draft, extent_line
from shukotsu.stages.capture.inspection.rigid_groups import rigid_groups

RIGID_SHARE = 0.05
"""A cluster whose distances vary (interquartile) by less than this share of them is taken for rigid."""


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
    clusters = _stems(file.labels)
    variations = {stem: _variation(file, labels) for stem, labels in clusters.items()}
    lines += [
        f"markers {', '.join(clusters[stem])}: {_rigidity(distance, spread, file.unit)}"
        for stem, (distance, spread) in variations.items()
    ]
    rigid = {stem: clusters[stem] for stem, (d, spread) in variations.items() if spread < RIGID_SHARE * d}
    named = {label for group in rigid.values() for label in group}
    free = [index for index, label in enumerate(file.labels) if label not in named]
    found = rigid_groups(file.points[:, free], [file.labels[index] for index in free])
    for stem, own in found.items():
        rigid[stem] = [file.labels[free[index]] for index in own]
        lines.append(f"markers {', '.join(rigid[stem])}: keep their distances: a rigid cluster")
    return Description(tuple(lines), _draft(file, rigid, layout))


def _stems(labels: Sequence[str]) -> dict[str, list[str]]:
    """Labels that differ in their last number only, where there are three or more."""
    groups: dict[str, list[str]] = {}
    for label in labels:
        match = re.fullmatch(r"(.*?\D)[ _.-]?\d+", label)
        if match:
            groups.setdefault(match[1].rstrip(" _.-"), []).append(label)
    return {stem: group for stem, group in groups.items() if len(group) >= 3}


def _variation(file: C3dFile, labels: Sequence[str]) -> tuple[float, float]:
    """Median distance between a group's markers, and the largest interquartile range; NaN if unseen."""
    points = file.points[:, [file.labels.index(label) for label in labels]]
    first, second = np.triu_indices(len(labels), 1)
    distance = np.linalg.norm(points[:, first] - points[:, second], axis=-1)
    seen = distance[:, np.isfinite(distance).any(0)]
    if seen.shape[1] < 3:
        return float("nan"), float("nan")
    low, middle, high = np.nanpercentile(seen, [25, 50, 75], axis=0)
    return float(np.median(middle)), float((high - low).max())


def _rigidity(distance: float, spread: float, unit: str) -> str:
    if np.isnan(distance):
        return "never seen together"
    verdict = "a rigid cluster" if spread < RIGID_SHARE * distance else "not rigid"
    in_unit = f" {unit}" if unit else ""
    return f"distances about {distance:.3g}{in_unit}, varying by {spread:.2g}{in_unit}: {verdict}"


def _draft(file: C3dFile, rigid: Mapping[str, Sequence[str]], layout: Layout) -> str:
    known = file.unit in MM_PER_UNIT
    unit_why = "as the file states" if known else "mm, cm, m or inch; the file states none of these"
    receivers: dict[str, Any] = {
        f"{CHECK}_{_key(label)}": {"rotation": label} for label in file.rotation_labels
    }
    receivers |= {f"{CHECK}_{_key(stem)}": {"markers": list(labels)} for stem, labels in rigid.items()}
    if not receivers:
        point = "no group of markers looks rigid: name three or more that are fixed to one receiver or bone"
        receivers = {f"{CHECK}_{_key(own)}": ({"markers": [own]}, point) for own in file.labels}
    named = f"name each by its segment in layout {layout.name}: {', '.join(layout.measured)}"
    config = {
        "format": "c3d",
        "position_unit": (file.unit if known else CHECK, unit_why),
        **({} if file.rate_hz > 0 else {"rate_hz": (CHECK, "frames a second")}),
        "receivers": (receivers, named),
    }
    counted = "frames count from 1 at the first stored frame, whatever its number"
    return draft(file.path, config, ["# c3d:", f"#   last_frame: {file.frames}  # {counted}"])


def _key(label: str) -> str:
    return re.sub(r"\W+", "_", label)
