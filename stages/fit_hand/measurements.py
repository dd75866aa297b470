"""What was measured on the hand itself: bones with a calliper, receivers against the joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from schemas.errors import InputError
from schemas.layout import Layout
from stages.fit_hand.building import Amount
from stages.fit_hand.chain import HandModel
from stages.fit_hand.normal_equations import Observations
from stages.fit_hand.recordings import Convention

PLANE_SD_MM = 2.0
"""Of a hinge's centre about the plane through its child's receiver: receivers are put on by eye."""


@dataclass(frozen=True)
class Measurement:
    """One measured length in mm with its 1-sigma error.

    quantity : a segment for its bone's length, joint to joint; or `segment.along`, `.lateral`, `.height` for
    the place of its receiver over the bone, from the centre of the bone's proximal joint: distally, towards
    the thumb, dorsally; or `segment.distal` for how far its receiver sits from the next joint.
    """

    quantity: str
    value_mm: float
    sd_mm: float


def observations(model: HandModel, measurements: Sequence[Measurement]) -> Observations:
    """Measurements as linear observations of the unknowns; InputError where one names nothing known."""
    rows, values = [], []
    for measured in measurements:
        amount = _amount(model, measured.quantity)
        row = np.zeros(len(model.unknowns.names))
        for coefficient, unknown in amount.parts:
            row[unknown] += coefficient
        rows.append(row / measured.sd_mm)
        values.append((measured.value_mm - amount.constant) / measured.sd_mm)
    return Observations(np.array(rows).reshape(-1, len(model.unknowns.names)), np.array(values))


def planes(model: HandModel, layout: Layout, convention: Convention) -> Observations:
    """Hinges without anatomy lie near the plane that the layout gives: nothing else says where on their axis.

    A joint that turns about more than one axis needs no plane. Planes that the layout gives in the parent's
    frame are left out: they are not a hinge's own.
    """
    rows, values = [], []
    for name, seat in model.seats.items():
        joint = layout.joints[name]
        if joint.dof != 1 or joint.plane.frame != "child":
            continue
        own = np.array(joint.plane.normal) / np.linalg.norm(joint.plane.normal)
        normal = own @ convention.point_matrix(joint.child)
        row = np.zeros(len(model.unknowns.names))
        for part, along in zip(seat, normal, strict=True):
            for coefficient, unknown in part.parts:
                row[unknown] += coefficient * along
        rows.append(row / PLANE_SD_MM)
        values.append(float(own @ joint.plane.point_mm) / PLANE_SD_MM)
    return Observations(np.array(rows).reshape(-1, len(model.unknowns.names)), np.array(values))


def _amount(model: HandModel, quantity: str) -> Amount:
    """Give the length or offset that a quantity's name stands for."""
    segment, _, part = quantity.partition(".")
    parts: dict[str, Callable[[], Amount]] = {
        "": lambda: model.length[segment],
        "along": lambda: model.mount[segment][0],
        "lateral": lambda: model.mount[segment][1],
        "height": lambda: model.mount[segment][2],
        "distal": lambda: model.length[segment].plus(model.mount[segment][0].times(-1.0)),
    }
    try:
        return parts[part]()
    except KeyError:
        known = ", ".join(model.length)
        raise InputError(
            f"measurement {quantity!r} is not known; expected a bone ({known}), or a receiver's segment "
            "followed by .along, .lateral, .height or .distal"
        ) from None
