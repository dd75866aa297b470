"""Pictures of a subject's skeletons: both hands, posed in one frame."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from markupsafe import Markup

from schemas.errors import InputError
from schemas.study import Hand, Recording
from stages.report.data_table import listed
from stages.report.hand_picture import Window, hand_picture, window_of
from stages.report.posed_skeleton import (
    Array,
    Chain,
    Posture,
    middle_posture,
    receiver_points,
    skeleton_chains,
)
from stages.report.study_results import StudyResults


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
class PosedHand:
    """A hand at the frame that is drawn: its posture, receivers (n, 3) and chains by model."""

    hand: Hand
    task: str
    posture: Posture
    receivers_mm: Array
    chains: dict[str, list[Chain]]

    def window(self) -> Window:
        """The window that holds every model's chains, so that models can be compared by eye."""
        return window_of(self.receivers_mm, [chain for chains in self.chains.values() for chain in chains])


def skeleton_pictures(
    results: StudyResults, subject: str, models: Collection[str] | None = None
) -> list[FigureRow]:
    """The subject's posed skeletons: a row for each model (models with equal joints share one).

    The left hand stands on the left. models : those to draw, all unless given.
    """
    posed, remarks = [], []
    for hand in reversed(results.hands(subject)):
        try:
            posed.append(_posed_hand(results, hand))
        except InputError as error:
            remarks.append(f"{hand.hand.capitalize()} hand: no picture, for {error}.")
    if not posed:
        return [FigureRow("No picture", (), tuple(remarks))]
    windows = {item.hand: item.window() for item in posed}
    scale = min(window.scale for window in windows.values())
    drawn: dict[tuple[Figure, ...], list[str]] = {}
    for model in results.models if models is None else models:
        figures = tuple(_figure(item, model, windows[item.hand], scale) for item in posed)
        drawn.setdefault(figures, []).append(model)
    return [FigureRow(listed(models), figures, tuple(remarks)) for figures, models in drawn.items()]


def _posed_hand(results: StudyResults, hand: Hand) -> PosedHand:
    """Pose the hand in the first of its recordings that has a usable frame; InputError says why none has."""
    layout = results.layouts[hand]
    recordings = results.study.evaluated(hand) + results.study.of(hand, ("calibration",))
    reasons = []
    for recording in recordings:
        try:
            posture = _posture(results, recording)
        except InputError as error:
            reasons.append(str(error))
            continue
        chains = {
            name: skeleton_chains(
                layout, model, {row["joint"]: row for row in results.joints_of.get((hand, name), [])}, posture
            )
            for name, model in results.models.items()
        }
        return PosedHand(hand, recording.task, posture, receiver_points(layout, posture), chains)
    raise InputError("; ".join(dict.fromkeys(reasons)) or "it has no recording in use")


def _posture(results: StudyResults, recording: Recording) -> Posture:
    path = results.paths.poses(recording)
    place = path.relative_to(results.paths.folder).as_posix()
    try:
        posture = middle_posture(path, results.layouts[recording.hand])
    except InputError as error:
        message = str(error).replace(str(path), place)
        raise InputError(message.rstrip(".")) from error
    if posture is None:
        raise InputError(f"{place} has no frame with a valid base receiver")
    return posture


def _figure(item: PosedHand, model: str, window: Window, scale: float) -> Figure:
    hand, chains = item.hand, item.chains[model]
    title = (
        f"Skeleton of subject {hand.subject}, {hand.hand} hand, seen from the back of the hand and from its "
        "side. The caption names the doubtful joints."
    )
    drawing = hand_picture(title, hand.hand, chains, item.receivers_mm, window, scale)
    caption = f"{hand.hand.capitalize()} hand, {item.task}, frame {item.posture.frame}"
    weak = dict.fromkeys(
        p.name for chain in chains for p in chain.points if p is not None and p.status == "weak"
    )
    absent = dict.fromkeys(name for chain in chains for name in chain.absent)
    remarks: tuple[str, ...] = (f"Doubtful: {listed(weak)}.",) if weak else ()
    remarks += (f"Without a place, so left out: {listed(absent)}.",) if absent else ()
    return Figure(caption, drawing, remarks)
