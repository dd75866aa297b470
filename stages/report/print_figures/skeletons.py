"""One recording's skeletons: the hand from its back and from its thumb's side, a panel a model."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from shukotsu.errors import InputError
from shukotsu.schemas.study import Recording
from shukotsu.sentences.translation import listed, tr, word
from shukotsu.stages.report.belief import BELIEF_MARKS, CARE, NOT
from shukotsu.stages.report.hand_motion import Chain, chains_at, chains_key, receivers_at
from shukotsu.stages.report.palette import SOFT, Mark
from shukotsu.stages.report.plots.hand import Window, hand_panel, window_of
from shukotsu.stages.report.plots.panels import in_rows, lettered, print_figure
from shukotsu.stages.report.plots.style import TWO_COLUMNS_MM
from shukotsu.stages.report.print_figures.drawing import NoDataError, recording_text
from shukotsu.stages.report.recording_results import read_still
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import alike


def skeletons(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw a panel a model; models with equal joints share one. Raises NoDataError without a posture."""
    try:
        motion = read_still(results, recording, list(results.models))
    except InputError as error:
        raise NoDataError(str(error)) from error
    chains = {own.model: chains_at(motion, own, 0) for own in motion.skeletons}
    groups = alike({model: chains_key(own) for model, own in chains.items()})
    receivers = receivers_at(motion, 0)
    window = window_of(receivers, [chain for of in chains.values() for chain in of])
    across = 2 if len(groups) in (1, 2, 4) else 3
    width = TWO_COLUMNS_MM / min(across, len(groups))
    panels = [
        hand_panel(
            listed(models), "", recording.hand.hand, chains[models[0]], receivers, window, panel_mm=width
        )
        for models in groups
    ]
    handles = [
        Line2D(
            [], [], marker=mark.shape, markerfacecolor=mark.face, markeredgecolor=mark.edge, linestyle="none",
            label=words,
        )
        for mark, words in (
            (BELIEF_MARKS[CARE], tr("joint to believe with care")),
            (BELIEF_MARKS[NOT], tr("joint not to believe")),
            (Mark("o", SOFT, SOFT), tr("receiver")),
        )
    ]  # fmt: skip
    figure = print_figure(in_rows(panels, across), handles)
    return figure, _caption(recording, int(motion.frame[0]), groups, chains, window)


def _caption(
    recording: Recording, frame: int, groups: list[list[str]], chains: dict[str, list[Chain]], window: Window
) -> str:
    sentences = []
    for models in groups:
        points = {p.name: p for chain in chains[models[0]] for p in chain.points if p is not None}
        outside = [
            tr("{name} ({reach_mm:.0f} mm from its receiver)", name=word(p.name), reach_mm=p.reach_mm)
            for p in points.values()
            if not window.holds(p)
        ]
        absent = dict.fromkeys(name for chain in chains[models[0]] for name in chain.absent)
        doubted = [point.name for point in points.values() if point.believed == NOT]
        parts = [listed(models)]
        parts += [tr("not to be believed: {doubted}", doubted=listed(map(word, doubted)))] if doubted else []
        parts += [tr("outside the picture: {outside}", outside=listed(outside))] if outside else []
        parts += [tr("without a place: {absent}", absent=listed(map(word, absent)))] if absent else []
        sentences.append(tr("{parts}.", parts="; ".join(parts)))
    side = tr("thumb's side, with the back of the hand to the {hand}", hand=recording.hand.hand)
    return tr(
        "Skeletons of {recording_text}, at frame {frame} (n = 1 frame, of those with most valid "
        "receivers the one in which the hand is most open). Left: from the back of the hand; "
        "right: from the {side}. Lengths in mm, one scale in all panels. Joints stand where "
        "their receivers carry them and tips at the distal receivers, those of a fitted hand "
        "where the fit poses its bones. Models with equal joints share a panel. ",
        recording_text=recording_text(recording),
        frame=frame,
        side=side,
    ) + lettered(sentences)
