"""Linear observations of a hand: measured bones and receiver positions, its breadth, and anatomical limits.

On paper: docs/whole-hand.md, section 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shukotsu.errors import InputError
from shukotsu.fit.chain import HandModel
from shukotsu.fit.chain_builder import Amount
from shukotsu.fit.normal_equations import Frames, Observations
from shukotsu.fit.receiver_frames import Convention
from shukotsu.hand.average_hand import PRIOR
from shukotsu.hand.known_digits import known_digits, root_of
from shukotsu.hand.rotations import Array, unit
from shukotsu.study.layout import Joint, Layout
from shukotsu.study.verdict import LEAST_KNUCKLES_MM

PLANE_SD_MM, PLANE_SD_RAD = PRIOR.MOUNT_SD_MM[1], PRIOR.MOUNT_TURN_SD_RAD
"""Sd of the position and direction of the plane through a hinge's child: receivers are placed by eye, a
little beside the bone and turned. The turn matters more the farther away the joint is: together they make 2
mm on a finger and 15 mm at the far end of a forearm."""

FINGERS, KNUCKLES_SD_MM = ("index", "middle", "ring", "little"), 1.0
"""Fingers in order, and the sd of the least distance between neighbouring knuckles; it is soft, and a hand
whose data contradict it is reported."""

MOUNT_PARTS = ("along", "lateral", "height")
"""Components of a receiver's position on its bone: x, y, z of the bone."""

_TURNS = 0.1
"""Share of the largest singular value below which a direction is not determined by the motion."""


@dataclass(frozen=True)
class Measurement:
    """A length measured on the hand.

    Attributes
    ----------
    quantity : str
        A segment, for the length of its bone from joint to joint; `segment.along`, `.lateral` or `.height`,
        for the position of its receiver relative to the bone's proximal joint, distally, towards the thumb
        and dorsally; or `segment.distal`, for the distance along the bone from the receiver to the next
        joint.
    value_mm, sd_mm : float
        Length and its 1-sigma error.

    """

    quantity: str
    value_mm: float
    sd_mm: float


def measurable(layout: Layout) -> list[str]:
    """List the names of quantities that can be measured on a layout's hands; none without known anatomy."""
    names = []
    for digit in known_digits(layout):
        for segment in digit.segments:
            names.append(segment)
            if layout.segments[segment].measured:
                names += [f"{segment}.{part}" for part in (*MOUNT_PARTS, "distal")]
    return [*names, *(f"{root_of(layout)}.{part}" for part in MOUNT_PARTS)] if names else []


def observations(model: HandModel, measurements: Sequence[Measurement]) -> Observations:
    """Express measurements as linear observations H x = z of the unknowns (section 5).

    Parameters
    ----------
    model : HandModel
        The hand, whose lengths and receiver positions are linear in x.
    measurements : sequence of Measurement
        Lengths measured on it.

    Returns
    -------
    Observations
        One row per measurement, in units of its sd.

    Raises
    ------
    InputError
        If a quantity is neither a bone nor a receiver's position.

    """
    rows, values = [], []
    for measured in measurements:
        amount = _amount(model, measured.quantity)
        rows.append(amount.row(len(model.unknowns.names)) / measured.sd_mm)
        values.append((measured.value_mm - amount.constant) / measured.sd_mm)
    return Observations.of(rows, values, len(model.unknowns.names))


def breadth(model: HandModel, breadth_mm: float | None) -> Observations:
    """Express the hand's breadth as an observation: span of the outer knuckles, and flesh that scales.

    Parameters
    ----------
    model : HandModel
        The hand.
    breadth_mm : float or None
        Breadth over skin, across the knuckles.

    Returns
    -------
    Observations
        One row, or none if the breadth was not measured.

    """
    if breadth_mm is None or not model.length:
        return Observations.of([], [], len(model.unknowns.names))
    over_skin = model.scale.times(PRIOR.AVERAGE_BREADTH_MM)
    if {"index", "little"} <= {*model.knuckles}:
        span = _apart(model, "index", "little")
        over_skin = over_skin.plus(model.scale.times(-span.constant / model.scale.constant)).plus(span)
    row = over_skin.row(len(model.unknowns.names)) / PRIOR.BREADTH_SD_MM
    return Observations.of([row], [(breadth_mm - over_skin.constant) / PRIOR.BREADTH_SD_MM], len(row))


