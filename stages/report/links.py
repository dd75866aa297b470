"""Links between the report's pages, which stand in one folder and may be copied with it anywhere."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from shukotsu.schemas.results import Results
from shukotsu.schemas.study import Recording, SubjectSession
from shukotsu.sentences.translation import tr
from shukotsu.stages.report.study_results import StudyResults


class Link(NamedTuple):
    """Words and where they lead, relative to the page that they stand on."""

    words: str
    href: str


def link(words: str, page: Path, target: Path) -> Link:
    """A link on a page to another page of the report."""
    return Link(words, quote(Path(os.path.relpath(target, page.parent)).as_posix()))


def anchor(to: Link) -> Markup:
    """The link as HTML, its words escaped."""
    return Markup('<a href="{}">{}</a>').format(to.href, to.words)


def recording_links(
    shown: Iterable[Recording], paths: Results, page: Path, who: SubjectSession, hand: str = ""
) -> list[Link]:
    """Links to the pages of a subject's recordings that are `shown`, of both hands unless one is named."""
    return [
        link(recording_label(recording, with_hand=not hand), page, paths.recording_page(recording))
        for recording in shown
        if recording.hand.who == who and hand in ("", recording.hand.hand)
    ]


def recording_label(recording: Recording, *, with_hand: bool) -> str:
    """Name a recording in a link."""
    parts = [recording.task, tr("trial {trial}", trial=recording.trial) if recording.trial else ""]
    return ", ".join(filter(None, [*parts, tr("{hand} hand", hand=recording.hand.hand) if with_hand else ""]))


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
    page, study = paths.recording_page(recording), tr("Study {name}", name=results.name)
    other = _same_task(results, "left" if mine.hand == "right" else "right", recording)
    words = tr("Right hand") if mine.hand == "left" else tr("Left hand")
    others = [
        link(recording_label(own, with_hand=True), page, paths.recording_page(own))
        for own in results.shown
        if own.hand.who == mine.who and own != recording
    ]
    return Navigation(
        study=link(study, page, paths.report),
        subject=link(tr("Subject {label}", label=mine.who.label), page, paths.subject_page(*mine.who)),
        other_hand=None if other is None else link(words, page, paths.recording_page(other)),
        others=tuple(others),
    )


def _same_task(results: StudyResults, side: str, recording: Recording) -> Recording | None:
    """The subject's evaluated recording of that hand and task, of the same trial where there is one."""
    hand = replace(recording.hand, hand=side)
    known = [own for own in results.shown if own.hand == hand and own.task == recording.task]
    same = [own for own in known if own.trial == recording.trial]
    return next(iter([*same, *known]), None)
