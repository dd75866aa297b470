"""Prepare the template's input for a moving hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.hand_motion import (
    HandMotion,
    shown_first,
    still_frame,
)
from shukotsu.stages.report.plots.hand import hand_panel
from shukotsu.stages.report.plots.page_pictures import page_picture
from shukotsu.stages.report.viewer.packed_motion import NOMINAL_HZ, Block, motion_text


@dataclass(frozen=True)
class View:
    """One moving hand as `viewer.html.j2` shows it.

    title : what it shows, for who cannot see it. places : of the models in the study, which their colours
    go by. shown : indices of the models in view before any is chosen. still : the picture that stands in
    where nothing moves, and still_caption what that is. data : what `viewer.js` reads. remark : what else
    to know, or empty.
    """

    title: str
    digits: tuple[str, ...]
    models: tuple[str, ...]
    places: tuple[int, ...]
    shown: tuple[int, ...]
    still: Markup
    still_caption: str
    data: Markup
    remark: str


def view_of(
    title: str, motion: HandMotion, extra: Sequence[Block] = (), extra_header: Mapping[str, Any] | None = None
) -> View:
    """Pack a hand's motion for the template, and beside it what other scripts of the page need.

    extra : blocks of the motion's T frames (`motion.frame` says which of the recording they are).
    extra_header : what JSON can hold. A script finds them as `viewer.blocks[name]`, `viewer.header.extra`.
    """
    shown = shown_first(motion)
    frame = still_frame(motion, motion.skeletons[shown[0]])
    models = tuple(skeleton.model for skeleton in motion.skeletons)
    return View(
        title=title,
        digits=tuple(map(word, motion.digits)),
        models=models,
        places=tuple(skeleton.place for skeleton in motion.skeletons),
        shown=shown,
        still=page_picture(hand_panel(title, motion, motion.skeletons[shown[0]], frame)),
        still_caption=tr("{models}, frame {frame}", models=models[shown[0]], frame=motion.frame[frame]),
        data=Markup(motion_text(motion, extra, extra_header)),
        remark=_remark(motion),
    )


def _remark(motion: HandMotion) -> str:
    parts = []
    if motion.every > 1:
        parts.append(tr("Of the recording one frame in {every} is here.", every=motion.every))
    if not np.isfinite(motion.time_s).any():
        parts.append(
            tr(
                "The recording has no device time; it is shown as if it had {NOMINAL_HZ:g} frames a second.",
                NOMINAL_HZ=NOMINAL_HZ,
            )
        )
    return " ".join(parts)
