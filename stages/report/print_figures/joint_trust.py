"""How many hands have each joint: as it should be, doubtful, failed, or not at all."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from schemas.study import Hand
from stages.report.palette import HUES
from stages.report.print_figures.caption_text import study_text
from stages.report.print_figures.drawing import NoDataError
from stages.report.print_figures.joint_axis import alike, draw_joint_axis, joints_in_order
from stages.report.print_figures.style import TWO_COLUMNS_MM, headings, label, new_figure, stacked
from stages.report.study_results import StudyResults
from stages.report.table_cells import listed

_PANEL_MM, _FOOT_MM = 24.0, 30.0
_ABSENT = "no result"
KINDS = {
    "ok": (HUES["sky"][0], ""),
    "weak": (HUES["amber"][0], "////"),
    "failed": (HUES["vermilion"][0], "xxxx"),
    _ABSENT: ("white", ""),
}
"""Fill and hatching."""

_Statuses = dict[str, dict[Hand, str]]
"""By joint, then by hand."""


def joint_trust(results: StudyResults) -> tuple[Figure, str]:
    """Draw a panel a model; models that agree share one. Raises NoDataError without any joint."""
    found = {model: of for model in results.models if (of := _statuses(results, model))}
    if not found:
        raise NoDataError("no hand of this study has a joint")
    groups = alike(found)
    joints = joints_in_order(results, {joint for of in found.values() for joint in of})
    figure = new_figure(TWO_COLUMNS_MM, _FOOT_MM + _PANEL_MM * len(groups))
    panels = stacked(figure, len(groups), sharex=True)
    n = len(results.hands)
    for models, axes in zip(groups, panels, strict=True):
        _panel(axes, joints, found[models[0]], results.hands)
        draw_joint_axis(axes, joints)
    headings(panels, [label(f"{listed(models)}; n = {n} hands") for models in groups])
    handles = [
        Patch(label=kind, edgecolor="black", linewidth=0.4, facecolor=fill, hatch=hatch)
        for kind, (fill, hatch) in KINDS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure, (
        f"How far the joints can be trusted: share of the study's hands [%] in which a joint is ok, weak "
        f"(its error is large or an assumption does not hold), failed or without a result. "
        f"{study_text(results)} "
        "Made from all of the model's calibration recordings. Models that agree share a panel. A joint that "
        "a model does not have has no bar."
    )


def _statuses(results: StudyResults, model: str) -> _Statuses:
    found: _Statuses = defaultdict(dict)
    for (hand, name), rows in results.joints_of.items():
        for row in rows:
            if name == model:
                found[row["joint"]][hand] = row["status"]
    return dict(found)


def _panel(axes: Axes, joints: list[str], found: _Statuses, hands: Sequence[Hand]) -> None:
    own = [place for place, joint in enumerate(joints) if joint in found]
    foot = np.zeros(len(own))
    for kind, (fill, hatch) in KINDS.items():
        counts = [sum(found[joints[place]].get(hand, _ABSENT) == kind for hand in hands) for place in own]
        share = 100.0 * np.array(counts) / len(hands)
        axes.bar(
            own, share, 0.8, foot, edgecolor="black", linewidth=0.4, label=kind, facecolor=fill, hatch=hatch
        )
        foot += share
    axes.set_ylim(0.0, 100.0)
    axes.set_yticks([0, 50, 100])
    axes.set_ylabel("Hands [%]")
