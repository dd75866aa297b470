"""Where a recording's page leads: the study, the subject, the other hand, other recordings and subjects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from schemas.study import Hand, Recording
from stages.report.links import Link, link, recording_label
from stages.report.study_results import StudyResults


@dataclass(frozen=True)
class Navigation:
    """Links of one page; other_hand is None where that hand has no page of the task."""

    study: Link
    subject: Link
    other_hand: Link | None
    others: tuple[Link, ...]


def navigation(results: StudyResults, recording: Recording) -> Navigation:
    """The links of a recording's page, to pages of evaluated recordings alone."""
    paths, mine = results.paths, recording.hand
    page = paths.recording_page(recording)

    def to(words: Callable[[Recording], str], target: Recording | None) -> Link | None:
        return None if target is None else link(words(target), page, paths.recording_page(target))

    other = Hand(mine.subject, "left" if mine.hand == "right" else "right")
    others = [
        link(recording_label(own, with_hand=True), page, paths.recording_page(own))
        for own in results.shown
        if own.hand.subject == mine.subject and own != recording
    ]
    return Navigation(
        study=link(f"Study {results.name}", page, paths.report),
        subject=link(f"Subject {mine.subject}", page, paths.subject_page(mine.subject)),
        other_hand=to(
            lambda own: f"{own.hand.hand.capitalize()} hand", _same_task(results, other, recording)
        ),
        others=tuple(others),
    )


def _same_task(results: StudyResults, hand: Hand, recording: Recording) -> Recording | None:
    """The hand's evaluated recording of the same task, of the same trial where there is one."""
    known = [own for own in results.shown if own.hand == hand and own.task == recording.task]
    same = [own for own in known if own.trial == recording.trial]
    return next(iter([*same, *known]), None)
