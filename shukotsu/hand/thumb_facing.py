"""Return which way the receiver over a thumb's metacarpal faces: the nail's side or the back of the hand.

Frames have x distal and z towards the back of the bone. A thumb's phalanges leave no doubt: y is their axis
of flexion, z points to the nail's side. Its metacarpal has two backs, some 100 deg apart about its long axis.
On the nail's side, y is nearest the MCP joint's axis of flexion, and a receiver faces as those over the
phalanges do. Towards the back of the hand, y is nearest the axis that musculoskeletal models (MyoHand) call
the CMC joint's flexion, although the thumb leaves the palm about it.

A receiver goes where the thumb has room for it, so the data decide. The MCP joint bends and deviates, which
are swings, but hardly turns about the long axis: the twist between the two receivers is that of the facing.
"""

from __future__ import annotations

import numpy as np

from shukotsu.hand.rotations import Array


def faces_nail(relative: Array, at_nail: Array, at_hand: Array) -> bool:
    """Whether the metacarpal's receiver faces the nail's side, by the facing that most frames are nearer to.

    relative : (T, 3, 3) rotation from the proximal phalanx's receiver to the metacarpal's, where both are
    valid; frames x distal, y = z x x, z dorsal. at_nail, at_hand : (3, 3) the same of a straight average
    thumb, its metacarpal facing one way and the other. All three of the same hand, right or left, whose
    twists are mirrored. Without a frame it is the back of the hand.
    """
    twist = _twist_rad(relative)
    off_nail, off_hand = (
        np.abs(np.angle(np.exp(1j * (twist - _twist_rad(facing))))) for facing in (at_nail, at_hand)
    )
    return bool((off_nail < off_hand).sum() > len(twist) / 2)


def _twist_rad(rotation: Array) -> Array:
    """Angles (...) about x of rotations (..., 3, 3) taken apart into twist about x and swing across it."""
    trace = np.trace(rotation, axis1=-2, axis2=-1)
    return np.asarray(2 * np.arctan2(rotation[..., 2, 1] - rotation[..., 1, 2], 1 + trace))
