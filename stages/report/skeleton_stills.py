"""Still pictures of a subject's hands under the leading model."""

from __future__ import annotations

from typing import NamedTuple

from markupsafe import Markup

from shukotsu.errors import InputError
from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import tr, translated
from shukotsu.stages.report.plots.hand import hand_panel
from shukotsu.stages.report.plots.panels import page_picture
from shukotsu.stages.report.recording_results import read_still
from shukotsu.stages.report.study_results import StudyResults


class Still(NamedTuple):
    """A picture of a hand with what it shows; drawing is empty where there is none, and caption says why."""

    caption: str
    drawing: Markup


def hand_still(results: StudyResults, hand: Hand) -> Still:
    """The hand in the first of its recordings that has a frame to show, evaluated ones first."""
    name, reasons = hand.hand.capitalize(), []
    recordings = [own for own in results.recordings if own.hand == hand and not own.exclude]
    for recording in sorted(recordings, key=lambda own: own.role == "calibration"):
        try:
            motion = read_still(results, recording, [results.leading])
        except InputError as error:
            reasons.append(translated(error.message))
            continue
        title = tr("Skeleton of {hand}, {model}.", hand=hand, model=results.leading)
        caption = tr(
            "{hand} hand, {task}, frame {frame}", hand=name, task=recording.task, frame=motion.frame[0]
        )
        return Still(caption, page_picture(hand_panel(title, motion, motion.skeletons[0], 0)))
    why = "; ".join(dict.fromkeys(reasons)) or tr("it has no recording in use")
    return Still(tr("{hand} hand: no picture, for {error}.", hand=name, error=why), Markup())
