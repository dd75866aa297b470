"""What the template needs to show a moving hand, and a page of its own to try it on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from stages.report.hand_picture import hand_picture, window_of
from stages.report.posed_skeleton import Chain, Point
from stages.report.templates import render
from stages.report.viewer.motion import Array, HandMotion, SkeletonMotion, seen, shown_first
from stages.report.viewer.motion_data import NOMINAL_HZ, Block, motion_text


@dataclass(frozen=True)
class View:
    """One moving hand as `viewer.html.j2` shows it.

    title : what it shows, for who cannot see it. shown : indices of the models in view before any is chosen.
    still : the picture that stands in where nothing moves, and still_caption what that is. data : what
    `viewer.js` reads. remark : what else to know, or empty.
    """

    title: str
    digits: tuple[str, ...]
    models: tuple[str, ...]
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
    frame, shown = still_frame(motion), shown_first(motion)
    models = tuple(skeleton.model for skeleton in motion.skeletons)
    return View(
        title=title,
        digits=motion.digits,
        models=models,
        shown=shown,
        still=_still(title, motion, motion.skeletons[shown[0]], frame),
        still_caption=f"{models[shown[0]]}, frame {motion.frame[frame]}",
        data=Markup(motion_text(motion, extra, extra_header)),
        remark=_remark(motion),
    )


def page_of_viewer(title: str, motion: HandMotion) -> str:
    """A page that shows one moving hand and asks nothing of any other computer."""
    return render("viewer/page.html.j2", view=view_of(title, motion))


def still_frame(motion: HandMotion) -> int:
    """Index of the frame with most valid receivers, the base among them; of these the middlemost."""
    valid = np.asarray(np.isfinite(motion.receiver_mm).all(-1))
    counts = np.where(valid[:, motion.base], valid.sum(1), 0)
    best = np.flatnonzero(counts == counts.max())
    return int(best[np.argmin(np.abs(best - (len(counts) - 1) / 2))])


def _still(title: str, motion: HandMotion, skeleton: SkeletonMotion, frame: int) -> Markup:
    receivers = _at(motion, frame, motion.receiver_mm)
    receivers = receivers[np.isfinite(receivers).all(-1)]
    chains = _chains(motion, skeleton, frame, receivers)
    window = window_of(receivers, chains)
    return hand_picture(title, motion.hand, chains, receivers, window, window.scale)


def _chains(motion: HandMotion, skeleton: SkeletonMotion, frame: int, receivers_mm: Array) -> list[Chain]:
    """Each digit's points at one frame in the view's axes, from its first bone outward."""
    places = _at(motion, frame, skeleton.position_mm)

    def point(index: int) -> Point | None:
        if not np.isfinite(places[index]).all():
            return None
        reach = np.linalg.norm(receivers_mm - places[index], axis=-1).min()
        return Point(skeleton.points[index], places[index], skeleton.status[index], float(reach))

    chains = []
    for digit, name in enumerate(motion.digits):
        bones = [bone for bone in skeleton.bones if bone.digit == digit]
        ends = [bones[0].start, *(bone.end for bone in bones)]
        chains.append(Chain(name, tuple(skeleton.points[i] for i in ends), tuple(map(point, ends))))
    return chains


def _at(motion: HandMotion, frame: int, world_mm: Array) -> Array:
    """Points (T, n, 3) at one frame in the view's axes, (n, 3)."""
    return np.asarray(seen(motion, np.array([frame]), world_mm[frame : frame + 1])[0])


def _remark(motion: HandMotion) -> str:
    parts = []
    if motion.every > 1:
        parts.append(f"Of the recording one frame in {motion.every} is here.")
    if not np.isfinite(motion.time_s).any():
        parts.append(
            f"The recording has no device time; it is shown as if it had {NOMINAL_HZ:g} frames a second."
        )
    return " ".join(parts)
