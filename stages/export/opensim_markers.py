"""Receivers as markers: a triad each, its origin and a point 10 mm along every axis of its own.

On a bone a triad sits where it was on average over the recording; in the laboratory it is where the receiver
was measured. What is between the two is skin, and the error of the skeleton.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.posing import PosedRecording
from shukotsu.skeleton.rotations import Array, conjugate, mean_rotation, multiply, rotate
from shukotsu.stages.export.kinematic_tree import JointForm
from shukotsu.stages.export.rig_names import plain_names

ARM_MM = 10.0
POINTS_MM = np.vstack([np.zeros(3), ARM_MM * np.eye(3)])
POINTS = ("o", "x", "y", "z")
"""What the points of a triad are called, after the receiver's segment."""


@dataclass(frozen=True)
class Triad:
    """A receiver and the body that carries it.

    form : index of the body's form. markers : names of its points. local_mm : (4, 3) in the bone's frame.
    receiver : its place among the motion's. spread_mm : RMS distance of the points from where the bone would
    have them.
    """

    segment: str
    form: int
    markers: tuple[str, ...]
    local_mm: Array
    receiver: int
    spread_mm: float

    def measured_mm(self, receivers: Poses) -> Array:
        """The points in the ground in the receivers' frames, (n, 12), NaN where the receiver is not valid."""
        place, turn = (values[:, self.receiver] for values in (receivers.position_mm, receivers.quaternion))
        return (place[:, None] + rotate(turn[:, None], POINTS_MM)).reshape(-1, 12)


def triads(motion: PosedRecording, forms: tuple[JointForm, ...]) -> tuple[list[Triad], list[str]]:
    """Triads of all receivers that sit on a bone of the skeleton, and sentences on the others."""
    receivers, placed, lost = motion.receivers, [], []
    carriers = {motion.joints[form.index].segment: place for place, form in reversed(list(enumerate(forms)))}
    names = plain_names(receivers.segments)
    for number, (segment, name) in enumerate(zip(receivers.segments, names, strict=True)):
        place, turn = receivers.position_mm[:, number], receivers.quaternion[:, number]
        seen = np.isfinite(place).all(-1) & np.isfinite(turn).all(-1)
        if segment not in carriers or not seen.any():
            why = "is on no bone of the skeleton" if segment not in carriers else "is valid in no frame"
            lost.append(f"receiver {segment}, which {why}")
            continue
        form = carriers[segment]
        index = forms[form].index
        bone_mm, bone = motion.position_mm[:, index], motion.quaternion[:, index]
        back = conjugate(bone)
        origin = rotate(back, place - bone_mm)[seen].mean(0)
        local = origin + rotate(mean_rotation(multiply(back, turn)[seen]), POINTS_MM)
        squares = 0.0
        for point, own in zip(POINTS_MM, local, strict=True):
            beyond = place + rotate(turn, point) - bone_mm - rotate(bone, own)
            squares += float(np.sum(beyond[seen] ** 2))
        markers = tuple(f"{name}_{point}" for point in POINTS)
        spread = float(np.sqrt(squares / (len(POINTS) * seen.sum())))
        placed.append(Triad(segment, form, markers, local, number, spread))
    return placed, lost
