"""Prior model of a body: positions of joints relative to the receivers, and how joints turn.

For a hand it is the average hand of the `hand` room, with wide tolerances; for any other layout it only
states that joints are within some tens of centimetres of their receivers.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shukotsu.hand.average_hand import DIGITS, PRIOR, DigitAnatomy
from shukotsu.hand.known_digits import known_digits, root_of
from shukotsu.hand.rotations import Array, cross_matrix
from shukotsu.hand.sampled_motion import receiver_axes
from shukotsu.study.layout import Digit, Joint, Layout

SHARED = 7
"""Number of unknowns that all joints of a hand share: scale, and shift and turn of the hand's receiver."""
SCALE_SD, FREE_SCALE_SD = 0.13, 0.6
"""SD of the hand's scale: of real hands, and as allowed in the fit, so that a wrong unit shows as scale."""
ROOM = 1.6
"""Factor by which SDs are widened, for unusual hands and receivers not put on by experts."""
PHALANX_SD_MM, THUMB_SD_MM = (4.5, 2.5, 2.5), (6.0, 4.0, 4.0)
"""SD of a joint's centre in the frame of the receiver on the bone before or after it."""
HAND_MOUNT_MM, FOREARM_MOUNT_MM = (35.0, 0.0, 14.0), (-60.0, 0.0, 22.0)
"""Positions of receivers relative to the wrist, if the layout does not define the wrist (our estimate)."""
ON_HAND_SD_MM = 4.0
"""SD of a knuckle in the hand's frame, in addition to the shared unknowns."""

FACINGS, PAST_DEG = 9, 25.0
"""Roll of the receiver on the thumb's metacarpal: number of angles tried, and how far beyond either side."""

FLEXION_DEG = {"mcp": (-45.0, 100.0), "pip": (-25.0, 120.0), "dip": (-30.0, 100.0), "ip": (-35.0, 100.0)}
THUMB_FLEXION_DEG = {"cmc": (-45.0, 70.0), "mcp": (-35.0, 80.0), "ip": (-40.0, 100.0)}
"""Ranges of flexion, including some degrees by which receivers are turned on the bones."""
HINGE_SD_DEG, MCP_SD_DEG, THUMB_SD_DEG = (10.0, 10.0), (14.0, 12.0), (18.0, 20.0)
"""SD of the median abduction and of the median axial rotation."""
SWING_DEG = {"mcp": (45.0, 30.0), "cmc": (60.0, 50.0)}
HINGE_SWING_DEG = (14.0, 14.0)
"""Ranges of abduction and of axial rotation that are not penalised."""


@dataclass(frozen=True)
class ExpectedBody:
    """Expected properties of J joints between receivers.

    ends : (J, 2) indices of the parent's and the child's receiver. centre_mm, sd_mm : (J, 2, 3) joint centre
    and its SD in both receivers' frames. gain : (J, 2, 3, 7) effect on the centre of the shared unknowns,
    each of SD 1. rest : (J, F, 3, 3) rotation from child to parent in the flat hand, for each of F rolls of
    the receiver on the thumb's metacarpal; faced : (J,) whether it depends on the roll. flexion_deg : (J, 2)
    smallest and largest flexion; sideways_sd_deg, swing_deg : (J, 2) for abduction and axial rotation.
    has_anatomy : (J,) whether anatomy defines all this. gap_mm : (J,) gap that skin motion explains.
    """

    names: tuple[str, ...]
    ends: npt.NDArray[np.int64]
    centre_mm: Array
    sd_mm: Array
    gain: Array
    rest: Array
    faced: npt.NDArray[np.bool_]
    flexion_deg: Array
    sideways_sd_deg: Array
    swing_deg: Array
    has_anatomy: npt.NDArray[np.bool_]
    gap_mm: Array

    def concerned(self, places: Collection[int] | None) -> npt.NDArray[np.bool_]:
        """Return which joints have one of these receivers, (J,); all if none has, or if places is None."""
        chosen = frozenset(places or ())
        concerned = np.array([not chosen.isdisjoint(pair) for pair in self.ends.tolist()], bool)
        return concerned if concerned.any() else np.ones(len(self.names), bool)


