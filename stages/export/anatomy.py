"""What is known of the bones of a hand by their names: which way a thumb faces, where angles are zero.

A bone frame's +Y is the back of the bone, and a thumb's metacarpal has two (`kinematics.thumb_facing`). In
our tables it faces as the receiver over it does. A rig that is driven by these frames wants one answer: the
nail's side, as its phalanges do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from kinematics.joint_angles import mirrored
from kinematics.rotations import Array, conjugate, from_matrix, matrix, multiply
from kinematics.thumb_facing import faces_nail
from schemas.layout import Layout
from stages.export.frames import regrouped, release, slices
from stages.export.motion import Joint
from stages.fit_hand.anatomy_priors import DIGITS
from stages.fit_hand.chain import known_digits, rest_rotations

TOGETHER = 1 << 16
"""Frames that go into one sum of products: of as many the sum does not depend on the size of blocks."""


def to_nail_side(
    layout: Layout, hand: str, joints: Sequence[Joint], turns: Sequence[Array]
) -> dict[int, Array]:
    """By what rotation (4,) in its own frame a thumb's metacarpal is to be turned, by its index.

    turns : of every joint its rotations (T, 4) in the bone frames of our tables. Nothing where the skeleton
    has no thumb of known anatomy, or where it faces the nail's side already. It turns by the angle between
    the two backs of the average thumb.
    """
    places = {(joint.digit, joint.segment): i for i, joint in enumerate(joints) if not joint.tip}
    thumbs = [d for d in known_digits(layout) if d.name == "thumb" and ("thumb", d.segments[0]) in places]
    if not thumbs:
        return {}
    metacarpal, proximal = (places["thumb", segment] for segment in thumbs[0].segments[:2])
    relative = _some(relative_rotations(turns[metacarpal], turns[proximal]))
    frames = [replace(DIGITS["thumb"], faces_nail=nail).frames() for nail in (True, False)]
    rests = [_of_hand(from_matrix(bones[0].T @ bones[1]), hand) for bones in frames]
    if not len(relative) or faces_nail(matrix(relative), *(matrix(rest) for rest in rests)):
        return {}
    return {metacarpal: _of_hand(from_matrix(frames[1][0].T @ frames[0][0]), hand)}


def _some(parts: Iterable[Array]) -> Array:
    """Rotations (n, 4) of all parts, or of every second, third and so on where they are many."""
    kept, step, passed = np.empty((0, 4)), 1, 0
    for part in parts:
        kept = np.concatenate([kept, part[-passed % step :: step]])
        passed += len(part)
        while len(kept) > TOGETHER:
            kept, step = kept[::2], step * 2
    return kept


def relative_rotations(above: Array, turn: Array) -> Iterator[Array]:
    """The second of (T, 4) in the frame of the first, where both are known: TOGETHER rows at a time."""

    def parts() -> Iterator[Array]:
        for rows in slices(len(turn)):
            relative = multiply(conjugate(above[rows]), turn[rows])
            release(above, turn)
            yield relative[np.isfinite(relative).all(-1)]

    return regrouped(parts(), TOGETHER)


def mean_rotation(above: Array, turn: Array) -> Array:
    """The rotation (4,) nearest to all of the second of (T, 4) in the frame of the first; identity of none.

    Signs aside (Markley et al. 2007, J Guid Control Dyn 30:1193).
    """
    total = [known.T @ known for known in relative_rotations(above, turn)]
    if not total:
        return np.array([1.0, 0.0, 0.0, 0.0])
    mean = np.linalg.eigh(sum(total[1:], start=total[0]))[1][:, -1]
    return np.asarray(-mean if mean[0] < 0 else mean)


def neutral_rotations(layout: Layout, hand: str, joints: Sequence[Joint]) -> Array:
    """Rotations (J, 4) of each bone against its parent, in our bone frames, where its joint angles are zero.

    Those of `docs/joint-angles.md`, the thumb's metacarpal facing its nail's side; NaN of the root, of tips,
    of digits of which no anatomy is known and of joints to which the layout gives no degree of freedom.
    """
    nails = {name: replace(digit, faces_nail=digit.second_axis is not None) for name, digit in DIGITS.items()}
    rests = rest_rotations(layout, hand, nails)
    moving = {name: rest for name, rest in rests.items() if layout.joints[name].dof}
    return np.stack([moving.get(joint.name, np.full(4, np.nan)) for joint in joints])


def _of_hand(quaternion: Array, hand: str) -> Array:
    """A right hand's rotation between bone frames as that of the hand."""
    return mirrored(quaternion) if hand == "left" else quaternion
