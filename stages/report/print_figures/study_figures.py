"""Which figures there are: a study's, and a recording's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from shukotsu.errors import InputError
from shukotsu.schemas.results import STUDY_FIGURES
from shukotsu.schemas.study import Recording, path_token
from shukotsu.sentences.translation import tr
from shukotsu.stages.report.movement_results import read_movement
from shukotsu.stages.report.print_figures.drawing import Drawing, NoDataError, drawn
from shukotsu.stages.report.print_figures.joints import joint_errors, joint_trust
from shukotsu.stages.report.print_figures.models import models
from shukotsu.stages.report.print_figures.movement import ranges_of_motion
from shukotsu.stages.report.print_figures.over_time import joint_angles, tip_error
from shukotsu.stages.report.study_results import StudyResults


def of_study(results: StudyResults) -> Iterator[Drawing]:
    """The study's figures, STUDY_FIGURES in turn."""
    draw: dict[str, Callable[[], tuple[Figure, str]]] = {
        "models": partial(models, results),
        "joint-errors": partial(joint_errors, results),
        "joint-trust": partial(joint_trust, results),
    }
    movement = read_movement(results)
    draw |= {
        "ranges-of-motion": partial(ranges_of_motion, results, movement),
    }
    for name in STUDY_FIGURES:
        yield drawn(name, draw[name])


def of_recording(results: StudyResults, recording: Recording) -> Iterator[Drawing]:
    """One recording's figures: tip-error, and joint-angles of every fitted model."""
    yield drawn("tip-error", partial(tip_error, results, recording))
    for model in results.fitted:
        name = f"joint-angles_{path_token(model)}"
        yield drawn(name, partial(joint_angles, results, recording, model))
    if not results.fitted:
        yield drawn("joint-angles", _no_angles)


def recording_folder(recording: Recording) -> Path:
    """Return the folder of a recording's figures, below the study's."""
    return Path(recording.hand.folder, recording.name)


def find_recording(results: StudyResults, subject: str, hand: str, name: str) -> Recording:
    """The recording of that subject and hand study_text task (with `_` and the trial) is `name`.

    Raises InputError that says which there are.
    """
    recordings = results.recordings
    of_hand = [
        r for r in recordings if r.hand.hand == hand and subject in (r.hand.who.label, r.hand.who.token)
    ]
    for recording in of_hand:
        plain = recording.task + (f"_{recording.trial}" if recording.trial else "")
        if name in (recording.name, plain):
            return recording
    if of_hand:
        known = tr("this hand has ") + ", ".join(recording.name for recording in of_hand)
    else:
        known = tr("hands are ") + ", ".join(f"{h.who.token} {h.hand}" for h in results.hands[:12])
    raise InputError(f"--recording {subject} {hand} {name}: no such recording; {known}")


def _no_angles() -> tuple[Figure, str]:
    raise NoDataError(tr("joint angles need a model that fits the whole hand, and this study has none"))
