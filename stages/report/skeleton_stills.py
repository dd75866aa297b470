"""Pictures of a subject's skeletons: both hands, posed in one frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from shukotsu.errors import InputError
from shukotsu.schemas.study import Hand, SubjectSession
from shukotsu.sentences.messages import translated
from shukotsu.sentences.translation import listed, tr, word
from shukotsu.stages.report.belief import NOT
from shukotsu.stages.report.hand_motion import Array, Chain, chains_at, chains_key, receivers_at
from shukotsu.stages.report.plots.hand import JointLink, Window, hand_panel, window_of
from shukotsu.stages.report.plots.page_pictures import page_picture
from shukotsu.stages.report.recording_results import read_still
from shukotsu.stages.report.study_results import StudyResults
from shukotsu.stages.report.table_cells import alike

_PAGE_MM = 100.0
"""How wide the wider of two hands is in its picture."""


@dataclass(frozen=True)
class Figure:
    """A drawing with its caption, and remarks where something is not in it."""

    caption: str
    drawing: Markup
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class FigureRow:
    """Figures that belong side by side under one heading, and why some are not there."""

    heading: str
    figures: tuple[Figure, ...]
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class DrawnHand:
    """A hand at the frame that is drawn: receivers (n, 3) in the view's axes and chains by model."""

    hand: Hand
    task: str
    frame: int
    receivers_mm: Array
    chains: dict[str, list[Chain]]

    def window(self) -> Window:
        """The window that holds every model's chains, so that models can be compared by eye."""
        return window_of(self.receivers_mm, [chain for chains in self.chains.values() for chain in chains])


@dataclass(frozen=True)
class DrawnHands:
    """A subject's hands as they can be drawn, the left one on the left, and why others cannot."""

    hands: tuple[DrawnHand, ...]
    remarks: tuple[str, ...]


def posed_hands(results: StudyResults, who: SubjectSession) -> DrawnHands:
    """Pose each of the subject's hands in one frame."""
    posed, remarks = [], []
    for hand in reversed(results.hands_of(*who)):
        try:
            posed.append(_posed_hand(results, hand))
        except InputError as error:
            remarks.append(
                tr(
                    "{hand} hand: no picture, for {error}.",
                    hand=hand.hand.capitalize(),
                    error=translated(error.message),
                )
            )
    return DrawnHands(tuple(posed), tuple(remarks))


def index_figure(item: DrawnHand, model: str, entries: Mapping[str, JointLink]) -> Figure:
    """The hand as `model` has it as an index of its joints."""
    hand, chains = item.hand, item.chains[model]
    title = tr(
        "Joints of {hand}, {model}, seen from the back of the hand; each leads to its row in a table.",
        hand=hand,
        model=model,
    )
    window = window_of(item.receivers_mm, chains)
    panel = hand_panel("", title, hand.hand, chains, item.receivers_mm, window, links=entries)
    return Figure(
        tr(
            "{hand} hand, {task}, frame {frame}",
            hand=hand.hand.capitalize(),
            task=item.task,
            frame=item.frame,
        ),
        page_picture(panel),
    )


def skeleton_pictures(results: StudyResults, hands: DrawnHands) -> list[FigureRow]:
    """The subject's posed skeletons: a row for each model (models with equal joints share one)."""
    posed, remarks = hands.hands, hands.remarks
    if not posed:
        return [FigureRow(tr("No picture"), (), tuple(remarks))]
    windows = {item.hand: item.window() for item in posed}
    scale = min(_PAGE_MM / window.width_mm for window in windows.values())
    groups = alike({model: [chains_key(item.chains[model]) for item in posed] for model in results.models})
    return [
        FigureRow(
            listed(group),
            tuple(_figure(item, group, windows[item.hand], scale) for item in posed),
            tuple(remarks),
        )
        for group in groups
    ]


def _posed_hand(results: StudyResults, hand: Hand) -> DrawnHand:
    """Pose the hand in the first of its recordings that has a usable frame; InputError says why none has."""
    mine = [r for r in results.recordings if r.hand == hand and not r.exclude]
    mine.sort(key=lambda recording: recording.role == "calibration")
    reasons = []
    for recording in mine:
        try:
            motion = read_still(results, recording, list(results.models))
        except InputError as error:
            reasons.append(error.message)
            continue
        chains = {own.model: chains_at(motion, own, 0) for own in motion.skeletons}
        return DrawnHand(hand, recording.task, int(motion.frame[0]), receivers_at(motion, 0), chains)
    raise InputError("; ".join(dict.fromkeys(reasons)) or "it has no recording in use")


def _figure(item: DrawnHand, models: Sequence[str], window: Window, scale: float) -> Figure:
    """One hand under models whose joints are equal."""
    hand, chains = item.hand, item.chains[models[0]]
    title = tr(
        "Skeleton of {hand}, {models}, seen from the back of the hand and from its side. The "
        "caption names the joints not to believe.",
        hand=hand,
        models=listed(models),
    )
    panel = hand_panel("", title, hand.hand, chains, item.receivers_mm, window, mm_per_mm=scale)
    caption = tr(
        "{hand} hand, {task}, frame {frame}", hand=hand.hand.capitalize(), task=item.task, frame=item.frame
    )
    doubted = dict.fromkeys(
        p.name for chain in chains for p in chain.points if p is not None and p.believed == NOT
    )
    absent = dict.fromkeys(name for chain in chains for name in chain.absent)
    remarks: tuple[str, ...] = (
        (tr("Not to be believed (✕): {doubted}.", doubted=listed(map(word, doubted))),) if doubted else ()
    )
    remarks += (
        (tr("Without a place, so left out: {absent}.", absent=listed(map(word, absent))),) if absent else ()
    )
    return Figure(caption, page_picture(panel), remarks)
