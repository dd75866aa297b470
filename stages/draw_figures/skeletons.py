"""One recording's skeletons: the hand from its back and from its thumb's side, a panel a model."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from schemas.errors import InputError
from schemas.study import Recording
from stages.draw_figures.drawing import NoDataError
from stages.draw_figures.marks import Array
from stages.draw_figures.style import (
    GREY,
    SMALL_PT,
    TWO_COLUMNS_MM,
    Look,
    headings,
    label,
    lettered,
    looks,
    new_figure,
)
from stages.draw_figures.words import capital, whose_recording
from stages.report.data_table import listed
from stages.report.hand_picture import Window, window_of
from stages.report.posed_skeleton import Chain, Point, middle_posture, receiver_points, skeleton_chains
from stages.report.study_results import StudyResults

_ACROSS = 3
_GUTTER_MM, _FOOT_MM, _BAR_MM = 10.0, 20.0, 20.0
_HEAD_MM, _LEGEND_MM, _LINE_MM = 5.0, 8.0, 3.4
_WORDS = 34


def skeletons(results: StudyResults, recording: Recording) -> tuple[Figure, str]:
    """Draw the panels; models with equal joints share one. Raises NoDataError without a posture."""
    layout = results.layouts[recording.hand]
    path = results.paths.poses(recording)
    try:
        posture = middle_posture(path, layout)
    except InputError as error:
        raise NoDataError(str(error)) from error
    if posture is None:
        raise NoDataError(f"{path} has no frame with a valid base receiver")
    chains = {}
    for name, model in results.models.items():
        joints = {row["joint"]: row for row in results.joints_of.get((recording.hand, name), [])}
        chains[name] = skeleton_chains(layout, model, joints, posture)
    groups = _alike(chains)
    receivers = receiver_points(layout, posture)
    window = window_of(receivers, [chain for of in chains.values() for chain in of])
    figure, panels = _panels(groups, window)
    look = looks([chain.digit for chain in chains[groups[0][0]]])
    for models, axes in zip(groups, panels, strict=True):
        _panel(axes, recording.hand.hand, chains[models[0]], receivers, window, look)
    headings(panels, [_title(models) for models in groups])
    handles = [Line2D([], [], color=own.colour, marker=own.marker, markersize=3, label=label(capital(digit)))
               for digit, own in look.items()]  # fmt: skip
    handles.append(Line2D([], [], color=GREY, marker="+", linestyle="none", label="receiver"))
    handles.append(Line2D([], [], color="black", marker="D", markerfacecolor="white", linestyle="none",
                          markersize=4, label="doubtful joint"))  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=7, columnspacing=0.8)
    return figure, _caption(recording, posture.frame, groups, chains, window)


def _alike(chains: dict[str, list[Chain]]) -> list[list[str]]:
    groups: dict[tuple[object, ...], list[str]] = {}
    for model, of in chains.items():
        points = [
            (name, None if p is None else (p.status, *np.round(p.position_mm, 6)))
            for chain in of
            for name, p in zip(chain.names, chain.points, strict=True)
        ]
        groups.setdefault(tuple(points), []).append(model)
    return list(groups.values())


def _panels(groups: list[list[str]], window: Window) -> tuple[Figure, list[Axes]]:
    """A figure with room for every panel in the hand's proportions."""
    across = 2 if len(groups) in (1, 2, 4) else _ACROSS
    down = -(-len(groups) // across)
    wide, high, deep = window.size_mm
    lines = max(_title(models).count("\n") for models in groups)
    height = TWO_COLUMNS_MM / across * float((high + _FOOT_MM) / (wide + deep + _GUTTER_MM))
    figure = new_figure(TWO_COLUMNS_MM, _LEGEND_MM + down * (height + _HEAD_MM + _LINE_MM * lines))
    grid = figure.subplots(down, across, squeeze=False).ravel()
    for axes in grid:
        axes.set_axis_off()
    return figure, list(grid[: len(groups)])


def _title(models: list[str]) -> str:
    return "\n".join(textwrap.wrap(label(listed(models)), _WORDS))


def _panel(
    axes: Axes, hand: str, chains: list[Chain], receivers_mm: Array, window: Window, look: dict[str, Look]
) -> None:
    """Both views side by side in mm of the hand, and a bar that says how long 20 mm are."""
    wide, high, deep = window.size_mm
    sign = 1.0 if hand == "right" else -1.0
    near = window.low_mm[2] if sign > 0 else window.high_mm[2]

    def from_the_back(position: Array) -> Array:
        return np.asarray(position - window.low_mm)[..., :2]

    def from_the_side(position: Array) -> Array:
        x = (position[..., 2] - near) * sign + wide + _GUTTER_MM
        return np.stack([x, position[..., 1] - window.low_mm[1]], axis=-1)

    boxes = (Rectangle((0.0, 0.0), wide, high), Rectangle((wide + _GUTTER_MM, 0.0), deep, high))
    for view, box in zip((from_the_back, from_the_side), boxes, strict=True):
        box.set_transform(axes.transData)
        x, y = view(receivers_mm).T
        axes.plot(x, y, "+", color=GREY, markersize=3, markeredgewidth=0.5)
        for chain in chains:
            _chain(
                axes, chain, np.array([view(_place(p)) for p in chain.points]), window, look[chain.digit], box
            )
    axes.text(wide / 2, -1, "back", ha="center", va="top", fontsize=SMALL_PT)
    axes.text(wide + _GUTTER_MM + deep / 2, -1, "side", ha="center", va="top", fontsize=SMALL_PT)
    foot = -_FOOT_MM + 3.0
    axes.plot([0, _BAR_MM], [foot, foot], color="black", linewidth=1.2, solid_capstyle="butt")
    axes.text(_BAR_MM + 3.0, foot, f"{_BAR_MM:g} mm", ha="left", va="center", fontsize=SMALL_PT)
    axes.set_xlim(0, wide + deep + _GUTTER_MM)
    axes.set_ylim(-_FOOT_MM, high)
    axes.set_aspect("equal")


def _chain(axes: Axes, chain: Chain, xy: Array, window: Window, look: Look, box: Rectangle) -> None:
    """Bones between neighbours that have a place, and a mark a joint; what is far off is cut off."""
    (bones,) = axes.plot(*xy.T, color=look.colour, linewidth=1.0)
    bones.set_clip_path(box)
    for point, (x, y) in zip(chain.points, xy, strict=True):
        if point is None or not _inside(point, window):
            continue
        weak = point.status == "weak"
        axes.plot(
            [x], [y], "D" if weak else look.marker, color="black" if weak else look.colour,
            markersize=4.0 if weak else 2.8, markerfacecolor="white" if weak else look.colour,
            markeredgewidth=0.6, zorder=3,
        )  # fmt: skip


def _place(point: Point | None) -> Array:
    return np.full(3, np.nan) if point is None else point.position_mm


def _inside(point: Point, window: Window) -> bool:
    return bool((point.position_mm >= window.low_mm).all() and (point.position_mm <= window.high_mm).all())


def _caption(
    recording: Recording, frame: int, groups: list[list[str]], chains: dict[str, list[Chain]], window: Window
) -> str:
    told = []
    for models in groups:
        points = {p.name: p for chain in chains[models[0]] for p in chain.points if p is not None}
        outside = [f"{p.name} ({p.reach_mm:.0f} mm from its receiver)" for p in points.values()
                   if not _inside(p, window)]  # fmt: skip
        absent = dict.fromkeys(name for chain in chains[models[0]] for name in chain.absent)
        weak = [point.name for point in points.values() if point.status == "weak"]
        parts = [listed(models)]
        parts += [f"doubtful: {listed(weak)}"] if weak else []
        parts += [f"outside the picture: {listed(outside)}"] if outside else []
        parts += [f"without a place: {listed(absent)}"] if absent else []
        told.append(f"{'; '.join(parts)}.")
    other = "thumb's side, with the back of the hand to the " + recording.hand.hand
    return (
        f"Skeletons of {whose_recording(recording)}, at frame {frame} (n = 1 frame, that with most valid "
        f"receivers nearest to the recording's middle). Left: from the back of the hand; right: from the "
        f"{other}. Lengths in mm, one scale in all panels. Joints stand where their receivers carry them, "
        "the tip is the distal receiver's origin. Models with equal joints share a panel. " + lettered(told)
    )
