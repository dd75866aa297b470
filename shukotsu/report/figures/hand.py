"""A hand in one frame, from its back and from its thumb's side, as the tables have it."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes

from shukotsu.report.belief import BELIEF_MARKS, BELIEVED
from shukotsu.report.figures.panels import PAGE_MM, Panel
from shukotsu.report.figures.style import SMALL_PT, width_mm, wrapped
from shukotsu.report.hand_motion import Array, HandMotion, ShownSkeleton, receivers_at, seen
from shukotsu.report.palette import INK, PAPER, SOFT, Mark, digit_looks
from shukotsu.translation import listed, tr, word

_GUTTER_MM, _BAR_MM, _PAD_MM, _NEAR_MM = 14.0, 20.0, 10.0, 45.0
"""Lengths in mm: between the views, the scale's bar, round the hand, and from the box round the receivers to
a joint: one that is farther is a gross failure, which must not shrink the rest.
"""
_HIGHEST_MM, _FOOT_MM, _LINE_MM = 92.0, 10.0, 3.2
"""Sizes of the picture in mm: the views at most, words below them, a line."""


def hand_panel(title: str, motion: HandMotion, skeleton: ShownSkeleton, frame: int) -> Panel:
    """Return the panel of the hand under a skeleton in the frame of that index."""
    joints = seen(motion, np.array([frame]), skeleton.position_mm[frame : frame + 1])[0]
    receivers = receivers_at(motion, frame)
    low, high = receivers.min(axis=0) - _NEAR_MM, receivers.max(axis=0) + _NEAR_MM
    near = np.asarray(((joints >= low) & (joints <= high)).all(axis=1))
    everything = np.concatenate([receivers, joints[near]])
    low, high = everything.min(axis=0) - _PAD_MM, everything.max(axis=0) + _PAD_MM
    wide, tall, deep = (high - low).tolist()
    scale = min((PAGE_MM - 4.0) / (wide + _GUTTER_MM + deep), _HIGHEST_MM / tall)
    side = -1.0 if motion.hand == "left" else 1.0  # the back of a left hand is to the left: never mirrored
    start = wide + _GUTTER_MM + (deep if side < 0 else 0.0)

    def flat(position_mm: Array) -> tuple[Array, Array]:
        """Return points (n, 2) of the picture, mm, of positions (n, 3), in either view."""
        across, up, towards = (position_mm - low).T
        return np.column_stack([across, up]) * scale, np.column_stack([start + side * towards, up]) * scale

    names = [name for name, inside in zip(skeleton.points, near, strict=True) if not inside]
    absent = tr("Not in the picture: {names}.", names=listed(map(word, names))) if names else ""
    lines = wrapped(absent, int((PAGE_MM - 4.0) / width_mm("m"))) if absent else []
    middles = wide * scale / 2, (wide + _GUTTER_MM + deep / 2) * scale
    draw = partial(
        _draw, motion=motion, skeleton=skeleton, views=flat(np.where(near[:, None], joints, np.nan)),
        receivers=flat(receivers), middles=middles, scale=scale, lines=lines,
        size=((wide + _GUTTER_MM + deep) * scale, tall * scale),
    )  # fmt: skip
    return Panel("", title, tall * scale + _FOOT_MM + _LINE_MM * len(lines), 0.0, draw)


def _draw(
    axes: Axes,
    motion: HandMotion,
    skeleton: ShownSkeleton,
    views: tuple[Array, Array],
    receivers: tuple[Array, Array],
    middles: tuple[float, float],
    scale: float,
    lines: list[str],
    size: tuple[float, float],
) -> None:
    """Draw bones in the colour of their digit, joints by verdict, receivers, names of digits and a scale."""
    looks = [look.colour for look in digit_looks(motion.digits).values()]
    axes.set(xlim=(0, size[0]), ylim=(-_FOOT_MM - _LINE_MM * len(lines), size[1]), aspect="equal")
    axes.axis("off")
    digit_of = {bone.end: bone.digit for bone in skeleton.bones}
    for joints, worn in zip(views, receivers, strict=True):
        axes.plot(*worn.T, "s", color=SOFT, markersize=2.6, markeredgewidth=0.0, alpha=0.5, zorder=1)
        for bone in skeleton.bones:
            thick, colour = (2.2, looks[bone.digit]) if bone.level >= 0 else (1.0, SOFT)
            ends = joints[[bone.start, bone.end]]
            axes.plot(*ends.T, color=colour, linewidth=thick, solid_capstyle="round", zorder=2)
        for index, (name, believed) in enumerate(zip(skeleton.points, skeleton.believed, strict=True)):
            if name.endswith("_tip") or not np.isfinite(joints[index]).all():
                continue
            mark = BELIEF_MARKS[believed]
            if believed == BELIEVED:
                mark = Mark("o", PAPER, looks[digit_of[index]] if index in digit_of else INK)
            axes.plot(
                *joints[index], mark.shape, markerfacecolor=mark.face, markeredgecolor=mark.edge,
                markersize=4.2 if believed == BELIEVED else 5.6, markeredgewidth=1.0, zorder=3,
            )  # fmt: skip
    taken: list[tuple[float, float, float]] = []
    for digit in motion.digits:
        x, y = views[0][skeleton.points.index(f"{digit}_tip")]
        wide = width_mm(word(digit)) / 2 + 0.5
        y += 3.0
        while any(abs(x - at) < wide + reach and abs(y - height) < _LINE_MM for at, height, reach in taken):
            y += 0.5
        if np.isfinite(x):
            taken.append((x, y, wide))
            axes.text(x, y, word(digit), ha="center", va="center", fontsize=SMALL_PT)
    turned = tr("from the thumb's side") if "thumb" in motion.digits else tr("from the side")
    for words, middle in zip((tr("from the back"), turned), middles, strict=True):
        axes.text(middle, -1.0, words, ha="center", va="top", color=SOFT, fontsize=SMALL_PT)
    bar = size[0] - _BAR_MM * scale - 1.0, size[0] - 1.0
    axes.plot(bar, [-6.5, -6.5], marker="|", color=SOFT, linewidth=0.8, markersize=4.0)
    words = f"{_BAR_MM:g} mm"
    axes.text(bar[0] - 1.0, -6.5, words, ha="right", va="center", color=SOFT, fontsize=SMALL_PT)
    if lines:
        axes.text(0.0, -_FOOT_MM, "\n".join(lines), ha="left", va="top", color=SOFT, fontsize=SMALL_PT)
