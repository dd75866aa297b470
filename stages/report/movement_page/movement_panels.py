"""Describe what the movement page and the figures for print draw: ranges, differences, curves, agreement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.models_compared.model_panels import SCALES
from shukotsu.stages.report.movement_page.movement_results import PLACE, RANGE, Movement
from shukotsu.stages.report.movement_page.movement_text import PAIR
from shukotsu.stages.report.movement_page.wording_of_numbers import angle_text, of_text, place_text
from shukotsu.stages.report.palette import INK, RULE, Look, digit_looks
from shukotsu.stages.report.plots.description import (
    Array,
    Band,
    CurvesPanel,
    Group,
    Line,
    Row,
    RowsPanel,
    Scale,
    difference_scale,
    even_scale,
    value_scale,
)
from shukotsu.stages.report.recording_results import ANGLES
from shukotsu.stages.report.table_cells import capital

if TYPE_CHECKING:
    import pandas as pd

MOST_PANELS = 6
"""The most joints of which curves and agreement are drawn: those that moved most."""
MOST_CONTRASTS = 3
"""The most pairs of levels that are drawn."""
_CYCLE, _HEIGHT_MM = Scale(0.0, 100.0), 36.0


def looks_of_joints(joints: Sequence[str], digits: Sequence[str]) -> dict[str, Look]:
    """The colour of each joint's digit; of a joint of none, ink's."""
    looks = digit_looks(digits)
    plain = Look(INK, "o")
    return {joint: Look(looks.get(joint.partition("_")[0], plain).colour, "o") for joint in joints}


def range_panels(movement: Movement, digits: Sequence[str]) -> list[RowsPanel]:
    """Describe every subject's range of motion by joint: a panel an angle, its hands and tasks below each
    other, for a rotation is a tenth of a flexion.
    """
    means = movement.subject_means
    joints = list(dict.fromkeys(means["joint"]))
    looks, n = looks_of_joints(joints, digits), movement.ranges["subject"].nunique()
    found = []
    for angle in ANGLES:
        groups = []
        for place, of_place in means[means["angle"] == angle].groupby(PLACE, sort=False):
            of_joint = dict(list(of_place.groupby("joint", sort=False)))
            rows = (
                Row(joint, looks[joint], dict(zip(own["subject"], own[RANGE], strict=True)))
                for joint in joints
                if (own := of_joint.get(joint)) is not None
            )
            groups.append(Group(place_text(place), tuple(rows)))
        if groups:
            what = tr("range of motion")
            found.append(_panel(angle, what, tr("Range of motion [deg]"), groups, value_scale, ("", ""), n))
    return found


def _panel(
    angle: str,
    what: str,
    axis: str,
    groups: Sequence[Group],
    scale_of: Callable[[Sequence[float]], Scale],
    sides: tuple[str, str],
    n_subjects: int,
) -> RowsPanel:
    name = capital(word(angle))
    scale = scale_of([value for group in groups for row in group.rows for value in row.values()])
    title = tr("{name}: {what} by joint.", name=name, what=what)
    return RowsPanel(name, title, f"{axis}{tr(SCALES[scale.kind])}", scale, tuple(groups), sides, n_subjects)


@dataclass(frozen=True)
class Contrast:
    """Two levels of a factor, and a panel an angle."""

    levels: tuple[str, str, str]
    panels: tuple[RowsPanel, ...]

    @property
    def words(self) -> str:
        """The contrast in words."""
        factor, level, other = self.levels
        return tr("{factor}: {level} less {other}", factor=factor, level=level, other=other)


def contrasts(movement: Movement, digits: Sequence[str]) -> list[Contrast]:
    """Describe the difference in range of motion of each two levels, with its interval, by joint; marks of
    those that are shown are filled. Of many pairs the first are drawn that could be judged.
    """
    rows = movement.differences
    rows = rows[(rows["quantity"] == RANGE) & rows["difference"].notna()]
    if (rows["verdict"] != "").any():
        rows = rows[rows["verdict"] != ""]
    rows = rows.assign(
        joint=[str(of).partition(" ")[0] for of in rows["of"]],
        angle=[str(of).partition(" ")[2] for of in rows["of"]],
    )
    looks = looks_of_joints(list(dict.fromkeys(rows["joint"])), digits)
    found = []
    for levels, of_pair in islice(rows.groupby(PAIR, sort=False), MOST_CONTRASTS):
        factor, level, other = map(str, levels)
        own = Contrast((factor, level, other), ())
        sides = (tr("{other} more ←", other=other), tr("→ {level} more", level=level))
        panels = []
        for angle in ANGLES:
            groups = [
                Group(place_text(place), tuple(_difference_row(row, looks) for _, row in of_place.iterrows()))
                for place, of_place in of_pair[of_pair["angle"] == angle].groupby(PLACE, sort=False)
            ]
            if groups:
                what = tr("difference, {words}", words=own.words)
                axis = tr("Difference [deg]")
                panels.append(_panel(angle, what, axis, groups, difference_scale, sides, 1))
        found.append(replace(own, panels=tuple(panels)))
    return found


def _difference_row(row: pd.Series[float], looks: dict[str, Look]) -> Row:
    joint, interval = str(row["joint"]), (float(row["low"]), float(row["high"]))
    return Row(
        joint,
        looks[joint],
        mean=float(row["difference"]),
        interval=interval if np.isfinite(interval).all() else None,
        filled=row["verdict"] == "shown",
    )


def curve_plots(movement: Movement, digits: Sequence[str]) -> list[CurvesPanel]:
    """Mean curves over subjects with a band of one standard deviation, of the joints that moved most."""
    found = []
    curves = movement.curves
    for joint, angle in movement.leading_angles:
        own = curves[(curves["joint"] == joint) & (curves["angle"] == angle)]
        for (hand, task, event), rows in own.groupby([*PLACE, "event"], sort=False):
            ordered = rows.sort_values("percent")
            x, mean = _column(ordered, "percent"), _column(ordered, "mean")
            std, n = _column(ordered, "std"), int(rows["count"].max())
            words = tr(
                "{angle_text}, {place_text}, by {event}, n = {n}",
                angle_text=angle_text(joint, angle),
                place_text=place_text((hand, task)),
                event=event,
                n=n,
            )
            found.append(
                CurvesPanel(
                    words,
                    tr("Mean course of {words}", words=words),
                    tr("cycle [%]"),
                    tr("{angle} [deg]", angle=angle),
                    _CYCLE,
                    even_scale([mean, mean - std, mean + std] if n > 1 else [mean]),
                    _HEIGHT_MM,
                    (Line(x, mean, looks_of_joints([joint], digits)[joint].colour),),
                    (Band(x, mean - std, mean + std, RULE),) if n > 1 else (),
                )
            )
        if len(found) >= MOST_PANELS:
            break
    return found[:MOST_PANELS]


def agreement_plots(movement: Movement) -> list[CurvesPanel]:
    """Bland-Altman: differences between consecutive sessions over their means, of what moved most."""
    rows = movement.reliability
    rows = rows[(rows["quantity"] == RANGE) & (rows["across"] == "session") & rows["bias"].notna()]
    found = []
    for joint, angle in movement.leading_angles:
        for _, row in rows[rows["of"] == f"{joint} {angle}"].iterrows():
            first, second = _consecutive(movement, joint, angle, str(row["hand"]), str(row["task"]))
            words = f"{of_text(str(row['of']))}, {place_text((str(row['hand']), str(row['task'])))}"
            limits = [(float(row[name]), True) for name in ("loa_low", "loa_high")]
            levels = ((float(row["bias"]), False), *(each for each in limits if np.isfinite(each[0])))
            found.append(
                CurvesPanel(
                    tr("{words}, n = {n}", words=words, n=int(row["n"])),
                    tr("Agreement of sessions: {words}", words=words),
                    tr("mean of two sessions [deg]"),
                    tr("difference [deg]"),
                    even_scale([(first + second) / 2]),
                    even_scale([second - first, [height for height, _ in levels]]),
                    _HEIGHT_MM,
                    points=((first + second) / 2, second - first),
                    levels=levels,
                )
            )
        if len(found) >= MOST_PANELS:
            break
    return found[:MOST_PANELS]


def _consecutive(movement: Movement, joint: str, angle: str, hand: str, task: str) -> tuple[Array, Array]:
    """Ranges of subjects in a session and in their next one: those that bias and limits are of.

    Sessions are in the order of the subjects who have most of them; one counts that at least half of the
    subjects have, and a subject who has them all.
    """
    means = movement.session_means
    wanted = {"joint": joint, "angle": angle, "hand": hand, "task": task}
    for name, value in wanted.items():
        means = means[means[name] == value]
    wide = means.pivot(index="subject", columns="session", values=RANGE)
    own = sorted((list(rows) for _, rows in means.groupby("subject")["session"]), key=len, reverse=True)
    order = list(dict.fromkeys(session for sessions in own for session in sessions))
    shared = [session for session in order if 2 * wide[session].notna().sum() >= len(wide)]
    values = wide[shared].dropna().to_numpy(float)
    return values[:, :-1].ravel(), values[:, 1:].ravel()


def _column(rows: pd.DataFrame, name: str) -> Array:
    return np.asarray(rows[name], float)
