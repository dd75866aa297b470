"""Postures in which the thumb's pad meets a finger's: a small inverse problem, all four fingers at once."""

from __future__ import annotations

import numpy as np

from shukotsu.skeleton import rotations
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.forward import coupled_angles, poses_in_hand
from shukotsu.stages.simulate.random_hand import ABDUCTION, FINGERS, FLEXION, JOINTS, TIP_BONES, Hand
from shukotsu.stages.simulate.realism import Realism

_DISTANCE_SD_MM, _FACING_SD = 0.4, 0.8
_STEPS, _NUDGE_DEG, _LARGEST_STEP_DEG = 25, 0.05, 12.0

# angle, usual value, its spread, least and greatest, all in degrees; the last three are the finger's own
_ANGLES = (
    ("thumb_cmc", FLEXION, 26.0, 13.0, -10.0, 52.0),
    ("thumb_cmc", ABDUCTION, -12.0, 10.0, -35.0, 25.0),
    ("thumb_mcp", FLEXION, 25.0, 13.0, 18.0, 60.0),
    ("thumb_ip", FLEXION, 25.0, 13.0, 18.0, 65.0),
    ("mcp", FLEXION, 45.0, 8.0, 29.0, 72.0),
    ("mcp", ABDUCTION, 0.0, 4.0, -15.0, 15.0),
    ("pip", FLEXION, 46.0, 6.0, 32.0, 62.0),
)


def contact_postures(hand: Hand, starts_deg: Array, realism: Realism) -> Array:
    """Bend thumb and fingers (4, J, 2) until their pads meet, if they can; regularised Gauss-Newton."""
    named = [[name if name in JOINTS else f"{digit}_{name}" for name, *_ in _ANGLES] for digit in FINGERS]
    joints = np.array([[JOINTS.index(name) for name in names] for names in named])
    columns = np.array([column for _, column, *_ in _ANGLES])
    usual, spread, least, most = np.array([angle[2:] for angle in _ANGLES]).T
    angles = np.tile(usual, (len(FINGERS), 1))
    n = len(usual)
    nudges = np.vstack([np.zeros(n), _NUDGE_DEG * np.eye(n)])
    rows = np.arange(len(FINGERS))[:, None]
    for _ in range(_STEPS):
        postures = np.repeat(starts_deg[:, None], n + 1, 1)  # finger, nudged angle
        postures[rows[..., None], np.arange(n + 1)[:, None], joints[:, None], columns] = (
            angles[:, None] + nudges
        )
        misfit = _misfit(hand, postures, realism)
        jacobian = np.swapaxes(misfit[:, 1:] - misfit[:, :1], 1, 2) / _NUDGE_DEG
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian + np.diag(1.0 / spread**2)
        slope = np.einsum("fra,fr->fa", jacobian, misfit[:, 0]) + (angles - usual) / spread**2
        step = -np.linalg.solve(normal, slope[..., None])[..., 0]
        angles = np.clip(angles + np.clip(step, -_LARGEST_STEP_DEG, _LARGEST_STEP_DEG), least, most)
    met = starts_deg.copy()
    met[rows, joints, columns] = angles
    return met


def _misfit(hand: Hand, postures_deg: Array, realism: Realism) -> Array:
    """Residuals, zero at contact, (4, N, 6): pad distance and pads' normals, over their spreads."""
    fingers, n = postures_deg.shape[:2]
    voluntary = np.radians(postures_deg.reshape(fingers * n, len(JOINTS), 2))
    padded = np.concatenate([voluntary, np.zeros((*voluntary.shape[:2], 1))], -1)
    position, quaternion = poses_in_hand(hand, coupled_angles(padded, hand, realism))
    pads = position[:, TIP_BONES] + rotations.rotate(quaternion[:, TIP_BONES], hand.pad_mm)
    normals = rotations.rotate(quaternion[:, TIP_BONES], np.array([0.0, 0.0, -1.0]))
    own = 1 + np.repeat(np.arange(fingers), n)
    frames = np.arange(fingers * n)
    apart = (pads[:, 0] - pads[frames, own]) / _DISTANCE_SD_MM
    facing = (normals[:, 0] + normals[frames, own]) / _FACING_SD
    return np.concatenate([apart, facing], -1).reshape(fingers, n, 6)
