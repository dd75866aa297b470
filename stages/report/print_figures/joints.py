"""A study's figures with an axis of joints or bones: errors against the truth, trust, and lengths."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from shukotsu.schemas.study import Hand
from shukotsu.schemas.verdict import CARE_TIMES
from shukotsu.sentences.translation import N_, listed, tr, word
from shukotsu.stages.report.belief import BELIEVED, CARE, NOT, belief, wanted_text
from shukotsu.stages.report.judged_models import PRIOR, TRUTH, JudgedModels, judged_models
from shukotsu.stages.report.palette import AMBER, INK, NO, SOFT, Look, model_looks
from shukotsu.stages.report.plots.panels import Panel, in_rows, print_figure
from shukotsu.stages.report.plots.rows import (
    FEWEST_FOR_QUARTILES,
    FOOT_MM,
    ROW_MM,
    Group,
    Row,
    Scale,
    draw_rows,
    row_axes,
    value_scale,
)
from shukotsu.stages.report.print_figures.drawing import NoDataError, count_range, study_text
from shukotsu.stages.report.study_results import StudyResults, hand_of
from shukotsu.stages.report.table_cells import alike


def joints_in_order(results: StudyResults, joints: Collection[str]) -> list[str]:
    """Those joints digit by digit, then what belongs to no digit, then what no layout names."""
    layouts = results.layouts.values()
    of_digits = [joint for layout in layouts for digit in layout.digits.values() for joint in digit.joints]
    others = [joint for layout in layouts for joint in layout.joints]
    known = dict.fromkeys([*of_digits, *others, *sorted(joints)])
    return [joint for joint in known if joint in joints]


_ACROSS = 3


@dataclass
class _OfModel:
    """Errors and stated errors of one model, by joint and then by hand."""

    error_mm: dict[str, dict[Hand, float]] = field(default_factory=lambda: defaultdict(dict))
    sd_mm: dict[str, dict[Hand, float]] = field(default_factory=lambda: defaultdict(dict))


def joint_errors(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a model; models with equal joints share one. Raises NoDataError without a truth."""
    own = next((each for each in judged_models(results) if each.metric == TRUTH), None)
    if own is None:
        raise NoDataError(tr("the true joints are not known, or no model has a joint that could be compared"))
    found = _by_model(results, own)
    prior = found.pop(PRIOR, _OfModel())
    groups = alike({model: found[model] for model in results.models if model in found})
    joints = joints_in_order(results, {joint for each in found.values() for joint in each.error_mm})
    looks = model_looks(list(results.models))
    every = [
        error for each in (*found.values(), prior) for of in each.error_mm.values() for error in of.values()
    ]
    scale = value_scale(every)
    panels = []
    for models in groups:
        errors = found[models[0]]
        n = count_range(len(of) for of in errors.error_mm.values())
        heading = tr("{own}; n = {n} hands", own=listed(models), n=n)
        draw = partial(
            _draw_errors, joints=joints, look=looks[models[0]], errors=errors, prior=prior, scale=scale
        )
        panels.append(Panel(heading, heading, ROW_MM * len(joints), FOOT_MM, draw))
    handles = [
        Line2D([], [], color=colour, marker=marker, ls=cast(Any, style), alpha=alpha, label=words)
        for colour, marker, style, alpha, words in (
            (SOFT, "o", "none", 0.6, tr("hand")),
            (SOFT, "o", "-", 1.0, tr("median, quartiles")),
            (INK, "|", "none", 1.0, tr("stated 1-sigma error, median")),
            (SOFT, "|", "none", 1.0, tr("{PRIOR}, median", PRIOR=PRIOR)),
        )
    ]
    return print_figure(in_rows(panels, _ACROSS), handles), _error_caption(results, own)


_SKELETON = ("subject", "session", "hand", "model", "calibrated_on")


def _by_model(results: StudyResults, own: JudgedModels) -> dict[str, _OfModel]:
    """Means over the skeletons that the answer is of, held out or not, of a hand's joint."""
    scored = {
        tuple(row[name] for name in _SKELETON) for row in results.scores if row["held_out"] == own.held_out
    }
    values: dict[tuple[str, str, str, Hand], list[float]] = defaultdict(list)
    for row in results.counted(results.joint_errors):
        if row["model"] in own.references or tuple(row[name] for name in _SKELETON) in scored:
            for kind in ("error_mm", "sd_mm"):
                if row[kind] is not None:
                    values[kind, row["model"], row["joint"], hand_of(row)].append(row[kind])
    found: dict[str, _OfModel] = defaultdict(_OfModel)
    for (kind, model, joint, hand), numbers in values.items():
        getattr(found[model], kind)[joint][hand] = float(np.mean(numbers))
    return found


