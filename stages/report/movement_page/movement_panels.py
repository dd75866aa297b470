"""What the movement page and the figures for print draw, prepared: ranges, differences, curves, agreement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stages.report.comparison.comparison_text import p_text
from stages.report.movement_page.movement_results import OF_ANGLE, PLACE, RANGE, Movement
from stages.report.movement_page.movement_text import LEVEL, PAIR, angle_text, of_text
from stages.report.palette import Look, digit_looks
from stages.report.pictures.subject_dots import Strip
from stages.report.pictures.xy_plot import Array, XYPlot
from stages.report.recording_results import ANGLES
from stages.report.wording import say

if TYPE_CHECKING:
    import pandas as pd

MOST_PANELS = 6
"""The most joints of which curves and agreement are drawn: those that moved most."""


@dataclass(frozen=True)
class Strips:
    """A panel of rows of joints: where it is from, which angle, and its rows."""

    place: str
    angle: str
    strips: tuple[Strip, ...]


def place_text(place: Sequence[str]) -> str:
    """Hand and task in words."""
    hand, task = place
    return say("{hand} hand, {task}", hand=hand, task=task)


def looks_of_joints(joints: Sequence[str], digits: Sequence[str]) -> dict[str, Look]:
    """The colour of each joint's digit; of a joint of none, ink's."""
    looks = digit_looks(digits)
    plain = Look("#1c1d20", "o")
    return {joint: Look(looks.get(joint.partition("_")[0], plain).colour, "o") for joint in joints}


def range_strips(movement: Movement, digits: Sequence[str]) -> list[Strips]:
    """Every subject's range of motion by joint: a panel a hand, task and angle."""
    means = movement.subject_means
    joints = list(dict.fromkeys(means["joint"]))
    looks = looks_of_joints(joints, digits)
    found = []
    for (hand, task), of_place in means.groupby(PLACE, sort=False):
        for angle in ANGLES:
            own = of_place[of_place["angle"] == angle]
            strips = tuple(
                Strip(joint, looks[joint], dict(zip(rows["subject"], rows[RANGE], strict=True)))
                for joint in joints
                if not (rows := own[own["joint"] == joint]).empty
            )
            if strips:
                found.append(Strips(place_text((hand, task)), angle, strips))
    return found


@dataclass(frozen=True)
class Contrast:
    """Two levels of a factor: what they are, how many subjects, and a panel a hand, task and angle."""

    levels: tuple[str, str, str]
    panels: tuple[Strips, ...]

    @property
    def words(self) -> str:
        """The contrast in words."""
        factor, level, other = self.levels
        return say("{factor}: {level} less {other}", factor=factor, level=level, other=other)


def difference_strips(movement: Movement, digits: Sequence[str]) -> list[Contrast]:
    """The difference in range of motion of each two levels, with its interval, by joint; shown ones bold."""
    rows = movement.differences
    rows = rows[(rows["quantity"] == RANGE) & rows["difference"].notna()]
    found = []
    for levels, of_pair in rows.groupby(PAIR, sort=False):
        panels = []
        for place, of_place in of_pair.groupby(PLACE, sort=False):
            joints = [of.partition(" ")[0] for of in of_place["of"]]
            looks = looks_of_joints(joints, digits)
            for angle in ANGLES:
                own = of_place[[of.partition(" ")[2] == angle for of in of_place["of"]]]
                strips = tuple(_difference_strip(row, looks) for _, row in own.iterrows())
                if strips:
                    panels.append(Strips(place_text(place), angle, strips))
        factor, level, other = map(str, levels)
        found.append(Contrast((factor, level, other), tuple(panels)))
    return found


def _difference_strip(row: pd.Series[float], looks: dict[str, Look]) -> Strip:
    joint = str(row["of"]).partition(" ")[0]
    low, high = float(row["low"]), float(row["high"])
    interval = (low, high) if np.isfinite([low, high]).all() else None
    return Strip(joint, looks[joint], {}, float(row["difference"]), interval, float(row["p_max_t"]) <= LEVEL)


@dataclass(frozen=True)
class Drawn:
    """A plot with its heading."""

    heading: str
    plot: XYPlot


