"""A subject's bone lengths: a mark a hand, with its stated error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from matplotlib.axes import Axes

from shukotsu.schemas.study import Hand, SubjectSession
from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.palette import INK, PAPER
from shukotsu.stages.report.plots.panels import Panel
from shukotsu.stages.report.plots.rows import FOOT_MM, ROW_MM, Scale, row_axes
from shukotsu.stages.report.study_results import Row, StudyResults


def lengths_panel(results: StudyResults, who: SubjectSession, model: str) -> Panel | None:
    """Return the panel of the subject's lengths under a model; None without any."""
    lengths = {
        hand: {(row["bone"], row["digit"]): row for row in rows if row["length_mm"] is not None}
        for hand in results.hands_of(*who)
        if (rows := results.bones_of.get((hand, model)))
    }
    bones = list(dict.fromkeys(bone for of_hand in lengths.values() for bone in of_hand))
    if not bones:
        return None
    title = tr("Bone lengths of {who}, {model}.", who=who.label, model=model)
    return Panel("", title, ROW_MM * len(bones), FOOT_MM, partial(draw_lengths, bones=bones, lengths=lengths))


def draw_lengths(
    axes: Axes, bones: Sequence[tuple[str, str]], lengths: Mapping[Hand, Mapping[tuple[str, str], Row]]
) -> None:
    """Draw every bone's length with its 1-sigma error: right hands filled, left ones open."""
    names = [name for name, _ in bones]
    words = [word(name) + (f" ({word(digit)})" if names.count(name) > 1 else "") for name, digit in bones]
    most = max(row["length_mm"] + (row["sd_mm"] or 0.0) for of in lengths.values() for row in of.values())
    row_axes(axes, words, tr("Bone length, 1-sigma error [mm]"), Scale(0.0, 1.05 * most))
    for hand, of_hand in lengths.items():
        left = hand.hand == "left"
        aside = 0.0 if len(lengths) == 1 else 0.18 if left else -0.18
        for y, bone in enumerate(bones):
            if bone in of_hand:
                axes.errorbar(
                    of_hand[bone]["length_mm"], y + aside, xerr=of_hand[bone]["sd_mm"], fmt="o", color=INK,
                    elinewidth=0.8, markersize=3.4, markerfacecolor=PAPER if left else INK,
                    markeredgewidth=0.7, clip_on=False,
                )  # fmt: skip
