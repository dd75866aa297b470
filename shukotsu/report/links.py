"""Links between the report's pages, which stand in one folder and may be copied with it anywhere."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from shukotsu.report.study_results import StudyResults
from shukotsu.report.table_cells import title
from shukotsu.study.study import Recording
from shukotsu.tables.subjects import SubjectSession
from shukotsu.translation import tr


class Link(NamedTuple):
    """Words and where they lead, relative to the page that they stand on."""

    words: str
    href: str


def link(words: str, page: Path, target: Path) -> Link:
    """Return a link on a page to another page of the report."""
    return Link(words, quote(Path(os.path.relpath(target, page.parent)).as_posix()))


def anchor(to: Link) -> Markup:
    """Return the link as HTML, its words escaped."""
    return Markup('<a href="{}">{}</a>').format(to.href, to.words)


def recording_links(results: StudyResults, page: Path, who: SubjectSession) -> list[Link]:
    """Return links to the pages of a subject's recordings."""
    links = []
    for recording in results.shown:
        if recording.hand.who == who:
            trial = tr("trial {trial}", trial=recording.trial) if recording.trial else ""
            hand = tr("{hand} hand", hand=recording.hand.hand)
            words = ", ".join(filter(None, (recording.task, trial, hand)))
            links.append(link(words, page, results.paths.recording_page(recording)))
    return links


@dataclass(frozen=True)
class Navigation:
    """Links of a recording's page; other_hand is None where that hand has no page of the task."""

    study: Link
    subject: Link
    other_hand: Link | None
    others: tuple[Link, ...]


def navigation(results: StudyResults, recording: Recording) -> Navigation:
    """Return the links of a recording's page, to pages of evaluated recordings alone."""
    paths, hand = results.paths, recording.hand
    page = paths.recording_page(recording)
    other_hand = replace(hand, hand="left" if hand.hand == "right" else "right")
    same_task = [each for each in results.shown if (each.hand, each.task) == (other_hand, recording.task)]
    same_trial = [each for each in same_task if each.trial == recording.trial]
    other = next(iter([*same_trial, *same_task]), None)
    words = tr("{hand} hand", hand=title(other_hand.hand))
    links = recording_links(results, page, hand.who)
    mine = link("", page, page).href
    return Navigation(
        study=link(tr("Study %(study)s") % {"study": results.name}, page, paths.report),
        subject=link(tr("Subject %(name)s") % {"name": hand.who.label}, page, paths.subject_page(*hand.who)),
        other_hand=None if other is None else link(words, page, paths.recording_page(other)),
        others=tuple(to for to in links if to.href != mine),
    )
