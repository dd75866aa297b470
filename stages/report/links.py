"""Links between the report's pages, which stand in one folder and may be copied with it anywhere."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from markupsafe import Markup

from schemas.results import Results
from schemas.study import Recording


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
    shown: Iterable[Recording], paths: Results, page: Path, subject: str, hand: str = ""
) -> list[Link]:
    """Links to the pages of a subject's recordings that are `shown`, of both hands unless one is named."""
    return [
        link(recording_label(recording, with_hand=not hand), page, paths.recording_page(recording))
        for recording in shown
        if recording.hand.subject == subject and hand in ("", recording.hand.hand)
    ]


def recording_label(recording: Recording, *, with_hand: bool) -> str:
    """What a recording is called in a link."""
    parts = [recording.task, f"trial {recording.trial}" if recording.trial else ""]
    return ", ".join(filter(None, [*parts, f"{recording.hand.hand} hand" if with_hand else ""]))
