"""Describe what the movement page and the figures for print draw: ranges and differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.models_compared.model_panels import SCALES
from shukotsu.stages.report.movement_page.movement_results import PLACE, RANGE, Movement
from shukotsu.stages.report.movement_page.movement_text import PAIR
from shukotsu.stages.report.movement_page.movement_text import place_text
from shukotsu.stages.report.palette import INK, RULE, Look, digit_looks
from shukotsu.stages.report.plots.panels import Panel
from shukotsu.stages.report.plots.rows import (
    PLAIN,
    Array,
    Group,
    Row,
    Scale,
    difference_scale,
    rows_panel,
    value_scale,
)
from shukotsu.stages.report.recording_results import ANGLES
from shukotsu.stages.report.table_cells import capital

if TYPE_CHECKING:
    import pandas as pd

MOST_CONTRASTS = 3
"""The most pairs of levels that are drawn."""


def looks_of_joints(joints: Sequence[str], digits: Sequence[str]) -> dict[str, Look]:
    """The colour of each joint's digit; of a joint of none, ink's."""
    looks = digit_looks(digits)
    plain = Look(INK, "o")
    return {joint: Look(looks.get(joint.partition("_")[0], plain).colour, "o") for joint in joints}


def range_panels(movement: Movement, digits: Sequence[str]) -> list[Panel]:
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
) -> Panel:
    name = capital(word(angle))
    scale = scale_of([value for group in groups for row in group.rows for value in row.values()])
    title = tr("{name}: {what} by joint.", name=name, what=what)
    return rows_panel(name, title, f"{axis}{tr(SCALES[scale.kind])}", scale, tuple(groups), sides, n_subjects)


@dataclass(frozen=True)
class Contrast:
    """Two levels of a factor, and a panel an angle."""

    levels: tuple[str, str, str]
    panels: tuple[Panel, ...]

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
