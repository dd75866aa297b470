"""The figure of the accuracy page: how far centres are off by estimator, and what the stated sd is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

from benchmarks import peers
from benchmarks.accuracy import estimators
from benchmarks.accuracy.scenarios import FULL, SKIN, STIFF
from benchmarks.accuracy.score import HandScore, Summary, summary
from benchmarks.benchmark_table import DOCS
from schemas.files import write_text
from stages.simulate.realism import SATURATING

SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 9,
    "svg.fonttype": "none",
    "svg.hashsalt": "shukotsu",
    "axes.axisbelow": True,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
}
TICKS_MM = (0.5, 1, 2, 5, 10, 20)
WHOLE_COLOUR, OUR_COLOUR, PEER_COLOUR = "#0b5394", "#555b66", "#b45309"
LINES = (
    (estimators.WHOLE, "ellipsoid_percent", "ellipsoid", WHOLE_COLOUR, "o-"),
    (estimators.WHOLE, "radius_percent", "radius", WHOLE_COLOUR, "o--"),
    (estimators.ANATOMICAL, "radius_percent", "radius", OUR_COLOUR, "o--"),
)

Summaries = Mapping[str, Mapping[str, Summary]]
"""By scenario and estimator."""


def write_figure(scores: Mapping[str, Mapping[str, Sequence[HandScore]]], people: str) -> None:
    """Write docs/accuracy.svg from scores by scenario and estimator."""
    summaries = {
        scenario: {name: summary(hands) for name, hands in by_name.items()}
        for scenario, by_name in scores.items()
    }
    write_text(DOCS / "accuracy.svg", draw(summaries, people))


def draw(summaries: Summaries, people: str) -> str:
    """Draw median and p90 of every estimator in two scenarios, and coverage by skin; give the SVG."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(9.6, 4.3), layout="constrained")
        errors, coverage = figure.subplots(1, 2, width_ratios=(5, 3))
        _draw_errors(errors, summaries)
        _draw_coverage(coverage, summaries)
        figure.supxlabel(
            f"{people}; errors from median (dot) to 90th percentile, logarithmic", fontsize=9, color="#5d6068"
        )
        svg = StringIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Title": f"Accuracy, {people}"})
    return svg.getvalue()


def _draw_errors(axes: Any, summaries: Summaries) -> None:
    names = [
        name
        for name in (*estimators.OURS, *peers.PEERS)
        if name in summaries[FULL.name] and summaries[FULL.name][name]["median_mm"] is not None
    ]
    for row, name in enumerate(names):
        for scenario, shift, face in ((FULL, -0.16, _colour(name)), (STIFF, 0.16, "white")):
            one = summaries[scenario.name].get(name)
            if one is not None:
                axes.plot([one["median_mm"], one["p90_mm"]], [row + shift] * 2, color=_colour(name), lw=1.6)
                axes.plot(one["median_mm"], row + shift, "o", mfc=face, mec=_colour(name), ms=5)
    axes.set(xscale="log", yticks=range(len(names)), yticklabels=names, xticks=TICKS_MM)
    axes.set_xticklabels([f"{tick:g}" for tick in TICKS_MM])
    axes.minorticks_off()
    axes.invert_yaxis()
    axes.grid(axis="x", color="#d9dadf")
    axes.set_title("Joint centres against the truth, mm\n● full range of motion   ○ stiff DIPs", loc="left")


def _colour(name: str) -> str:
    if name in peers.PEERS:
        return PEER_COLOUR
    return WHOLE_COLOUR if name.startswith(estimators.WHOLE) else OUR_COLOUR


def _draw_coverage(axes: Any, summaries: Summaries) -> None:
    places = [place for place, scenario in enumerate(SKIN) if scenario.name in summaries]
    axes.axhspan(93, 98, color="#e3edf7")
    for name, metric, label, colour, style in LINES:
        for polynomial in (False, True):
            part = [place for place in places if (SKIN[place].realism.skin != SATURATING) == polynomial]
            percent = [summaries[SKIN[place].name][name][metric] for place in part]
            axes.plot(part, percent, style, color=colour, label=None if polynomial else f"{name}, {label}")
    labels = ["skin x1" if SKIN[place] == FULL else SKIN[place].name for place in places]
    axes.set_xticks(places, labels, rotation=30, ha="right", rotation_mode="anchor")
    axes.set(ylim=(70, 100))
    axes.yaxis.set_major_formatter("{x:.0f} %")
    axes.grid(axis="y", color="#d9dadf")
    axes.legend(loc="lower left", fontsize=8, frameon=False)
    axes.set_title("Stated 95 % that hold the truth\n(band: 93 to 98 %)", loc="left")
