"""Simulated studies: how far every joint is from the true one, beside the error that the model states."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from stages.draw_figures.drawing import NoDataError
from stages.draw_figures.joint_axis import draw_joint_axis, joints_in_order
from stages.draw_figures.judging import PRIOR, Judge, gaps_in_words, judges
from stages.draw_figures.marks import (
    FEWEST_FOR_QUARTILES,
    Array,
    dots,
    error_axis,
    scattered,
    summary,
)
from stages.draw_figures.style import GREY, TWO_COLUMNS_MM, Look, headings, label, looks, new_figure, stacked
from stages.draw_figures.words import n_in_words, whose
from stages.report.comparison import Metric, Observation, observed
from stages.report.data_table import listed
from stages.report.study_results import StudyResults

_STATED = Metric("sd_mm", "joint_errors", "the stated error is")
_PANEL_MM, _ALL_MM, _FOOT_MM = 34.0, 190.0, 30.0


@dataclass
class _OfModel:
    """Errors and stated errors of one model, by joint and then by subject and hand."""

    error_mm: dict[str, dict[tuple[str, str], float]] = field(default_factory=lambda: defaultdict(dict))
    sd_mm: dict[str, dict[tuple[str, str], float]] = field(default_factory=lambda: defaultdict(dict))


def joint_errors(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a model; models with equal joints share one. Raises NoDataError without a truth."""
    judge = next((each for each in judges(results) if each.metric.name == "error_mm"), None)
    if judge is None:
        raise NoDataError("the true joints are not known, or no model has a joint that could be compared")
    observations = observed(results, judge.metric, (*judge.models, PRIOR), held_out=judge.held_out)
    stated = observed(results, _STATED, judge.models, held_out=judge.held_out)
    found = _by_model(observations, stated)
    prior = found.pop(PRIOR, _OfModel())
    groups = _alike({model: found[model] for model in judge.models if model in found})
    joints = joints_in_order(results, {joint for each in found.values() for joint in each.error_mm})
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + min(_ALL_MM, _PANEL_MM * len(groups)))
    panels = stacked(figure, len(groups), sharex=True)
    look = looks(list(results.models))
    top = max(max(of.values()) for each in found.values() for of in each.error_mm.values())
    for models, axes in zip(groups, panels, strict=True):
        _panel(axes, joints, found[models[0]], prior, look[models[0]])
        error_axis(axes, _drawn([*found.values(), prior], top))
        axes.set_ylabel("Joint error [mm]")
        draw_joint_axis(axes, joints)
    counts = [n_in_words(len(of) for of in found[models[0]].error_mm.values()) for models in groups]
    headings(panels, [label(f"{listed(own)}; n = {n} hands") for own, n in zip(groups, counts, strict=True)])
    figure.legend(handles=_handles(), loc="outside lower center", ncols=4)
    return figure, _caption(results, judge, observations)


def _by_model(observations: list[Observation], stated: list[Observation]) -> dict[str, _OfModel]:
    found: dict[str, _OfModel] = defaultdict(_OfModel)
    for kind, rows in (("error_mm", observations), ("sd_mm", stated)):
        for each in rows:
            if each.value is not None:
                hand, joint = each.place.split(" hand, ", 1)
                getattr(found[each.model], kind)[joint][each.subject, hand] = each.value
    return found


def _alike(found: dict[str, _OfModel]) -> list[list[str]]:
    """Models in groups whose joints are equal, in the study's order."""
    groups: list[list[str]] = []
    for model, own in found.items():
        same = next((group for group in groups if found[group[0]] == own), None)
        if same is None:
            groups.append([model])
        else:
            same.append(model)
    return groups


def _panel(axes: Axes, joints: list[str], own: _OfModel, prior: _OfModel, look: Look) -> None:
    hands = dict.fromkeys(hand for of in own.error_mm.values() for hand in of)
    aside = dict(zip(hands, scattered(len(hands), 0.5), strict=True))
    for place, joint in enumerate(joints):
        errors = own.error_mm.get(joint, {})
        if errors:
            values = np.array(list(errors.values()))
            dots(axes, place + np.array([aside[hand] for hand in errors]), values, look.colour)
            summary(axes, place, values, look, look.size + 0.5)
        for of, colour, style in ((own.sd_mm, "black", "-"), (prior.error_mm, GREY, (0, (1, 1)))):
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
        Line2D([], [], color=GREY, linestyle=(0, (1, 1)), label=f"{PRIOR}, median"),
    ]


def _caption(results: StudyResults, judge: Judge, observations: list[Observation]) -> str:
    return (
        f"Error of every joint centre, model by model. {whose(results)} Distance to the true centre in the "
        "child receiver's frame [mm]. A dot is a hand; mark: median; bar: quartiles, from "
        f"{FEWEST_FOR_QUARTILES} hands on; black line: median of the stated 1-sigma error in three "
        "dimensions (outside the scale where it is larger than every error); dotted line: median of "
        f"prior-only, the hand that anatomy expects. Models with equal joints share a panel. {judge.kind} "
        f"{gaps_in_words(observations, judge.models)}"
    ).rstrip()