def expected_body(layout: Layout, segments: tuple[str, ...]) -> ExpectedBody:
    """Build the expected body of the layout's joints whose two receivers are among the segments."""
    joints = [j for j in layout.solvable if j.parent_receiver in segments and j.child in segments]
    ends = np.array([[segments.index(j.parent_receiver), segments.index(j.child)] for j in joints])
    n = len(joints)
    body = ExpectedBody(
        tuple(joint.name for joint in joints), ends.reshape(n, 2), np.zeros((n, 2, 3)),
        np.full((n, 2, 3), 250.0), np.zeros((n, 2, 3, SHARED)), np.tile(np.eye(3), (n, FACINGS, 1, 1)),
        np.zeros(n, bool),
        np.tile([-180.0, 180.0], (n, 1)), np.full((n, 2), 90.0), np.full((n, 2), 180.0), np.zeros(n, bool),
        np.full(n, 3.0),
    )  # fmt: skip
    for digit in known_digits(layout):
        for index, joint in enumerate(joints):
            if joint.child in digit.segments:
                _expect(body, index, joint, digit, layout)
    if layout.wrist is not None and body.has_anatomy.any():
        for index, joint in enumerate(joints):
            if joint.name == layout.wrist.joint and joint.child == root_of(layout):
                body.has_anatomy[index] = True
                body.centre_mm[index] = -np.array([FOREARM_MOUNT_MM, _hand_mount_mm(layout)])
                body.sd_mm[index] = [[40.0, 12.0, 12.0], [4.0, 4.0, 4.0]]
                body.flexion_deg[index] = (-95.0, 95.0)
                body.sideways_sd_deg[index] = (20.0, 25.0)
                body.swing_deg[index] = (70.0, 40.0)
                _share_root(body, index, 1)
    return body


def _expect(body: ExpectedBody, index: int, joint: Joint, digit: Digit, layout: Layout) -> None:
    """Set the expected properties of a digit's joint in `body`."""
    anatomy = DIGITS[digit.name]
    bone = digit.segments.index(joint.child)
    thumb = digit.name == "thumb"
    on_root = joint.parent_receiver == digit.base
    body.has_anatomy[index] = True
    for facing, frames in enumerate(_frames(anatomy)):
        body.rest[index, facing] = frames[bone] if on_root else frames[bone - 1].T @ frames[bone]
    body.faced[index] = bool(np.ptp(body.rest[index], axis=0).max() > 0)
    body.sd_mm[index] = THUMB_SD_MM if thumb else PHALANX_SD_MM
    ends, mounts = anatomy.lengths_mm[:, None] * [1.0, 0.0, 0.0], anatomy.mounts_mm()
    if on_root:
        body.sd_mm[index, 0] = ON_HAND_SD_MM * (1.5 if thumb else 1.0)
        parent = anatomy.joints_mm()[bone]
        body.centre_mm[index, 0] = parent - _hand_mount_mm(layout)
        _share_root(body, index, 0)
    else:
        body.centre_mm[index, 0] = (ends - mounts)[bone - 1]
    body.centre_mm[index, 1] = -mounts[bone]
    body.gain[index, :, :, 0] = FREE_SCALE_SD * body.centre_mm[index]
    kind = joint.name.rsplit("_", 1)[-1]
    body.flexion_deg[index] = (THUMB_FLEXION_DEG if thumb else FLEXION_DEG).get(kind, (-90.0, 120.0))
    sideways = MCP_SD_DEG if kind in ("mcp", "cmc") else HINGE_SD_DEG
    body.sideways_sd_deg[index] = THUMB_SD_DEG if thumb else sideways
    body.swing_deg[index] = SWING_DEG.get(kind, HINGE_SWING_DEG)
    body.gap_mm[index] = 3.0 if thumb or layout.joints[joint.name].compound else 2.0


def _frames(anatomy: DigitAnatomy) -> list[Array]:
    """Return the frames (B, 3, 3) of a digit's bones for each roll of its first; only a thumb's differ."""
    frames = anatomy.frames()
    if anatomy.second_axis is None:
        return [frames] * FACINGS
    at_nail = frames[0].T @ replace(anatomy, faces_nail=True).frames()[0]
    nail_rad = np.arctan2(at_nail[2, 1], at_nail[1, 1])
    past_rad = np.sign(nail_rad) * np.radians(PAST_DEG)
    faced = []
    for roll in np.linspace(-past_rad, nail_rad + past_rad, FACINGS):
        about = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
        faced.append(np.concatenate([(frames[0] @ about)[None], frames[1:]]))
    return faced


def _hand_mount_mm(layout: Layout) -> Array:
    """Return the position of the hand's receiver relative to the wrist: distal, lateral, dorsal, mm."""
    if layout.wrist is None:
        return np.array(HAND_MOUNT_MM)
    axes = receiver_axes(layout, (layout.wrist.segment,))[0]
    return np.asarray(-axes.T @ np.array(layout.wrist.nominal_mm))


def _share_root(body: ExpectedBody, index: int, end: int) -> None:
    """Set the effect of the hand receiver's shift and turn on a joint in that receiver's frame."""
    body.gain[index, end, :, 1:4] = ROOM * np.diag(PRIOR.HAND_MOUNT_SD_MM)
    body.gain[index, end, :, 4:7] = ROOM * PRIOR.MOUNT_TURN_SD_RAD * cross_matrix(body.centre_mm[index, end])
