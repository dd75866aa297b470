"""Where a recording's page leads: the study, the subject, the other hand, other recordings and subjects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from schemas.results import Results
from schemas.study import Hand, Recording, Study
from stages.report.links import Link, link, recording_in_words


@dataclass(frozen=True)
class Navigation:
    """Links of one page; other_hand is None where that hand has no page of the task."""

    study: Link
    subject: Link
    other_hand: Link | None
    others: tuple[Link, ...]


def navigation(study: Study, paths: Results, recording: Recording) -> Navigation:
    """The links of a recording's page, to pages of evaluated recordings alone."""
    page, mine = paths.recording_page(recording), recording.hand

    def to(words: Callable[[Recording], str], target: Recording | None) -> Link | None:
        return None if target is None else link(words(target), page, paths.recording_page(target))

    other = Hand(mine.subject, "left" if mine.hand == "right" else "right")
    others = [
        link(recording_in_words(own, with_hand=True), page, paths.recording_page(own))
        for own in study.shown
        if own.hand.subject == mine.subject and own != recording
    ]
    return Navigation(
        study=link(f"Study {study.name}", page, paths.report),
        subject=link(f"Subject {mine.subject}", page, paths.subject_page(mine.subject)),
        other_hand=to(lambda own: f"{own.hand.hand.capitalize()} hand", _same_task(study, other, recording)),
        others=tuple(others),
    )


def _same_task(study: Study, hand: Hand, recording: Recording) -> Recording | None:
    """The hand's evaluated recording of the same task, of the same trial where there is one."""
    known = [own for own in study.evaluated(hand) if own.task == recording.task]
    same = [own for own in known if own.trial == recording.trial]
    return next(iter([*same, *known]), None)
