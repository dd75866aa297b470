"""Lengths of the bones of fitted hands, each with its stated error."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stages.report.palette import Look, model_looks
from stages.report.print_figures.caption_text import count_range, study_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.marks import MANY, dots, scattered
from stages.report.print_figures.style import TWO_COLUMNS_MM, headings, label, new_figure, stacked
from stages.report.study_results import StudyResults

_PANEL_MM, _FOOT_MM = 58.0, 26.0
_Lengths = dict[str, dict[tuple[str, str], tuple[float, float]]]
"""By bone, then by subject and hand: length and its 1-sigma error, mm."""


def bone_lengths(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a fitted model. Raises NoDataError where no hand was fitted as a whole."""
    found = {model: of for model in results.fitted if (of := _lengths(results, model))}
    if not found:
        raise NoDataError(
            "only a model that fits the whole hand states the bones themselves, and "
            + ("none of its hands has lengths" if results.fitted else "this study has no such model")
        )
    bones = list(dict.fromkeys(bone for of in found.values() for bone in of))
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + _PANEL_MM * len(found))
    panels = stacked(figure, len(found), sharex=True)
    look = model_looks(list(results.models))
    for (model, of), axes in zip(found.items(), panels, strict=True):
        _panel(axes, bones, of, look[model])
    counts = [count_range(len(hands) for hands in of.values()) for of in found.values()]
    headings(panels, [label(f"{own}; n = {n} hands") for own, n in zip(found, counts, strict=True)])
    panels[-1].set_xticks(range(len(bones)), [label(bone) for bone in bones], rotation=90)
    many = any(len(hands) > MANY for of in found.values() for hands in of.values())
    marks = (
        f"A dot is a hand (coloured: right, grey: left); {_stated(found)}"
        if many
        else "A mark is a hand (filled: right, open: left), the bar its stated 1-sigma error"
    )
    return figure, (
        f"Bone lengths of fitted hands [mm]. {study_text(results)} {marks}. Joint to joint, the "
        f"last bone of a "
        "digit to its end. Where the model shares lengths between a person's hands, the two are not "
        "independent."
    )


def _stated(found: dict[str, _Lengths]) -> str:
    errors = [sd for of in found.values() for hands in of.values() for _, sd in hands.values()]
    return f"median of the stated 1-sigma errors: {np.nanmedian(errors):.2f} mm"


def _lengths(results: StudyResults, model: str) -> _Lengths:
    """Lengths of the bones of a model that fits the whole hand; of any other none."""
    found: _Lengths = defaultdict(dict)
    for (hand, name), rows in results.bones_of.items():
        for row in rows:
            if name == model and row["length_mm"] is not None:
                sd = row["sd_mm"]
                found[row["bone"]][hand.subject, hand.hand] = (row["length_mm"], np.nan if sd is None else sd)
    return dict(found)


def _panel(axes: Axes, bones: list[str], lengths: _Lengths, look: Look) -> None:
    hands = list(dict.fromkeys(hand for of in lengths.values() for hand in of))
    step = dict(zip(hands, _aside(hands), strict=True))
    for place, bone in enumerate(bones):
        for side, filled in (("right", True), ("left", False)):
            of = {hand: pair for hand, pair in lengths.get(bone, {}).items() if hand[1] == side}
            if of:
                x = place + np.array([step[hand] for hand in of])
                length, sd = np.array(list(of.values())).T
                if len(hands) > MANY:
                    dots(axes, x, length, look.colour if filled else "0.35")
                    continue
                axes.vlines(x, length - sd, length + sd, color=look.colour, linewidth=0.5)
                axes.plot(
                    x, length, "o", color=look.colour, markersize=2.4, linestyle="none",
                    markerfacecolor=look.colour if filled else "white", markeredgewidth=0.5,
                )  # fmt: skip
    axes.set_xlim(-0.6, len(bones) - 0.4)
    axes.set_ylim(0.0, 1.06 * max(length for of in lengths.values() for length, _ in of.values()))
    axes.set_ylabel("Bone length [mm]")
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y")


def _aside(hands: list[tuple[str, str]]) -> list[float]:
    """Subjects side by side, their two hands next to each other."""
    return [float(step) for step in np.sort(scattered(len(hands), 0.72))]
