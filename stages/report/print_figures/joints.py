"""A study's figures with an axis of joints or bones: errors against the truth, trust, and lengths."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from schemas.study import Hand
from schemas.verdict import CARE_TIMES
from stages.report.belief import BELIEVED, CARE, NOT, belief, wanted_text
from stages.report.comparison.answers import Answer, answer, observations
from stages.report.comparison.questions import JOINT_ERROR, PRIOR
from stages.report.palette import AMBER, NO, SOFT, Look, model_looks
from stages.report.print_figures.drawing import NoDataError, count_range, study_text
from stages.report.print_figures.models import missing_text_of
from stages.report.print_figures.style import (
    FEWEST_FOR_QUARTILES,
    MANY,
    TWO_COLUMNS_MM,
    Array,
    dots,
    error_axis,
    headings,
    label,
    new_figure,
    scattered,
    stacked,
    summary,
)
from stages.report.study_results import StudyResults
from stages.report.table_cells import alike, listed
from stages.report.wording import mark, say, word

if TYPE_CHECKING:
    import pandas as pd


def joints_in_order(results: StudyResults, joints: Collection[str]) -> list[str]:
    """Those joints digit by digit, then what belongs to no digit, then what no layout names."""
    layouts = results.layouts.values()
    of_digits = [joint for layout in layouts for digit in layout.digits.values() for joint in digit.joints]
    others = [joint for layout in layouts for joint in layout.joints]
    known = dict.fromkeys([*of_digits, *others, *sorted(joints)])
    return [joint for joint in known if joint in joints]


def draw_joint_axis(axes: Axes, joints: Sequence[str]) -> None:
    """A name a joint, upright."""
    axes.set_xlim(-0.6, len(joints) - 0.4)
    axes.set_xticks(range(len(joints)), [label(word(joint)) for joint in joints], rotation=90)
    axes.tick_params(axis="x", length=0)


_ERRORS_MM, _ALL_MM, _JOINTS_MM = 34.0, 190.0, 30.0


@dataclass
class _OfModel:
    """Errors and stated errors of one model, by joint and then by subject and hand."""

    error_mm: dict[str, dict[tuple[str, str], float]] = field(default_factory=lambda: defaultdict(dict))
    sd_mm: dict[str, dict[tuple[str, str], float]] = field(default_factory=lambda: defaultdict(dict))


def joint_errors(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a model; models with equal joints share one. Raises NoDataError without a truth."""
    own = answer(results, JOINT_ERROR)
    if own is None:
        raise NoDataError(
            say("the true joints are not known, or no model has a joint that could be compared")
        )
    sd = replace(JOINT_ERROR, metric="sd_mm")
    found = _by_model(own.seen, observations(results, sd, own.models, held_out=own.held_out))
    prior = found.pop(PRIOR, _OfModel())
    groups = alike({model: found[model] for model in own.models if model in found})
    joints = joints_in_order(results, {joint for each in found.values() for joint in each.error_mm})
    figure = new_figure(TWO_COLUMNS_MM, _JOINTS_MM + min(_ALL_MM, _ERRORS_MM * len(groups)))
    panels = stacked(figure, len(groups), sharex=True)
    look = model_looks(list(results.models))
    top = max(max(of.values()) for each in found.values() for of in each.error_mm.values())
    for models, axes in zip(groups, panels, strict=True):
        _error_panel(axes, joints, found[models[0]], prior, look[models[0]])
        error_axis(axes, _drawn([*found.values(), prior], top))
        axes.set_ylabel(say("Joint error [mm]"))
        draw_joint_axis(axes, joints)
    counts = [count_range(len(of) for of in found[models[0]].error_mm.values()) for models in groups]
    headings(
        panels,
        [
            label(say("{own}; n = {n} hands", own=listed(own), n=n))
            for own, n in zip(groups, counts, strict=True)
        ],
    )
    figure.legend(handles=_handles(), loc="outside lower center", ncols=4)
    return figure, _error_caption(results, own)


