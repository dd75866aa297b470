"""Which joints, bones and tips the receivers measure: one rule for all models, layouts and tables.

Bones form a tree. What is between two receivers with a valid pose is measured. What is beyond the last
receiver is not, since only anatomy, or a coupling to another joint, constrains it. So a joint is measured if
receivers are valid on both sides of it, a bone if it carries one or is between two, and the tip of a digit if
its last bone carries one.

A receiver's six coordinates determine at most six angles between it and the previous receiver, and no chain
of a hand has more. Without the middle phalanx's receiver, the position of the distal one separates the PIP
and the DIP joint; a receiver on the proximal phalanx is sufficient for a metacarpal's CMC joint. The stated
errors quantify how well.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Bools
from shukotsu.study.layout import Layout
from shukotsu.translation import listed

NOT_MEASURED = "not-measured"
"""Flag of a frame in which no receiver shows a joint, a bone or a tip."""


@dataclass(frozen=True)
class Measured:
    """Whether joints (by name), bones (by segment) and tips (by digit) are measured in frames, (T,) bool."""

    joints: Mapping[str, Bools]
    bones: Mapping[str, Bools]
    tips: Mapping[str, Bools]


def measured_in(layout: Layout, segments: Sequence[str], valid: Bools) -> Measured:
    """Find which joints, bones and tips are measured in each frame.

    segments : S segments with receivers. valid : (T, S) whether a receiver has a pose.
    """
    beyond = _beyond(layout)

    def seen(bones: Collection[str]) -> Bools:
        return np.asarray(valid[:, [name in bones for name in segments]].any(1))

    joints = {
        name: seen(beyond[joint.child]) & seen(_before(beyond, joint.child))
        for name, joint in layout.joints.items()
    }
    bones = {name: seen({name}) for name in layout.segments}
    for name, joint in layout.joints.items():
        for bone in (joint.parent, joint.child):
            bones[bone] = bones[bone] | joints[name]
    return Measured(joints, bones, {digit.name: seen({digit.tip}) for digit in layout.digits.values()})


def not_worn(layout: Layout, joint: str, worn: Collection[str]) -> list[str]:
    """Return segments of which one would need a receiver to measure a joint; empty if it is measured.

    worn : segments that carry a receiver.
    """
    beyond, child = _beyond(layout), layout.joints[joint].child
    for side in (beyond[child], _before(beyond, child)):
        if not side & {*worn}:
            return [name for name in layout.measured if name in side]
    return []


def _beyond(layout: Layout) -> dict[str, set[str]]:
    """Return the set of segments from each bone outward, including the bone."""
    above = {joint.child: joint.parent for joint in layout.joints.values()}
    beyond = {name: {name} for name in layout.segments}
    for name in layout.segments:
        bone = name
        while bone in above:
            bone = above[bone]
            beyond[bone].add(name)
    return beyond


def _before(beyond: Mapping[str, set[str]], child: str) -> set[str]:
    """Return the segments of a bone's tree on the other side of the bone's proximal joint."""
    return max((bones for bones in beyond.values() if child in bones), key=len) - beyond[child]


def not_measured_text(segments: Sequence[str]) -> str:
    """Return the reason why a joint or a tip is not measured; segments : those without a receiver."""
    return f"not measured: no receiver on {listed(segments)}"
