"""Charts with a row a joint: how far its angles went, and the singular values that its centre comes from."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from markupsafe import Markup

from stages.report.error_chart import round_steps
from stages.report.recording.angles import AngleRange
from stages.report.svg import element, image

WIDTH, LEFT, RIGHT, TOP, BOTTOM, ROW = 400, 84, 14, 6, 34, 17
_LEAST_SPAN_DEG = 20.0
# Below this a singular value is the solver's own rounding, far below what any receiver resolves.
_LEAST_SINGULAR_VALUE = 1e-4


def range_chart(title: str, joints: Sequence[str], ranges: Sequence[AngleRange]) -> Markup:
    """Draw one angle's range a joint: a line from the least to the most, a bar from the 5th to the 95th
    percentile, a stroke at the median. `title` is the text alternative.
    """
    low = min((own.at_deg[0] for own in ranges), default=0.0)
    high = max((own.at_deg[-1] for own in ranges), default=0.0)
    lacking = max(0.0, _LEAST_SPAN_DEG - (high - low)) / 2
    across = _linear(low - lacking, high + lacking)
    lines: dict[str, list[str]] = {"extremes": [], "most": [], "median": []}
    for own in ranges:
        y = _middle(joints.index(own.joint))
        least, first, median, last, most = (across(value) for value in own.at_deg)
        lines["extremes"].append(f"M{least:.1f} {y}H{most:.1f}")
        lines["most"].append(f"M{first:.1f} {y}H{last:.1f}")
        lines["median"].append(f"M{median:.1f} {y - 6}v12")
    ticks = round_steps(low - lacking, high + lacking, 5)
    return _chart(title, joints, [(tick, f"{tick:g}") for tick in ticks], across, "deg", lines)


def singular_value_chart(title: str, joints: Sequence[str], values: Sequence[Sequence[float]]) -> Markup:
    """Draw each joint's singular values, largest first, on a logarithmic scale; the sixth is a diamond."""
    known = [max(value, _LEAST_SINGULAR_VALUE) for row in values for value in row]
    power = math.floor(math.log10(min(known, default=0.1)))
    across = _logarithmic(10.0**power, 2.0)
    marks: dict[str, list[str]] = {"first": [], "between": [], "sixth": []}
    for index, row in enumerate(values):
        for place, value in enumerate(row):
            x, y = across(max(value, _LEAST_SINGULAR_VALUE)), _middle(index)
            if place == 5:
                marks["sixth"].append(f"M{x:.1f} {y - 5}l5 5-5 5-5-5z")
            else:
                ball = f"M{x - 3.5:.1f} {y}a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0-7 0z"
                marks["first" if place < 3 else "between"].append(ball)
    ticks = [step * 10.0**n for n in range(power, 1) for step in (1, 3) if step * 10.0**n <= 2.0]
    return _chart(title, joints, [(tick, f"{tick:g}") for tick in ticks], across, "singular value", marks)


def _chart(
    title: str,
    joints: Sequence[str],
    ticks: Sequence[tuple[float, str]],
    across: Callable[[float], float],
    unit: str,
    drawn: Mapping[str, Sequence[str]],
) -> Markup:
    """The joints' names and a grid above the axis, and over them what is drawn: path data by class."""
    foot = TOP + ROW * len(joints)
    marks = []
    for tick, words in ticks:
        x = across(tick)
        marks.append(element("path", class_="axis" if tick == 0 else "grid", d=f"M{x:.1f} {TOP}V{foot}"))
        marks.append(element("text", words, x=x, y=foot + 14, class_="tick middle"))
    names = [
        element("text", joint, x=LEFT - 8, y=_middle(index) + 4, class_="end")
        for index, joint in enumerate(joints)
    ]
    axis = element("path", class_="axis", d=f"M{LEFT} {foot}H{WIDTH - RIGHT}")
    words = element("text", unit, x=(LEFT + WIDTH - RIGHT) / 2, y=foot + BOTTOM - 5, class_="tick middle")
    paths = [element("path", class_=kind, d="".join(data)) for kind, data in drawn.items()]
    return image(WIDTH, foot + BOTTOM, title, *marks, axis, *names, *paths, words)


def _middle(index: int) -> float:
    return TOP + ROW * index + ROW / 2


def _linear(low: float, high: float) -> Callable[[float], float]:
    return lambda value: LEFT + 6 + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT - 12)


def _logarithmic(low: float, high: float) -> Callable[[float], float]:
    scale = _linear(math.log(low), math.log(high))
    return lambda value: scale(math.log(value))