def _by_model(errors: pd.DataFrame, stated: pd.DataFrame) -> dict[str, _OfModel]:
    found: dict[str, _OfModel] = defaultdict(_OfModel)
    for kind, rows in (("error_mm", errors), ("sd_mm", stated)):
        for each in rows.dropna(subset="value").itertuples():
            hand, joint = each.place.rsplit(" hand, ", 1)
            getattr(found[each.model], kind)[joint][each.subject, hand] = each.value
    return found


def _error_panel(axes: Axes, joints: list[str], own: _OfModel, prior: _OfModel, look: Look) -> None:
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
        Line2D([], [], color="0.3", marker="o", markersize=1.8, linestyle="none", label=say("hand")),
        Line2D([], [], color="0.3", marker="o", linewidth=1.4, label=say("median, quartiles")),
        Line2D([], [], color="black", label=say("stated 1-sigma error, median")),
        Line2D([], [], color=SOFT, linestyle=(0, (1, 1)), label=say("{PRIOR}, median", PRIOR=PRIOR)),
    ]


def _error_caption(results: StudyResults, own: Answer) -> str:
    return (
        say(
            (
                "Error of every joint centre, model by model. {study_text} Distance to the true centre "
                "in the child receiver's frame [mm]. A dot is a hand; mark: median; bar: quartiles, from "
                "{FEWEST_FOR_QUARTILES} hands on; black line: median of the stated 1-sigma error in "
                "three dimensions (outside the scale where it is larger than every error); dotted line: "
                "median of prior-only, the hand that anatomy expects. Models with equal joints share a "
                "panel. {kind} {missing_text_of}"
            ),
            study_text=study_text(results),
            FEWEST_FOR_QUARTILES=FEWEST_FOR_QUARTILES,
            kind=own.kind,
            missing_text_of=missing_text_of(own),
        )
    ).rstrip()


