"""Compute the cost of each receiver left out of a task, and of each smaller layout that ships, before anyone
tries.

How well receivers place a hand in a posture follows from where they sit and what the fit leaves open,
whatever they would have measured. So postures of a task are taken as posed, receivers where the hand then has
them, and the sd of every centre and angle is found with only some of them worn (`frame_uncertainty`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from shukotsu.schemas.config_files import shipped
from shukotsu.schemas.layout import Layout, read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fingertips import Fingertips
from shukotsu.stages.fit_hand.fitted_motion import pose_hand
from shukotsu.stages.fit_hand.frame_uncertainty import (
    BoneErrors,
    Postures,
    errors_with,
    measured_as_posed,
    posed_frames,
)

FRAMES = 24
"""Of a task, evenly spaced: as many postures as an opposition with every finger has phases, and some."""

LEAST_RECEIVERS = 2

Row = dict[str, Any]


def receiver_costs(tips: Fingertips, task: Poses) -> list[Row]:
    """Give rows of receiver_costs: a task without one receiver of the calibration or another, first with all,
    then the dearest first, then layouts that ship. Empty for a hand whose anatomy is not known.

    task : some FRAMES frames of it.
    """
    fit = tips.fit
    posed = pose_hand(fit, task)
    rows = np.flatnonzero(posed.posed)
    worn = [s for s in fit.evidence.model.receivers if np.isfinite(fit.residual_rms[s][0])]
    if not tips.digits or not len(rows):
        return []
    postures = Postures.of(tips, posed_frames(posed, rows))
    frames = measured_as_posed(postures)
    options: list[tuple[str, str, Sequence[str]]] = [("", "", worn)]
    options += [(left_out, "", [s for s in worn if s != left_out]) for left_out in worn]
    options += [("", layout.name, layout.expected) for layout in _smaller(fit.evidence.layout, worn)]
    known = [option for option in options if len(option[2]) >= LEAST_RECEIVERS]
    errors = [errors_with(postures, frames, receivers) for *_, receivers in known]
    costs = [
        _cost(tips, without, layout, len(receivers), own, errors[0])
        for (without, layout, receivers), own in zip(known, errors, strict=True)
    ]
    return sorted(costs, key=lambda cost: (bool(cost["without"]) + 2 * bool(cost["layout"]), -_order(cost)))


def _order(cost: Row) -> float:
    return float(cost["n_receivers"] if cost["layout"] else cost["flexion_sd_deg"])


def _smaller(layout: Layout, worn: Sequence[str]) -> list[Layout]:
    """Layouts that ship, of the same bodies, that wear some of these receivers and no other."""
    layouts = [read_layout(name) for name in shipped("layout")]
    return [own for own in layouts if own.is_as(layout) and set(own.expected) < set(worn)]


def _cost(
    tips: Fingertips, without: str, layout: str, n_receivers: int, errors: BoneErrors, with_all: BoneErrors
) -> Row:
    evidence = tips.fit.evidence
    bones = evidence.model.length
    joints = [joint for digit in evidence.layout.digits.values() for joint in digit.joints]
    segment_of = {joint.name: joint.child for joint in evidence.layout.joints.values()}
    moving = [joint for joint in joints if joint in errors.angles_deg]
    places = [1 + list(bones).index(segment_of[joint]) for joint in moving]
    centre = _rms(errors.centre_mm[:, places])
    flexion, before = (
        _rms(np.stack([own.angles_deg[joint][:, 0] for joint in moving], 1)) for own in (errors, with_all)
    )
    worst = int(np.argmax(flexion - before)) if without or layout else int(np.argmax(flexion))
    return {
        "without": without,
        "layout": layout,
        "n_receivers": n_receivers,
        "centre_sd_mm": float(_rms(centre)),
        "flexion_sd_deg": float(_rms(flexion)),
        "joint": moving[worst],
        "joint_centre_sd_mm": float(centre[worst]),
        "joint_flexion_sd_deg": float(flexion[worst]),
    }


def _rms(values: Array) -> Array:
    """Root mean square over the first dimension."""
    return np.asarray(np.sqrt((values**2).mean(0)))
