"""Where a fitted hand's joint angles are zero, and about what they turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from shukotsu.anatomy.known_digits import known_digits
from shukotsu.schemas.layout import Digit
from shukotsu.skeleton.joint_angles import mirrored
from shukotsu.skeleton.rotations import Array, about_axis, from_matrix
from shukotsu.stages.fit_hand.chain_builder import axis_frame, bone, straight
from shukotsu.stages.fit_hand.posterior import Evidence, Place

_X = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class AngleAxes:
    """A joint's zero and the axes of its angles, of a right hand, in the frames of its bones.

    rest : (4,) child to parent at zero, the straight digit as it lies in the flat hand; rest_by_x : (3, G)
    how it turns in the parent's frame with the unknowns. turn_rad : by how much the axes stand about the
    child bone from its frame, so that the first lies as the fitted axis of flexion does; turn_by_x : (G,);
    turn_sd_deg : 1-sigma.
    """

    parent: str
    child: str
    rest: Array
    rest_by_x: Array
    turn_rad: float
    turn_by_x: Array
    turn_sd_deg: float

    def of_hand(self, hand: str, more_rad: float = 0.0) -> tuple[Array, Array]:
        """Rest and turn, (4,) each, in the frames of that hand's bones; more_rad : to turn by in addition."""
        both = self.rest, about_axis(_X, np.array(self.turn_rad + more_rad))
        return (mirrored(both[0]), mirrored(both[1])) if hand == "left" else both


def angle_axes(evidence: Evidence, places: Mapping[str, Place]) -> dict[str, AngleAxes]:
    """Zero and axes of known joints that move; a thumb's CMC by its nail's side, as the MCP axis tells it."""
    covariance = evidence.posterior.covariance
    found = {}
    for digit in known_digits(evidence.layout):
        for k, (parent, seen, turned) in enumerate(_rests(evidence, places, digit)):
            joint, child = digit.joints[k], digit.segments[k]
            if not evidence.layout.joints[joint].dof:
                continue
            own = k == 0 and evidence.model.anatomy[digit.name].second_axis is not None
            own = own and axis_frame(digit.joints[1]) in places
            by = digit.joints[1] if own else joint
            at, seer = places[axis_frame(by)], places[bone(child)] if own else seen
            (_, y, z), moved = seer.sees_axis(at.R @ evidence.model.axes[by], at.turned)
            by_x = (y * moved[2] - z * moved[1]) / (y * y + z * z)
            sd_deg = float(np.degrees(np.sqrt(by_x @ covariance @ by_x)))
            rest = from_matrix(parent.R.T @ seen.R)
            above = digit.segments[k - 1] if k else digit.base
            found[joint] = AngleAxes(above, child, rest, turned, float(np.arctan2(z, y)), by_x, sd_deg)
    return found


def _rests(
    evidence: Evidence, places: Mapping[str, Place], digit: Digit
) -> Iterator[tuple[Place, Place, Array]]:
    """Each joint's parent bone, its child bone at zero, and how that turns in the parent's frame."""
    still = np.zeros((3, len(evidence.posterior.x)))
    above = np.eye(3)
    for k, frame in enumerate(evidence.model.anatomy[digit.name].frames()):
        if k:
            parent = flat = places[bone(digit.segments[k - 1])]
            turned = still
        else:
            parent, flat = Place(np.eye(3), np.zeros(3), still, still), places[straight(digit.name)]
            turned = flat.turned
        yield parent, Place(flat.R @ above.T @ frame, flat.t, flat.moved, flat.turned), turned
        above = frame
