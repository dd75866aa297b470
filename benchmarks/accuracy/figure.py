"""The figure of the accuracy page: how far centres are off by estimator, and what the stated sd is worth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from markupsafe import Markup

from benchmarks.accuracy import estimators, peers
from benchmarks.accuracy.errors import HandScore
from benchmarks.accuracy.scenarios import FULL, STIFF
from benchmarks.accuracy.summary import Summary, summary
from schemas.files import write_text
from stages.report.svg import element

FIGURE = Path(__file__).parents[2] / "docs" / "accuracy.svg"

WIDTH, HEIGHT = 960, 430
TOP, ROW = 84, 27
LEFT, RIGHT = 205, 525
LOW_MM, HIGH_MM = 0.3, 40.0
TICKS_MM = (0.5, 1, 2, 5, 10, 20)
COVER_LEFT, COVER_RIGHT, COVER_TOP, COVER_FOOT = 608, 808, 84, 354
COVER_LOW, COVER_HIGH = 70.0, 100.0

WHOLE_INK, OURS_INK, PEER_INK, TEXT, SOFT, RULE = (
    "#0b5394",
    "#555b66",
    "#b45309",
    "#1c1d20",
    "#5d6068",
    "#d9dadf",
)

Scores = Mapping[str, Mapping[str, Sequence[HandScore]]]
Point = tuple[float, float]


def write_figure(scores: Scores, skin: Sequence[str], whose: str) -> None:
    """Write docs/accuracy.svg; skin : scenarios of growing artefact, in order."""
    write_text(FIGURE, f"{figure(scores, skin, whose)}\n")


def figure(scores: Scores, skin: Sequence[str], whose: str) -> Markup:
    """Draw median and p90 of every estimator in two scenarios, and coverage by skin."""
    found = {
        scenario: {name: summary(hands) for name, hands in scores[scenario].items()}
        for scenario in (FULL.name, STIFF.name)
    }
    names = [
        name
        for name in (*estimators.OURS, *peers.PEERS)
        if name in found[FULL.name] and found[FULL.name][name].median_mm is not None
    ]
    return element(
        "svg",
        element("title", f"Errors of joint centres by estimator and coverage by skin artefact, {whose}"),
        element("rect", width=WIDTH, height=HEIGHT, fill="#ffffff"),
        *_errors(found, names),
        *_coverage(scores, skin),
        _words(
            f"{whose}; median (dot) to 90th percentile (end of the bar), logarithmic scale",
            16,
            HEIGHT - 12,
            SOFT,
            11.5,
        ),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        role="img",
        font_family="system-ui, sans-serif",
    )


def across_mm(error_mm: float) -> float:
    """Where an error stands on the logarithmic axis, pixels; off the axis it stays at its end."""
    share = math.log(min(max(error_mm, LOW_MM), HIGH_MM) / LOW_MM) / math.log(HIGH_MM / LOW_MM)
    return LEFT + share * (RIGHT - LEFT)


def rise_percent(percent: float) -> float:
    """Where a coverage stands, pixels; below the axis it stays at its foot."""
    share = (max(percent, COVER_LOW) - COVER_LOW) / (COVER_HIGH - COVER_LOW)
    return COVER_FOOT - share * (COVER_FOOT - COVER_TOP)


def _errors(found: Mapping[str, Mapping[str, Summary]], names: Sequence[str]) -> list[Markup]:
    foot = TOP + ROW * len(names)
    parts = [
        _words("Joint centres against the truth, mm", 16, 26, TEXT, 15, weight="600"),
        _bar(16, 48, 46, WHOLE_INK, hollow=False),
        _words("full range of motion", 54, 52, SOFT, 12),
        _bar(196, 48, 226, WHOLE_INK, hollow=True),
        _words("stiff DIPs (opposition)", 234, 52, SOFT, 12),
    ]
    for tick in TICKS_MM:
        x = across_mm(tick)
        parts.append(_line((x, TOP - 8), (x, foot), RULE))
        parts.append(_words(f"{tick:g}", x, foot + 16, SOFT, 11.5, anchor="middle"))
    for row, name in enumerate(names):
        y = TOP + ROW * (row + 0.5)
        parts.append(_words(name, LEFT - 10, y + 4, _ink(name), 12, anchor="end"))
        for scenario, shift in ((FULL.name, -4), (STIFF.name, 5)):
            one = found[scenario].get(name)
            if one is not None and one.median_mm is not None and one.p90_mm is not None:
                ends = across_mm(one.median_mm), across_mm(one.p90_mm)
                parts.append(_bar(ends[0], y + shift, ends[1], _ink(name), hollow=scenario == STIFF.name))
    return parts


def _coverage(scores: Scores, skin: Sequence[str]) -> list[Markup]:
    parts = [
        _words("How often the stated 95 % hold the truth", COVER_LEFT - 40, 26, TEXT, 15, weight="600"),
        _words("band: 93 to 98 %", COVER_LEFT - 40, 52, SOFT, 12),
        element(
            "rect",
            x=COVER_LEFT,
            y=rise_percent(98),
            width=COVER_RIGHT - COVER_LEFT,
            height=rise_percent(93) - rise_percent(98),
            fill="#e3edf7",
        ),
    ]
    for tick in (70, 80, 90, 100):
        y = rise_percent(tick)
        parts.append(_line((COVER_LEFT, y), (COVER_RIGHT, y), RULE))
        parts.append(_words(f"{tick} %", COVER_LEFT - 8, y + 4, SOFT, 11.5, anchor="end"))
    step = (COVER_RIGHT - COVER_LEFT) / (len(skin) - 0.5)
    places = [COVER_LEFT + step * (i + 0.25) for i in range(len(skin))]
    for x, name in zip(places, skin, strict=True):
        words = "x1" if name == FULL.name else name.split()[-1]
        parts.append(_words(words, x, COVER_FOOT + 16, SOFT, 11.5, anchor="middle"))
    n_first = sum(not name.startswith("polynomial") for name in skin)
    for part, words in ((places[:n_first], "skin artefact"), (places[n_first:], "other law")):
        middle = sum(part) / len(part)
        parts.append(_words(words, middle, COVER_FOOT + 34, SOFT, 11.5, anchor="middle"))
    return parts + _coverage_lines(scores, skin, places, n_first)


def _coverage_lines(
    scores: Scores, skin: Sequence[str], places: Sequence[float], n_first: int
) -> list[Markup]:
    parts: list[Markup] = []
    taken: list[float] = []
    lines = (
        (estimators.WHOLE, "ellipsoid_percent", "whole-hand, ellipsoid", WHOLE_INK, False),
        (estimators.WHOLE, "radius_percent", "whole-hand, radius", WHOLE_INK, True),
        (estimators.ANATOMICAL, "radius_percent", "anatomical, radius", OURS_INK, False),
    )
    for estimator, what, label, ink, hollow in lines:
        values = [getattr(summary(scores[name][estimator]), what) for name in skin]
        points = [(x, rise_percent(value)) for x, value in zip(places, values, strict=True)]
        for part in (points[:n_first], points[n_first:]):
            path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in part)
            parts.append(element("path", d=path, fill="none", stroke=ink, stroke_width=1.6))
        parts += [_dot(x, y, ink, hollow=hollow) for x, y in points]
        label_y = points[-1][1]
        while any(abs(label_y - other) < 14 for other in taken):
            label_y += 1
        taken.append(label_y)
        parts.append(_words(label, COVER_RIGHT + 4, label_y + 4, ink, 11))
    return parts


def _ink(name: str) -> str:
    if name in peers.PEERS:
        return PEER_INK
    return WHOLE_INK if name.startswith(estimators.WHOLE) else OURS_INK


def _bar(left: float, y: float, right: float, ink: str, *, hollow: bool) -> Markup:
    """A line from the median to the 90th percentile with a dot at its start."""
    line = element(
        "path",
        d=f"M{left:.1f} {y:.1f}H{right:.1f}",
        stroke=ink,
        stroke_width=1.5 if hollow else 3.5,
        fill="none",
    )
    return Markup("").join((line, _dot(left, y, ink, hollow=hollow)))


def _dot(x: float, y: float, ink: str, *, hollow: bool) -> Markup:
    return element(
        "circle", cx=x, cy=y, r=3.6, fill="#ffffff" if hollow else ink, stroke=ink, stroke_width=1.5
    )


def _line(start: Point, end: Point, ink: str) -> Markup:
    return element(
        "path", d=f"M{start[0]:.1f} {start[1]:.1f}L{end[0]:.1f} {end[1]:.1f}", stroke=ink, fill="none"
    )


def _words(
    words: str, x: float, y: float, ink: str, size: float, *, anchor: str = "start", weight: str = "400"
) -> Markup:
    return element("text", words, x=x, y=y, fill=ink, font_size=size, text_anchor=anchor, font_weight=weight)