def side_by_side(model: HandModel, x: Array) -> Observations:
    """Keep apart neighbouring knuckles that are closer to each other than the bones are thick.

    Parameters
    ----------
    model : HandModel
        Chains of the hand.
    x : array, shape (G,)
        The hand's unknowns.

    Returns
    -------
    Observations
        One row for each pair that is too close: its least distance, in units of its sd.

    """
    names, rows, values = [name for name in FINGERS if name in model.knuckles], [], []
    for first, second in pairwise(names):
        apart = _apart(model, first, second)
        row = apart.row(len(x)) / KNUCKLES_SD_MM
        least = (LEAST_KNUCKLES_MM - apart.constant) / KNUCKLES_SD_MM
        if row @ x < least:
            rows.append(row)
            values.append(least)
    return Observations.of(rows, values, len(x))


def _apart(model: HandModel, first: str, second: str) -> Amount:
    """Return the distance of two fingers' knuckles, along the line between them in the average hand."""
    ends = list(zip(model.knuckles[first], model.knuckles[second], strict=True))
    between = unit(np.array([near.constant - far.constant for near, far in ends]))
    whole = Amount(0.0, ())
    for (near, far), share in zip(ends, between.tolist(), strict=True):
        whole = whole.plus(near.times(share)).plus(far.times(-share))
    return whole


def planes(model: HandModel, layout: Layout, convention: Convention, frames: Frames) -> Observations:
    """Keep hinges without anatomy near the layout's plane, as motion does not fix them along their axes.

    Parameters
    ----------
    model : HandModel
        The hand.
    layout : Layout
        Planes of the joints.
    convention : Convention
        Axes of the receivers.
    frames : Frames
        Frames from which a hinge's distance from its receiver is estimated; the sd grows with it.

    Returns
    -------
    Observations
        One row for each hinge that has a plane.

    """
    rows, values, n_unknowns = [], [], len(model.unknowns.names)
    for name, centre in model.centres_in_child.items():
        joint = layout.joints[name]
        if joint.dof != 1 or joint.plane.frame != "child":
            continue
        in_layout = np.array(joint.plane.normal) / np.linalg.norm(joint.plane.normal)
        normal = in_layout @ convention.point_matrix(joint.child)
        row = sum(along * amount.row(n_unknowns) for amount, along in zip(centre, normal, strict=True))
        sd_mm = np.hypot(PLANE_SD_MM, PLANE_SD_RAD * _distance_mm(model, joint, frames))
        rows.append(row / sd_mm)
        values.append(float(in_layout @ joint.plane.point_mm) / sd_mm)
    return Observations.of(rows, values, n_unknowns)


def _distance_mm(model: HandModel, joint: Joint, frames: Frames) -> float:
    """Return the distance of a hinge's axis from its child's receiver (Eq. 4, determined directions only)."""
    parent, child = (model.receivers.index(name) for name in (joint.parent_receiver, joint.child))
    both = frames.valid[:, parent] & frames.valid[:, child]
    back = frames.rotation[both, child].swapaxes(-1, -2)
    turned = back @ frames.rotation[both, parent]
    apart = back @ (frames.position_mm[both, parent] - frames.position_mm[both, child])[..., None]
    stack = np.concatenate([np.broadcast_to(np.eye(3), turned.shape), -turned], -1).reshape(-1, 6)
    return float(np.linalg.norm(np.linalg.lstsq(stack, apart.reshape(-1), rcond=_TURNS)[0][:3]))


def _amount(model: HandModel, quantity: str) -> Amount:
    """Return the length or offset that a quantity denotes."""
    segment, _, part = quantity.partition(".")
    try:
        if not part:
            return model.length[segment]
        if part == "distal":
            return model.length[segment].plus(model.mount[segment][0].times(-1.0))
        return dict(zip(MOUNT_PARTS, model.mount[segment], strict=True))[part]
    except KeyError:
        bones = ", ".join(model.length)
        raise InputError(
            f"measurement {quantity!r} is not known; expected a bone ({bones}), or a receiver's segment "
            "followed by .along, .lateral, .height or .distal"
        ) from None