def curve_plots(movement: Movement, digits: Sequence[str]) -> list[Drawn]:
    """Mean curves over subjects with a band of one standard deviation, of the joints that moved most."""
    found = []
    curves = movement.curves
    for joint, angle in movement.leading_angles:
        own = curves[(curves["joint"] == joint) & (curves["angle"] == angle)]
        for (hand, task, event), rows in own.groupby([*PLACE, "event"], sort=False):
            ordered = rows.sort_values("percent")
            x, mean = _column(ordered, "percent"), _column(ordered, "mean")
            std, n = _column(ordered, "std"), int(rows["count"].max())
            colour = looks_of_joints([joint], digits)[joint].colour
            words = say(
                "{angle_text}, {place_text}, by {event}, n = {n}",
                angle_text=angle_text(joint, angle),
                place_text=place_text((hand, task)),
                event=event,
                n=n,
            )
            plot = XYPlot(
                say("Mean course of {words}", words=words),
                (say("cycle [%]"), say("{angle} [deg]", angle=angle)),
                (x, mean - std, mean + std) if n > 1 else None,
                ((x, mean, colour),),
            )
            found.append(Drawn(words, plot))
        if len(found) >= MOST_PANELS:
            break
    return found[:MOST_PANELS]


def curve_difference_plots(movement: Movement) -> list[Drawn]:
    """Differences between curves with pointwise 95 % bands, those with the smallest p first."""
    rows = movement.curve_differences
    key = [*PAIR, *PLACE, *OF_ANGLE, "event"]
    curves = [(values, own.sort_values("percent")) for values, own in rows.groupby(key, sort=False)]
    curves.sort(key=lambda each: float(np.fmin.reduce(_column(each[1], "p"), initial=1.0)))
    found = []
    for (_, level, other, hand, task, joint, angle, event), own in curves[:MOST_PANELS]:
        x = _column(own, "percent")
        words = say(
            "{angle_text}, {level} less {other}, {place_text}, by {event}, n = {max} and {max_2}{corrected}",
            angle_text=angle_text(joint, angle),
            level=level,
            other=other,
            place_text=place_text((hand, task)),
            event=event,
            max=int(own["n"].max()),
            max_2=int(own["n_other"].max()),
            corrected=_corrected_text(_column(own, "p_holm")[0]),
        )
        plot = XYPlot(
            say("Difference in course: {words}", words=words),
            (say("cycle [%]"), say("difference [deg]")),
            (x, _column(own, "low"), _column(own, "high")),
            ((x, _column(own, "difference"), "#1c1d20"),),
            levels=((0.0, False),),
            marked=_stretches(x, own["significant"].fillna(False).to_numpy(bool)),
        )
        found.append(Drawn(words, plot))
    return found


def _corrected_text(p: float) -> str:
    """The p of a curve, corrected over joints and angles; NaN is no test."""
    return say(", not tested") if np.isnan(p) else say(", {p_text} over all joint angles", p_text=p_text(p))


def _stretches(x: Array, chosen: Array) -> tuple[tuple[float, float], ...]:
    """From where to where consecutive points are chosen."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    return tuple((float(x[a]), float(x[b - 1])) for a, b in edges.reshape(-1, 2))


def agreement_plots(movement: Movement) -> list[Drawn]:
    """Bland-Altman: differences between consecutive sessions over their means, of what moved most."""
    rows = movement.reliability
    rows = rows[(rows["quantity"] == RANGE) & (rows["across"] == "session") & rows["bias"].notna()]
    found = []
    for joint, angle in movement.leading_angles:
        for _, row in rows[rows["of"] == f"{joint} {angle}"].iterrows():
            first, second = _consecutive(movement, joint, angle, str(row["hand"]), str(row["task"]))
            words = f"{of_text(str(row['of']))}, {place_text((str(row['hand']), str(row['task'])))}"
            limits = [(float(row[name]), True) for name in ("loa_low", "loa_high")]
            plot = XYPlot(
                say("Agreement of sessions: {words}", words=words),
                (say("mean of two sessions [deg]"), say("difference [deg]")),
                points=((first + second) / 2, second - first),
                levels=((float(row["bias"]), False), *(each for each in limits if np.isfinite(each[0]))),
            )
            found.append(Drawn(say("{words}, n = {n}", words=words, n=int(row["n"])), plot))
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
