"""One recording's skeletons: the hand from its back and from its thumb's side, a panel a model."""

from __future__ import annotations

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from schemas.errors import InputError
from schemas.study import Recording
from stages.report.belief import BELIEF_MARKS, BELIEVED, CARE, NOT
from stages.report.hand_motion import Array, Chain, chains_at, chains_key, receivers_at
from stages.report.palette import INK, PAPER, RULE, SOFT, digit_looks
from stages.report.pictures.hand_views import (
    BAR_MM,
    GUTTER_MM,
    View,
    Window,
    looks_of_points,
    views_of,
    window_of,
)
from stages.report.print_figures.drawing import NoDataError, recording_text
from stages.report.print_figures.style import SMALL_PT, TWO_COLUMNS_MM, headings, label, lettered, new_figure
from stages.report.recording_results import read_still
from stages.report.study_results import StudyResults
from stages.report.table_cells import alike, listed, title
from stages.report.wording import say, word

_ACROSS = 3
_FOOT_MM = 20.0
_HEAD_MM, _LEGEND_MM, _LINE_MM = 5.0, 11.0, 3.4
_TITLE_LETTERS = 34


def skeletons(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw the panels; models with equal joints share one. Raises NoDataError without a posture."""
    try:
        motion = read_still(results, recording, list(results.models))
    except InputError as error:
        raise NoDataError(str(error)) from error
    chains = {own.model: chains_at(motion, own, 0) for own in motion.skeletons}
    groups = alike({model: chains_key(own) for model, own in chains.items()})
    receivers = receivers_at(motion, 0)
    window = window_of(receivers, [chain for of in chains.values() for chain in of])
    figure, panels = _panels(groups, window)
    for models, axes in zip(groups, panels, strict=True):
        for view in views_of(window, recording.hand.hand):
            _draw_view(axes, view, chains[models[0]], receivers)
        _captions(axes, window)
    headings(panels, [_title(models) for models in groups])
    handles = [
        Line2D(
            [], [], color=own.colour, marker=own.marker, markersize=3, markerfacecolor=PAPER,
            label=label(title(digit)),
        )
        for digit, own in digit_looks(motion.digits).items()
    ]  # fmt: skip
    handles.append(Line2D([], [], color=SOFT, marker="+", linestyle="none", label=say("receiver")))
    for belief, words in ((CARE, say("joint to believe with care")), (NOT, say("joint not to believe"))):
        mark = BELIEF_MARKS[belief]
        handles.append(
            Line2D(
                [], [], color=mark.edge, marker=mark.shape, markerfacecolor=mark.face, linestyle="none",
                markersize=4, label=words,
            )
        )  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=4, columnspacing=0.8)
    return figure, _caption(recording, int(motion.frame[0]), groups, chains, window)


def _panels(groups: list[list[str]], window: Window) -> tuple[Figure, list[Axes]]:
    """A figure with room for every panel in the hand's proportions."""
    across = 2 if len(groups) in (1, 2, 4) else _ACROSS
    down = -(-len(groups) // across)
    lines = max(_title(models).count("\n") for models in groups)
    height = TWO_COLUMNS_MM / across * (float(window.size_mm[1]) + _FOOT_MM) / window.width_mm
    figure = new_figure(TWO_COLUMNS_MM, _LEGEND_MM + down * (height + _HEAD_MM + _LINE_MM * lines))
    grid = figure.subplots(down, across, squeeze=False).ravel()
    for axes in grid:
        axes.set_axis_off()
    return figure, list(grid[: len(groups)])


def _draw_view(axes: Axes, view: View, chains: list[Chain], receivers_mm: Array) -> None:
    """One view in mm of the hand from (0, 0); a diamond where doubtful, ink where several digits share it."""
    box = Rectangle((view.left, 0.0), view.width, view.height, fill=False, edgecolor=RULE, linewidth=1.0)
    axes.add_patch(box)
    receivers = view.places(receivers_mm).T
    axes.plot(*receivers, "+", color=SOFT, alpha=0.6, markersize=3.0, markeredgewidth=0.5)
    looks = digit_looks([chain.digit for chain in chains])
    for chain in chains:
        (bones,) = axes.plot(
            *view.chain(chain).T, color=looks[chain.digit].colour, linewidth=1.0, solid_capstyle="round"
        )
        bones.set_clip_path(box)
    for point, look in looks_of_points(chains):
        shape, edge, face, size = "o", look.colour if look else INK, PAPER, 3.0
        if point.believed != BELIEVED:
            (shape, face, edge), size = BELIEF_MARKS[point.believed], 3.4
        elif point.name.endswith("_tip"):
            size = 2.2
        if view.window.holds(point):
            axes.plot(
                *view.places(point.position_mm), shape, color=edge, markerfacecolor=face, markersize=size,
                markeredgewidth=0.7, zorder=3,
            )  # fmt: skip


def _title(models: list[str]) -> str:
    return "\n".join(textwrap.wrap(label(listed(models)), _TITLE_LETTERS))


def _captions(axes: Axes, window: Window) -> None:
    """What the two views are, and a bar that says how long 20 mm are."""
    wide, high, deep = window.size_mm
    for x, text in ((wide / 2, say("back")), (wide + GUTTER_MM + deep / 2, say("side"))):
        axes.text(x, -1, text, ha="center", va="top", fontsize=SMALL_PT)
    foot = -_FOOT_MM + 3.0
    axes.plot([0, BAR_MM], [foot, foot], color="black", linewidth=1.2, solid_capstyle="butt")
    axes.text(
        BAR_MM + 3.0, foot, say("{BAR_MM:g} mm", BAR_MM=BAR_MM), ha="left", va="center", fontsize=SMALL_PT
    )
    axes.set_xlim(0, window.width_mm)
    axes.set_ylim(-_FOOT_MM, high)
    axes.set_aspect("equal")


def _caption(
    recording: Recording, frame: int, groups: list[list[str]], chains: dict[str, list[Chain]], window: Window
) -> str:
    sentences = []
    for models in groups:
        points = {p.name: p for chain in chains[models[0]] for p in chain.points if p is not None}
        outside = [
            say("{name} ({reach_mm:.0f} mm from its receiver)", name=word(p.name), reach_mm=p.reach_mm)
            for p in points.values()
            if not window.holds(p)
        ]
        absent = dict.fromkeys(name for chain in chains[models[0]] for name in chain.absent)
        doubted = [point.name for point in points.values() if point.believed == NOT]
        parts = [listed(models)]
        parts += [say("not to be believed: {doubted}", doubted=listed(map(word, doubted)))] if doubted else []
        parts += [say("outside the picture: {outside}", outside=listed(outside))] if outside else []
        parts += [say("without a place: {absent}", absent=listed(map(word, absent)))] if absent else []
        sentences.append(say("{parts}.", parts="; ".join(parts)))
    side = say("thumb's side, with the back of the hand to the {hand}", hand=recording.hand.hand)
    return say(
        (
            "Skeletons of {recording_text}, at frame {frame} (n = 1 frame, of those with most valid "
            "receivers the one in which the hand is most open). Left: from the back of the hand; "
            "right: from the {side}. Lengths in mm, one scale in all panels. Joints stand where "
            "their receivers carry them and tips at the distal receivers, those of a fitted hand "
            "where the fit poses its bones. Models with equal joints share a panel. "
        ),
        recording_text=recording_text(recording),
        frame=frame,
        side=side,
    ) + lettered(sentences)
