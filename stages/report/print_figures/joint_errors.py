"""Simulated studies: how far every joint is from the true one, beside the error that the model states."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stages.report.comparison.answers import Answer, answer
from stages.report.comparison.observations import observations
from stages.report.comparison.questions import JOINT_ERROR, PRIOR
from stages.report.palette import SOFT, Look, model_looks
from stages.report.print_figures.caption_text import count_range, study_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.joint_axis import alike, draw_joint_axis, joints_in_order
from stages.report.print_figures.judging import gap_text, kind_text
from stages.report.print_figures.marks import (
    FEWEST_FOR_QUARTILES,
    Array,
    dots,
    error_axis,
    scattered,
    summary,
)
from stages.report.print_figures.style import TWO_COLUMNS_MM, headings, label, new_figure, stacked
from stages.report.study_results import StudyResults
from stages.report.table_cells import listed

if TYPE_CHECKING:
    import pandas as pd

_PANEL_MM, _ALL_MM, _FOOT_MM = 34.0, 190.0, 30.0


@dataclass
class _OfModel:
    """Errors and stated errors of one model, by joint and then by subject and hand."""

    error_mm: dict[str, dict[tuple[str, str], float]] = field(default_factory=lambda: defaultdict(dict))
    sd_mm: dict[str, dict[tuple[str, str], float]] = field(default_factory=lambda: defaultdict(dict))


def joint_errors(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a model; models with equal joints share one. Raises NoDataError without a truth."""
    own = answer(results, JOINT_ERROR)
    if own is None:
        raise NoDataError("the true joints are not known, or no model has a joint that could be compared")
    sd = replace(JOINT_ERROR, metric="sd_mm")
    found = _by_model(own.seen, observations(results, sd, own.models, held_out=own.held_out))
    prior = found.pop(PRIOR, _OfModel())
    groups = alike({model: found[model] for model in own.models if model in found})
    joints = joints_in_order(results, {joint for each in found.values() for joint in each.error_mm})
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + min(_ALL_MM, _PANEL_MM * len(groups)))
    panels = stacked(figure, len(groups), sharex=True)
    look = model_looks(list(results.models))
    top = max(max(of.values()) for each in found.values() for of in each.error_mm.values())
    for models, axes in zip(groups, panels, strict=True):
        _panel(axes, joints, found[models[0]], prior, look[models[0]])
        error_axis(axes, _drawn([*found.values(), prior], top))
        axes.set_ylabel("Joint error [mm]")
        draw_joint_axis(axes, joints)
    counts = [count_range(len(of) for of in found[models[0]].error_mm.values()) for models in groups]
    headings(panels, [label(f"{listed(own)}; n = {n} hands") for own, n in zip(groups, counts, strict=True)])
    figure.legend(handles=_handles(), loc="outside lower center", ncols=4)
    return figure, _caption(results, own)


def _by_model(errors: pd.DataFrame, stated: pd.DataFrame) -> dict[str, _OfModel]:
    found: dict[str, _OfModel] = defaultdict(_OfModel)
    for kind, rows in (("error_mm", errors), ("sd_mm", stated)):
        for each in rows.dropna(subset="value").itertuples():
            hand, joint = each.place.split(" hand, ", 1)
            getattr(found[each.model], kind)[joint][each.subject, hand] = each.value
    return found


def _panel(axes: Axes, joints: list[str], own: _OfModel, prior: _OfModel, look: Look) -> None:
    hands = dict.fromkeys(hand for of in own.error_mm.values() for hand in of)
    aside = dict(zip(hands, scattered(len(hands), 0.5), strict=True))
    for place, joint in enumerate(joints):
        errors = own.error_mm.get(joint, {})
        if errors:
            values = np.array(list(errors.values()))
            dots(axes, place + np.array([aside[hand] for hand in errors]), values, look.colour)
            summary(axes, place, values, look, look.size + 0.5)
        for of, colour, style in ((own.sd_mm, "black", "-"), (prior.error_mm, SOFT, (0, (1, 1)))):
            if of.get(joint):
                median = float(np.median(list(of[joint].values())))
                axes.plot([place - 0.38, place + 0.38], [median, median], color=colour, linestyle=style)


def _drawn(found: list[_OfModel], top: float) -> list[Array]:
    """All that one scale must hold: every error, and the medians of stated ones that are no larger."""
    errors = [np.array(list(of.values())) for each in found for of in each.error_mm.values() if of]
    stated = [np.median(list(of.values())) for each in found for of in each.sd_mm.values()]
    return [*errors, np.array([median for median in stated if median <= top])]


def _handles() -> list[Line2D]:
    return [
        Line2D([], [], color="0.3", marker="o", markersize=1.8, linestyle="none", label="hand"),
        Line2D([], [], color="0.3", marker="o", linewidth=1.4, label="median, quartiles"),
        Line2D([], [], color="black", label="stated 1-sigma error, median"),
        Line2D([], [], color=SOFT, linestyle=(0, (1, 1)), label=f"{PRIOR}, median"),
    ]


def _caption(results: StudyResults, own: Answer) -> str:
    return (
        f"Error of every joint centre, model by model. {study_text(results)} Distance to the true "
        f"centre in the "
        "child receiver's frame [mm]. A dot is a hand; mark: median; bar: quartiles, from "
        f"{FEWEST_FOR_QUARTILES} hands on; black line: median of the stated 1-sigma error in three "
        "dimensions (outside the scale where it is larger than every error); dotted line: median of "
        f"prior-only, the hand that anatomy expects. Models with equal joints share a panel. "
        f"{kind_text(own.held_out)} "
        f"{gap_text(own.seen, own.models)}"
    ).rstrip()
