"""The coach's page: an HTML file that reloads itself, with the hand, all joints and the advice."""

from __future__ import annotations

from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup

from shukotsu.coach.coach import ENDED, Coach, first_reason
from shukotsu.errors import InputError
from shukotsu.hand.digit_chain import Rows
from shukotsu.hand.posing import Skeleton
from shukotsu.report import palette, templates
from shukotsu.report.belief import belief
from shukotsu.report.figures.drawing import hand_panel, page_picture
from shukotsu.report.hand_motion import hand_motion, receiver_skeleton
from shukotsu.tables.whole_files import write_text

EVERY_S = 1.0
"""Interval at which the page is written and reloads itself."""
MOST_LINES = 8
"""Number of the newest lines of the log that are shown."""
_LOADER = jinja2.FileSystemLoader(Path(__file__).parent)
_TEMPLATE = templates.ENVIRONMENT.overlay(loader=_LOADER).get_template("page.html.j2")


def write_page(path: Path, coach: Coach, title: str, message: str = "") -> None:
    """Write the page atomically.

    Parameters
    ----------
    path : Path
        The HTML file.
    coach : Coach
        State of the calibration.
    title : str
        Title of the page.
    message : str
        Warning to show at the top, or "".

    Raises
    ------
    StorageError
        If the file cannot be written.

    """
    now = coach.calibration
    rows = {} if now.estimate is None else now.estimate.rows
    text = _TEMPLATE.render(
        title=title,
        message=message,
        css=Markup(palette.css()),
        every_s=None if coach.phase == ENDED else EVERY_S,
        phase=coach.phase,
        time_s=coach.time_s,
        warnings=[*coach.findings, *now.loose.values()],
        advice=coach.advice or coach.summary(),
        hand=_draw_hand(coach, rows),
        rows=[(r["joint"], f"{r['sd_mm']:.2f}", belief(r), first_reason(r)) for r in rows.values()],
        wanted_mm=coach.hand.layout.wanted_mm,
        log=coach.log[: -MOST_LINES - 1 : -1],
    )
    write_text(path, text)


def _draw_hand(coach: Coach, rows: Rows) -> Markup | None:
    """Draw the hand as in the report, in the newest of the frames with the most valid receivers."""
    poses, hand = coach.calibration.newest, coach.hand
    if poses is None or not rows:
        return None
    seen = np.flatnonzero(poses.valid.sum(1) == poses.valid.sum(1).max())
    poses = poses.take(seen[-1:])
    try:
        skeleton = receiver_skeleton(Skeleton(hand.layout, hand.model, rows, {}), poses)
        motion = hand_motion(hand.hand, hand.layout, poses, [skeleton])
    except InputError:
        return None
    title = "The hand as it is, seen from its back and from the thumb's side"
    return page_picture(hand_panel(title, motion, skeleton, 0))
