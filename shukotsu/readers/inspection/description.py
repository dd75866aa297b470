"""Result of `shukotsu inspect` on a file, and formatting of its numbers."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.arrays import Array
from shukotsu.tables.limits import MM_PER_UNIT, SECONDS_PER_UNIT

CHECK = "CHECK"
"""Placeholder in a drafted mapping for information that the file does not contain; never a valid value."""
NOTHING, TOO_FAR = "nothing", "too far for a tracker"
_EXTENTS = (
    (2, NOTHING),
    (30, "a fingertip's width"),
    (300, "a hand's reach of motion"),
    (2500, "a desk"),
    (8000, "a room"),
    (np.inf, TOO_FAR),
)
"""Largest span of a motion in mm, and an object of that size for comparison."""
IMPOSSIBLE_EXTENTS = (NOTHING, TOO_FAR)


@dataclass(frozen=True)
class Description:
    """Lines of facts about a file, a mapping to edit ("" if not needed), and whether it can be imported."""

    lines: tuple[str, ...]
    draft: str = ""
    recording: bool = True


@np.errstate(over="ignore")  # an infinite span is printed as such
def extent_line(what: str, position: Array, stated: str = "") -> str:
    """Format the span of positions (N, 3) and its meaning; stated : the unit that their titles state."""
    seen = position[np.isfinite(position).all(-1)]
    if not len(seen):
        return f"{what}: no complete position"
    spans = np.ptp(seen, axis=0)
    largest = float(spans.max())
    if stated:
        meanings = f"in {stated}, as its titles say, {extent(largest * MM_PER_UNIT[stated])}"
    else:
        meanings = ", ".join(f"in {unit} {extent(largest * mm)}" for unit, mm in MM_PER_UNIT.items())
    return f"{what}: span {largest:.3g} (x {spans[0]:.3g}, y {spans[1]:.3g}, z {spans[2]:.3g}); {meanings}"


def extent(span_mm: float) -> str:
    """Return the name of an object of that span, for comparison."""
    return next(meaning for limit, meaning in _EXTENTS if span_mm <= limit)


@np.errstate(over="ignore")
def rate_line(what: str, time: Array, units: Iterable[str], why: str = "") -> str:
    """Format the median step of times (N,) and the rate in each unit; why : reason for the units given."""
    step = median_step(time)
    if step is None:
        return f"{what}: one time only"
    because = f", {why}," if why else ""
    rates = ", ".join(f"in {unit}{because} {1 / (step * SECONDS_PER_UNIT[unit]):.4g} Hz" for unit in units)
    longest = float(_steps(time).max())
    gaps = f"; longest step {longest:.4g}" if longest > 1.5 * step else ""
    return f"{what}: median step {step:.4g}, so {rates}{gaps}"


def median_step(time: Array) -> float | None:
    """Return the median difference between consecutive distinct times (N,); None if there is only one."""
    steps = _steps(time)
    return float(np.median(steps)) if len(steps) else None


def _steps(time: Array) -> Array:
    steps: Array = np.diff(np.unique(time[np.isfinite(time)]))
    return steps


def draft(path: Path, config: Mapping[str, Any], more: Iterable[str] = ()) -> str:
    """Return a mapping to edit, as YAML.

    config : key -> value, or (value, reason); the reason becomes a comment. more : lines to append.
    """
    body = "\n".join([*_block(config), *more])
    marks = f" {CHECK} marks what the file does not state: edit it before import." if CHECK in body else ""
    return f"# Drafted from {path.name}.{marks}\n{body}\n"


def _block(group: Mapping[str, Any], indent: str = "") -> Iterator[str]:
    for key, entry in group.items():
        value, why = entry if isinstance(entry, tuple) else (entry, "")
        comment = f"  # {why}" if why else ""
        if isinstance(value, Mapping) and not indent:
            yield f"{key}:{comment}"
            yield from _block(value, "  ")
        else:
            yield f"{indent}{key}: {_flow(value)}{comment}"


def _flow(value: Any) -> str:
    """Format a value in YAML's flow style, on one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_flow(item)}' for key, item in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, value))}]"
    return str(value) if str(value).startswith(CHECK) else json.dumps(value, ensure_ascii=False)
