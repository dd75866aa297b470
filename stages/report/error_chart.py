"""The chart of tip error over time: one recording and model, one strip a digit above a common time axis."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from markupsafe import Markup

from stages.report.svg import element, image
from stages.report.tip_traces import Array, Trace

WIDTH = 400
LEFT, RIGHT, TOP, BOTTOM = 36, 50, 20, 36
STRIP, BETWEEN = 46, 8
# An error this many times another digit's median would flatten that digit on a linear scale.
_LOG_RATIO = 8.0
# Below this a tip error is noise; drawn on a logarithmic scale its ups and downs would fill the picture.
_LOG_FLOOR_MM = 0.3


@dataclass(frozen=True)
class ErrorScale:
    """The vertical scale that all strips of one chart share, mm."""

    low_mm: float
    high_mm: float
    logarithmic: bool

    def rise_of(self, error_mm: Array) -> Array:
        """Pixels above the foot of the strip, of any shape; an error off the scale stays at its edge."""
        low, high, value = self.low_mm, self.high_mm, np.clip(error_mm, self.low_mm, self.high_mm)
        if self.logarithmic:
            low, high, value = math.log(low), math.log(high), np.log(value)
        return np.asarray((value - low) / (high - low) * STRIP)

    def ticks(self) -> list[float]:
        """Where a strip has its numbers, mm."""
        if not self.logarithmic:
            return round_steps(0.0, self.high_mm, 2)
        powers = range(math.floor(math.log10(self.low_mm)), math.ceil(math.log10(self.high_mm)) + 1)
        steps = (1, 3) if self.high_mm / self.low_mm < 30 else (1,)
        ticks = [step * 10.0**power for power in powers for step in steps]
        return [tick for tick in ticks if self.low_mm <= tick <= self.high_mm]


def error_scale(traces: Iterable[Trace]) -> ErrorScale:
    """A scale for all these traces: from zero, or logarithmic where a gross failure dwarfs the others."""
    traces = list(traces)
    highest = max((float(trace.high_mm.max()) for trace in traces), default=1.0)
    medians = [max(trace.median_mm, _LOG_FLOOR_MM) for trace in traces] or [1.0]
    if highest / min(medians) > _LOG_RATIO:
        low = max(min(float(np.quantile(trace.low_mm, 0.02)) for trace in traces), _LOG_FLOOR_MM)
        return ErrorScale(low, highest * 1.1, True)
    return ErrorScale(0.0, max(highest, 0.1) * 1.02, False)


def error_chart(title: str, digits: tuple[str, ...], traces: dict[str, Trace], scale: ErrorScale) -> Markup:
    """Draw a strip for every digit, empty where it has no trace. `title` is the text alternative."""
    span = (
        min((trace.span[0] for trace in traces.values()), default=0.0),
        max((trace.span[1] for trace in traces.values()), default=1.0),
    )
    in_seconds = all(trace.in_seconds for trace in traces.values())

    def across(x: float) -> float:
        return LEFT + (x - span[0]) / ((span[1] - span[0]) or 1.0) * (WIDTH - LEFT - RIGHT)

    feet = [TOP + STRIP + index * (STRIP + BETWEEN) for index in range(len(digits))]
    strips = [
        part
        for index, (digit, foot) in enumerate(zip(digits, feet, strict=True))
        for part in _strip(index, digit, foot, traces.get(digit), across, scale)
    ]
    height = feet[-1] + BOTTOM
    words = f"tip error [mm]{', log scale' if scale.logarithmic else ''}"
    unit = element("text", words, x=0, y=10, class_="tick")
    return image(WIDTH, height, title, unit, *strips, *_horizontal_axis(feet[-1], span, across, in_seconds))


def _strip(
    index: int,
    digit: str,
    foot: float,
    trace: Trace | None,
    across: Callable[[Any], Any],
    scale: ErrorScale,
) -> list[Markup]:
    """One digit's grid, name and line."""
    parts = []
    for tick in scale.ticks():
        y = float(foot - scale.rise_of(np.array(tick)))
        parts.append(element("path", class_="grid", d=f"M{LEFT} {y:.1f}H{WIDTH - RIGHT}"))
        parts.append(element("text", f"{tick:g}", x=LEFT - 5, y=y + 4, class_="tick end"))
    middle = foot - STRIP / 2 + 4
    parts.append(element("text", digit, x=WIDTH - RIGHT + 8, y=middle, class_="label"))
    if trace is None:
        parts.append(element("text", "no tip error", x=LEFT + 6, y=middle, class_="tick"))
    else:
        line = _path(trace, across, lambda error_mm: foot - scale.rise_of(error_mm))
        parts.append(element("path", class_=f"line digit{index}", d=line))
    return parts


def _path(trace: Trace, across: Callable[[Array], Array], up: Callable[[Array], Array]) -> str:
    """The line through every column's two extremes, in steps of a tenth of a pixel, pen up at gaps."""
    ends = np.column_stack([trace.low_mm, trace.high_mm])
    ends = np.where(trace.rises[:, None], ends, ends[:, ::-1])
    x_tenths = np.rint(across(trace.x) * 10).astype(int).tolist()
    y_tenths = np.rint(up(ends) * 10).astype(int).tolist()
    steps: list[str] = []
    at_x = at_y = 0
    for x, (first, second), broken in zip(x_tenths, y_tenths, trace.broken.tolist(), strict=True):
        if not steps or broken:
            steps.append(f"M{x / 10:g} {first / 10:g}h0")
        else:
            steps.append(f"l{_tenths(x - at_x)} {_tenths(first - at_y)}")
        if second != first:
            steps.append(f"v{_tenths(second - first)}")
        at_x, at_y = x, second
    return "".join(steps).replace(" -", "-")


@lru_cache(maxsize=4096)
def _tenths(value: int) -> str:
    return f"{value / 10:g}".replace("0.", ".", 1) if abs(value) < 10 and value else f"{value / 10:g}"


def _horizontal_axis(
    foot: float, span: tuple[float, float], across: Callable[[float], float], in_seconds: bool
) -> list[Markup]:
    marks = [element("path", class_="axis", d=f"M{LEFT} {foot}H{WIDTH - RIGHT}")]
    for tick in round_steps(*span, 5):
        marks.append(element("path", class_="axis", d=f"M{across(tick):.1f} {foot}v4"))
        marks.append(element("text", f"{tick:.10g}", x=across(tick), y=foot + 15, class_="tick middle"))
    words = "device time [s]" if in_seconds else "frame"
    centre = (LEFT + WIDTH - RIGHT) / 2
    return [*marks, element("text", words, x=centre, y=foot + BOTTOM - 5, class_="tick middle")]


def round_steps(low: float, high: float, about: int) -> list[float]:
    """Multiples of 1, 2 or 5 times a power of ten between low and high, some `about` of them."""
    if high <= low:
        return [low]
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= rough * 0.999)
    return [n * step for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]