_TRUST_MM = 24.0
_ABSENT = mark("no result")
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
        raise NoDataError(say("no hand of this study has a joint"))
    groups = alike(found)
    joints = joints_in_order(results, {joint for of in found.values() for joint in of})
    figure = new_figure(TWO_COLUMNS_MM, _JOINTS_MM + _TRUST_MM * len(groups))
    panels = stacked(figure, len(groups), sharex=True)
    n = len(results.hands)
    for models, axes in zip(groups, panels, strict=True):
        _trust_panel(axes, joints, found[models[0]], results.hands)
        draw_joint_axis(axes, joints)
    headings(panels, [label(say("{models}; n = {n} hands", models=listed(models), n=n)) for models in groups])
    handles = [
        Patch(
            label=say(kind).lstrip("✓◆✕ \u00a0"),
            edgecolor="black",
            linewidth=0.4,
            facecolor=fill,
            hatch=hatch,
        )
        for kind, (fill, hatch) in KINDS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, title=say("Believe it?"))
    return figure, (
        say(
            (
                "Which joints to believe: share of the study's hands [%] in which a joint is to be "
                "believed (its centre is known to {wanted} mm or better, 1 sigma in three dimensions, and "
                "nothing contradicts that), with care (to {care} mm, or something is against it), not "
                "(known less well still, contradicted, suspect, or failed), or has no result. "
                "{study_text} Made from all of the model's calibration recordings. Models that agree "
                "share a panel. A joint that a model does not have has no bar."
            ),
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


def _trust_panel(axes: Axes, joints: list[str], found: _Beliefs, hands: Sequence[Hand]) -> None:
    own = [place for place, joint in enumerate(joints) if joint in found]
    foot = np.zeros(len(own))
    for kind, (fill, hatch) in KINDS.items():
        counts = [sum(found[joints[place]].get(hand, _ABSENT) == kind for hand in hands) for place in own]
        share = 100.0 * np.array(counts) / len(hands)
        axes.bar(
            own,
            share,
            0.8,
            foot,
            edgecolor="black",
            linewidth=0.4,
            label=say(kind),
            facecolor=fill,
            hatch=hatch,
        )
        foot += share
    axes.set_ylim(0.0, 100.0)
    axes.set_yticks([0, 50, 100])
    axes.set_ylabel(say("Hands [%]"))


_LENGTHS_MM, _BONES_MM = 58.0, 26.0
_Lengths = dict[str, dict[Hand, tuple[float, float]]]
"""By bone, then by hand: length and its 1-sigma error, mm."""


def bone_lengths(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a fitted model. Raises NoDataError where no hand was fitted as a whole."""
    found = {model: of for model in results.fitted if (of := _lengths(results, model))}
    if not found:
        raise NoDataError(
            say("only a model that fits the whole hand states the bones themselves, and ")
            + (
                say("none of its hands has lengths")
                if results.fitted
                else say("this study has no such model")
            )
        )
    bones = list(dict.fromkeys(bone for of in found.values() for bone in of))
    figure = new_figure(TWO_COLUMNS_MM, _BONES_MM + _LENGTHS_MM * len(found))
    panels = stacked(figure, len(found), sharex=True)
    look = model_looks(list(results.models))
    for (model, of), axes in zip(found.items(), panels, strict=True):
        _length_panel(axes, bones, of, look[model])
    counts = [count_range(len(hands) for hands in of.values()) for of in found.values()]
    headings(
        panels,
        [label(say("{own}; n = {n} hands", own=own, n=n)) for own, n in zip(found, counts, strict=True)],
    )
    panels[-1].set_xticks(range(len(bones)), [label(word(bone)) for bone in bones], rotation=90)
    many = any(len(hands) > MANY for of in found.values() for hands in of.values())
    marks = (
        say("A dot is a hand (coloured: right, grey: left); {stated}", stated=_stated(found))
        if many
        else say("A mark is a hand (filled: right, open: left), the bar its stated 1-sigma error")
    )
    return figure, (
        say(
            (
                "Bone lengths of fitted hands [mm]. {study_text} {marks}. Joint to joint, the last bone "
                "of a digit to its end. Where the model shares lengths between a person's hands, the two "
                "are not independent."
            ),
            study_text=study_text(results),
            marks=marks,
        )
    )


def _stated(found: dict[str, _Lengths]) -> str:
    errors = [sd for of in found.values() for hands in of.values() for _, sd in hands.values()]
    return say("median of the stated 1-sigma errors: {errors:.2f} mm", errors=np.nanmedian(errors))


def _lengths(results: StudyResults, model: str) -> _Lengths:
    """Lengths of the bones of a model that fits the whole hand; of any other none."""
    found: _Lengths = defaultdict(dict)
    for (hand, name), rows in results.bones_of.items():
        for row in rows:
            if name == model and row["length_mm"] is not None:
                sd = row["sd_mm"]
                found[row["bone"]][hand] = (row["length_mm"], np.nan if sd is None else sd)
    return dict(found)


def _length_panel(axes: Axes, bones: list[str], lengths: _Lengths, look: Look) -> None:
    hands = list(dict.fromkeys(hand for of in lengths.values() for hand in of))
    step = dict(zip(hands, _aside(hands), strict=True))
    for place, bone in enumerate(bones):
        for side, filled in (("right", True), ("left", False)):
            of = {hand: pair for hand, pair in lengths.get(bone, {}).items() if hand.hand == side}
            if of:
                x = place + np.array([step[hand] for hand in of])
                length, sd = np.array(list(of.values())).T
                if len(hands) > MANY:
                    dots(axes, x, length, look.colour if filled else "0.35")
                    continue
                axes.vlines(x, length - sd, length + sd, color=look.colour, linewidth=0.5)
                axes.plot(
                    x, length, "o", color=look.colour, markersize=2.4, linestyle="none",
                    markerfacecolor=look.colour if filled else "white", markeredgewidth=0.5,
                )  # fmt: skip
    axes.set_xlim(-0.6, len(bones) - 0.4)
    axes.set_ylim(0.0, 1.06 * max(length for of in lengths.values() for length, _ in of.values()))
    axes.set_ylabel(say("Bone length [mm]"))
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y")


def _aside(hands: list[Hand]) -> list[float]:
    """Subjects side by side, their two hands next to each other."""
    return [float(step) for step in np.sort(scattered(len(hands), 0.72))]
