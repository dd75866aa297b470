"""The figure of the accuracy page: how far centres are off by scenario, and what the stated sd is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

from benchmarks.accuracy import estimators
from benchmarks.accuracy.scenarios import SIDE_BY_SIDE
from benchmarks.accuracy.score import HandScore, Summary, summary
from benchmarks.benchmark_table import DOCS
from schemas.files import write_text

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
TICKS_MM = (0.1, 0.2, 0.5, 1, 2, 5, 10)
COLOURS = {estimators.WHOLE: "#0b5394", estimators.ANATOMICAL: "#6b8e3d", estimators.PAPER: "#b45309"}
"""The estimators that are drawn."""

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
    """Draw median and p90 of three estimators in every scenario, and coverage; give the SVG."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(SETTINGS):
        scenarios = [one.name for one in SIDE_BY_SIDE if one.name in summaries]
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        errors, coverage = figure.subplots(1, 2, width_ratios=(5, 3))
        _draw_errors(errors, summaries, scenarios)
        _draw_coverage(coverage, summaries, scenarios)
        figure.legend(loc="outside upper left", ncols=len(COLOURS), frameon=False)
        figure.supxlabel(
            f"{people}; errors from median (dot) to 90th percentile, logarithmic", fontsize=9, color="#5d6068"
        )
        svg = StringIO()
        figure.savefig(svg, format="svg", metadata={"Date": None, "Title": f"Accuracy, {people}"})
    return svg.getvalue()


def _draw_errors(axes: Any, summaries: Summaries, scenarios: Sequence[str]) -> None:
    for row, scenario in enumerate(scenarios):
        for shift, (name, colour) in zip((-0.25, 0.0, 0.25), COLOURS.items(), strict=True):
            one = summaries[scenario][name]
            axes.plot([one["median_mm"], one["p90_mm"]], [row + shift] * 2, color=colour, lw=1.8)
            axes.plot(one["median_mm"], row + shift, "o", color=colour, ms=5, label=None if row else name)
    axes.set(xscale="log", yticks=range(len(scenarios)), yticklabels=scenarios, xticks=TICKS_MM)
    axes.set_xticklabels([f"{tick:g}" for tick in TICKS_MM])
    axes.minorticks_off()
    axes.invert_yaxis()
    axes.grid(axis="x", color="#d9dadf")
    axes.set_title("Joint centres off the truth, mm", loc="left")


def _draw_coverage(axes: Any, summaries: Summaries, scenarios: Sequence[str]) -> None:
    axes.axvspan(92, 98, color="#e3edf7")
    for name, colour in COLOURS.items():
        percent = [summaries[scenario][name]["radius_percent"] for scenario in scenarios]
        axes.plot(percent, range(len(scenarios)), "o", color=colour, ms=5)
    axes.set(yticks=range(len(scenarios)), yticklabels=[])
    axes.set_xlim(right=101)
    axes.invert_yaxis()
    axes.xaxis.set_major_formatter("{x:.0f} %")
    axes.grid(axis="both", color="#d9dadf")
    axes.set_title("Stated 95 % that hold it (band: 92 to 98 %)", loc="left")
