"""The receivers that a recording has poses of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.export.frames import changed
from stages.export.motion import SkeletonMotion


def with_seen_receivers(motion: SkeletonMotion) -> tuple[SkeletonMotion, tuple[str, ...]]:
    """The motion without receivers that have no pose in any frame, and a sentence where there are some.

    A layout may name receivers that a recording was made without, a forearm's for one.
    """
    there = motion.receivers
    seen = np.asarray(there.valid.any(0))
    if seen.all():
        return motion, ()
    kept = tuple(name for name, known in zip(there.segments, seen, strict=True) if known)
    gone = ", ".join(name for name in there.segments if name not in kept)

    def only_seen(block: SkeletonMotion) -> SkeletonMotion:
        own = block.receivers
        receivers = replace(
            own,
            segments=kept,
            position_mm=own.position_mm[:, seen],
            quaternion=own.quaternion[:, seen],
            valid=own.valid[:, seen],
        )
        return replace(block, receivers=receivers)

    return changed(motion, only_seen), (f"receivers that have no pose in any frame: {gone}",)
