"""Files that describe themselves, Motion-BIDS, XDF, sequences: what they say, and a mapping if needed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.units import UNIT_NAMES
from shukotsu.stages.capture.formats.motion_sidecars import SHIFT_TO_MM, XYZ, read_sidecars
from shukotsu.stages.capture.formats.readers import AUTO, find_parts_reader
from shukotsu.stages.capture.formats.sequence import open_sequence, tools_of
from shukotsu.stages.capture.inspection.description import CHECK, Description, draft, rate_line


def describe_motion_bids(path: Path, layout: Layout) -> Description:
    """Describe a motion.tsv by its sidecars. Raises InputError where one is none."""
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
    config: dict[str, Any] = {
        "format": "motion-bids",
        "position_unit": next((unit for unit in position_units if unit in SHIFT_TO_MM), CHECK),
    }
    if any("RotationOrder" not in sidecars.frame_levels(channel.reference_frame) for channel in angles):
        config["orientation"] = {"kind": "euler", "axes": CHECK, "unit": angles[0].units}
    config["receivers"] = _receivers(sidecars.points(), "tracked_point", layout)
    return Description(tuple(lines), draft(path, config))


def describe_xdf(path: Path, layout: Layout) -> Description:
    """List the streams, and the markers or objects of those of type MoCap.

    Raises InputError where the file is none, is damaged or has no stream of type MoCap.
    """
    from shukotsu.files.xdf_streams import POSITION, owners, read_streams
    from shukotsu.stages.capture.formats.xdf import is_mocap, mocap_streams, stream_key

    streams = read_streams(path)
    lines = []
    for stream in streams:
        lines.append(
            f"XDF stream {stream.name!r}, number {stream.number}, of type {stream.type or '(none)'}: "
            f"{stream.channel_count} channels of {stream.format}, "
            + (f"{stream.rate_hz:g} Hz" if stream.rate_hz else "irregular")
        )
        for owner in owners(stream) if is_mocap(stream) else ():
            types = [f"{c.type} [{c.unit or 'no unit'}]" for c in stream.channels if c.owner == owner]
            lines.append(f"marker or object {owner}: {', '.join(types)}")
    if _reads_without_mapping(path, layout):
        return _complete(lines, "marker or object", layout)
    stream = mocap_streams(path, streams)[0]
    units = [UNIT_NAMES[c.unit] for c in stream.channels if c.type in POSITION and c.unit in UNIT_NAMES]
    config = {
        "format": "xdf",
        "position_unit": next(iter(units), CHECK),
        "orientation": {"kind": "quaternion", "order": "wxyz"},
        "receivers": _receivers(owners(stream), "value", layout),
        "xdf": {"stream": stream_key(stream, streams)},
    }
    return Description(tuple(lines), draft(path, config))


def describe_sequence(path: Path, layout: Layout) -> Description:
    """List a sequence's transforms. Raises InputError where it has none."""
    transforms, time_s = open_sequence(path)
    seen = {name: np.isfinite(matrices).all((1, 2)).mean() for name, matrices in transforms.items()}
    lines = [f"a sequence of {len(time_s)} frames", rate_line("time stamps", time_s, ["s"])]
    lines += [f"transform {name}, in mm: OK in {share:.0%} of frames" for name, share in seen.items()]
    if _reads_without_mapping(path, layout):
        return Description((*lines, f"its tools are segments of layout {layout.name}: needs no mapping"))
    receivers = {tool: {"value": name} for tool, name in tools_of(transforms).items()}
    named = f"each by its segment in layout {layout.name}: correct its name, or take it out"
    config = {"format": "sequence", "position_unit": "mm", "receivers": (receivers, named)}
    return Description(tuple(lines), draft(path, config))


def _reads_without_mapping(path: Path, layout: Layout) -> bool:
    try:
        for _ in find_parts_reader(path, AUTO)(path, layout, None):
            pass
    except InputError:
        return False
    return True


def _complete(lines: list[str], what: str, layout: Layout) -> Description:
    return Description((*lines, f"every {what} is a segment of layout {layout.name}: needs no mapping"))


def _receivers(names: Iterable[str], key: str, layout: Layout) -> tuple[dict[str, dict[str, str]], str]:
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
    return receivers, f"each by its segment in layout {layout.name}: correct its name, or take it out"
