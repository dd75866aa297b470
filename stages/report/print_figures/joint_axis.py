"""A horizontal axis of joints: every layout's order, digits apart."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from matplotlib.axes import Axes

from stages.report.print_figures.style import label
from stages.report.study_results import StudyResults


def joints_in_order(results: StudyResults, joints: Collection[str]) -> list[str]:
    """Those joints digit by digit, then what belongs to no digit, then what no layout names."""
    layouts = results.layouts.values()
    of_digits = [joint for layout in layouts for digit in layout.digits.values() for joint in digit.joints]
    others = [joint for layout in layouts for joint in layout.joints]
    known = dict.fromkeys([*of_digits, *others, *sorted(joints)])
    return [joint for joint in known if joint in joints]


def alike(found: Mapping[str, object]) -> list[list[str]]:
    """Names in groups of equal values, in their order."""
    groups: list[list[str]] = []
    for name, own in found.items():
        same = next((group for group in groups if found[group[0]] == own), None)
        groups.append([name]) if same is None else same.append(name)
    return groups


def draw_joint_axis(axes: Axes, joints: Sequence[str]) -> None:
    """A name a joint, upright."""
    axes.set_xlim(-0.6, len(joints) - 0.4)
    axes.set_xticks(range(len(joints)), [label(joint) for joint in joints], rotation=90)
    axes.tick_params(axis="x", length=0)
