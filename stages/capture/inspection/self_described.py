"""Files that describe themselves, Motion-BIDS and XDF: what they say, and a mapping where they need one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from schemas.errors import InputError
from schemas.layout import Layout
from schemas.mapping import UNIT_NAMES
from stages.capture.formats.motion_sidecars import SHIFT_TO_MM, XYZ, read_sidecars
from stages.capture.formats.readers import AUTO, find_reader
from stages.capture.inspection.description import CHECK, Description
from stages.capture.samples import ReadingOptions


def describe_motion_bids(path: Path, layout: Layout) -> Description:
    """Say what the sidecars of a motion.tsv say. Raises InputError where one is none."""
    sidecars = read_sidecars(path)
    rate_hz = sidecars.sampling_frequency_hz()
    latency = [channel.name for channel in sidecars.channels if channel.type == "LATENCY"]
    timing = f"times in the channel {', '.join(latency)}" if latency else "no LATENCY channel"
    lines = [
        f"Motion-BIDS, {len(sidecars.channels)} channels described by {sidecars.channels_path.name}",
        f"{timing}; SamplingFrequency {'absent' if rate_hz is None else f'{rate_hz:g} Hz'}",
    ]
    for name in sidecars.points():
        parts = []
        for kind in ("POS", "ORNT"):
            if channels := sidecars.of_type(kind, name):
                units = ", ".join(sorted({channel.units for channel in channels}))
                parts.append(f"{kind} {' '.join(channel.component for channel in channels)} in {units}")
        lines.append(f"tracked point {name}: {'; '.join(parts)}")
    if _reads_without_mapping(path, layout):
        return _complete(lines, "tracked point", layout)
    position_units = [channel.units for channel in sidecars.channels if channel.type == "POS"]
    angles = [c for c in sidecars.channels if c.type == "ORNT" and c.component in XYZ]
    draft: dict[str, Any] = {
        "format": "motion-bids",
        "position_unit": next((unit for unit in position_units if unit in SHIFT_TO_MM), CHECK),
    }
    if any("RotationOrder" not in sidecars.frame_levels(channel.reference_frame) for channel in angles):
        draft["orientation"] = {"kind": "euler", "axes": CHECK, "unit": angles[0].units}
    return _with_draft(path, lines, draft, _draft_receivers(sidecars.points(), "tracked_point"))


def describe_xdf(path: Path, layout: Layout) -> Description:
    """Say what streams there are, and which markers or objects those of type MoCap have.

    Raises InputError where the file is none, is damaged or has no stream of type MoCap.
    """
    from stages.capture.formats.xdf import POSITION, is_mocap, mocap_streams, owners
    from stages.capture.formats.xdf_streams import read_streams

    streams = read_streams(path)
    lines = []
    for stream in streams:
        lines.append(
            f"XDF stream {stream.name!r} of type {stream.type or '(none)'}: {stream.channel_count} channels "
            f"of {stream.format}, {f'{stream.rate_hz:g} Hz' if stream.rate_hz else 'irregular'}"
        )
        for owner in owners(stream) if is_mocap(stream) else ():
            types = [f"{c.type} [{c.unit or 'no unit'}]" for c in stream.channels if c.owner == owner]
            lines.append(f"marker or object {owner}: {', '.join(types)}")
    if _reads_without_mapping(path, layout):
        return _complete(lines, "marker or object", layout)
    stream = mocap_streams(path, streams)[0]
    units = [UNIT_NAMES[c.unit] for c in stream.channels if c.type in POSITION and c.unit in UNIT_NAMES]
    draft = {
        "format": "xdf",
        "position_unit": next(iter(units), CHECK),
        "orientation": {"kind": "quaternion", "order": "wxyz"},
        "xdf": {"stream": stream.name},
    }
    return _with_draft(path, lines, draft, _draft_receivers(owners(stream), "value"))


def _reads_without_mapping(path: Path, layout: Layout) -> bool:
    try:
        find_reader(path, AUTO)(path, layout, ReadingOptions())
    except InputError:
        return False
    return True


def _complete(lines: list[str], what: str, layout: Layout) -> Description:
    return Description((*lines, f"every {what} is a segment of layout {layout.name}: needs no mapping"))


def _with_draft(
    path: Path, lines: list[str], draft: dict[str, Any], receivers: dict[str, dict[str, str]]
) -> Description:
    head = [
        f"# Drafted from {path.name}, which says its units itself. Each name under receivers must be",
        "# a segment of the layout: correct it, or take the receiver out. Check the rest as well.",
    ]
    body = [f"{key}: {_json(value)}" for key, value in draft.items()]
    body += ["receivers:", *(f"  {segment}: {_json(keys)}" for segment, keys in receivers.items())]
    return Description(tuple(lines), "\n".join([*head, *body]) + "\n")


def _draft_receivers(names: Iterable[str], key: str) -> dict[str, dict[str, str]]:
    """Put every name under `key` of a receiver whose own name a segment may have; none is lost."""
    receivers: dict[str, dict[str, str]] = {}
    for name in names:
        bare = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        stem = bare if bare[:1].isalpha() else f"receiver_{bare}".rstrip("_")
        segment, count = stem, 1
        while segment in receivers:
            count += 1
            segment = f"{stem}_{count}"
        receivers[segment] = {key: name}
    return receivers


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)