def _draw_errors(
    axes: Axes, joints: Sequence[str], look: Look, errors: _OfModel, prior: _OfModel, scale: Scale
) -> None:
    """Draw every joint's errors by hand, crossed at the medians of the stated error and of anatomy's."""
    rows = tuple(
        Row(joint, look, {_name(hand): error for hand, error in errors.error_mm.get(joint, {}).items()})
        for joint in joints
    )
    draw_rows(axes, tr("Joint error [mm]"), scale, (Group("", rows),))
    for of_joint, colour, style in ((errors.sd_mm, INK, "solid"), (prior.error_mm, SOFT, "dotted")):
        for y, joint in enumerate(joints):
            if of_joint.get(joint):
                level = np.median(list(of_joint[joint].values()))
                axes.vlines(level, y - 0.4, y + 0.4, color=colour, linestyle=style, linewidth=0.8)


def _error_caption(results: StudyResults, own: JudgedModels) -> str:
    return tr(
        "Error of every joint centre, model by model. {study_text} Distance to the true centre "
        "in the child receiver's frame [mm]. A dot is a hand; mark: median; bar: quartiles, from "
        "{FEWEST_FOR_QUARTILES} hands on; black line: median of the stated 1-sigma error in "
        "three dimensions (outside the scale where it is larger than every error); dotted line: "
        "median of prior-only, the hand that anatomy expects. Models with equal joints share a "
        "panel. {kind}.",
        study_text=study_text(results),
        FEWEST_FOR_QUARTILES=FEWEST_FOR_QUARTILES,
        kind=tr("Held out") if own.held_out else tr("In-sample"),
    )


_ABSENT = N_("no result")
KINDS = {
    BELIEVED: ("0.45", ""),
    CARE: (AMBER, "////"),
    NOT: (NO, "xxxx"),
    _ABSENT: ("white", ""),
}
"""Fill and hatching."""

_Beliefs = dict[str, dict[Hand, str]]
"""By joint, then by hand."""


def joint_trust(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a model; models that agree share one. Raises NoDataError without any joint."""
    found = {model: of for model in results.models if (of := _beliefs(results, model))}
    if not found:
        raise NoDataError(tr("no hand of this study has a joint"))
    groups = alike(found)
    joints = joints_in_order(results, {joint for of in found.values() for joint in of})
    panels = []
    for models in groups:
        heading = tr("{models}; n = {n} hands", models=listed(models), n=len(results.hands))
        draw = partial(_draw_trust, joints=joints, beliefs=found[models[0]], hands=results.hands)
        panels.append(Panel(heading, heading, ROW_MM * len(joints), FOOT_MM, draw))
    handles = [
        Patch(label=tr(kind).lstrip("✓◆✕ \u00a0"), facecolor=fill, hatch=hatch, edgecolor=INK, linewidth=0.4)
        for kind, (fill, hatch) in KINDS.items()
    ]
    return print_figure(in_rows(panels, _ACROSS), handles), (
        tr(
            "Which joints to believe: share of the study's hands [%] in which a joint is to be "
            "believed (its centre is known to {wanted} mm or better, 1 sigma in three dimensions, and "
            "nothing contradicts that), with care (to {care} mm, or something is against it), not "
            "(known less well still, contradicted, suspect, or failed), or has no result. "
            "{study_text} Made from all of the model's calibration recordings. Models that agree "
            "share a panel. A joint that a model does not have has no bar.",
            wanted=wanted_text(results.layouts.values()),
            care=wanted_text(results.layouts.values(), CARE_TIMES),
            study_text=study_text(results),
        )
    )


def _beliefs(results: StudyResults, model: str) -> _Beliefs:
    found: _Beliefs = defaultdict(dict)
    for (hand, name), rows in results.joints_of.items():
        for row in rows:
            if name == model:
                found[row["joint"]][hand] = belief(row)
    return dict(found)


def _draw_trust(axes: Axes, joints: Sequence[str], beliefs: _Beliefs, hands: Sequence[Hand]) -> None:
    """Draw the shares of hands by what to believe of a joint; no bar where the model has no such."""
    row_axes(axes, [word(joint) for joint in joints], tr("Hands [%]"), Scale(0.0, 100.0))
    rows = [(y, beliefs[joint]) for y, joint in enumerate(joints) if joint in beliefs]
    foot = np.zeros(len(rows))
    for kind, (fill, hatch) in KINDS.items():
        shares = [100.0 * sum(of.get(hand, _ABSENT) == kind for hand in hands) / len(hands) for _, of in rows]
        axes.barh(
            [y for y, _ in rows], shares, 0.8, foot, facecolor=fill, hatch=hatch, edgecolor=INK, linewidth=0.4
        )
        foot += shares


def _name(hand: Hand) -> str:
    return f"{hand.who.token} {hand.hand}"
