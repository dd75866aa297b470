"""What the user asks of an export, and how a motion is made ready for a format by it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schemas.errors import InputError
from stages.export.axes import turned, upright
from stages.export.gaps import closed
from stages.export.motion import SkeletonMotion, stiffened
from stages.export.resampling import in_range, resampled, with_rate
from stages.export.rigging import on_rig


@dataclass(frozen=True)
class Settings:
    """The words of the command line.

    unit, up : of the file, empty for the format's own; a format that leaves no choice ignores them.
    transmitter_up : axis of the transmitter's frame that points up. gaps, max_gap_s : `stages.export.gaps`.
    rig : empty for the layout's names. stiff : bones kept at their length, rotations only. fps : None as
    recorded. first, last : recorded frame numbers, both included. rate_hz : of a recording without times.
    """

    unit: str = ""
    up: str = ""
    transmitter_up: str = "z"
    gaps: str = "refuse"
    max_gap_s: float = 0.1
    rig: str = ""
    stiff: bool = False
    fps: float | None = None
    first: int | None = None
    last: int | None = None
    rate_hz: float | None = None


def prepared(motion: SkeletonMotion, settings: Settings, *, holds_gaps: bool, up: str) -> SkeletonMotion:
    """The motion as a format is to write it: range, times, gaps, rate, rig and upright world.

    holds_gaps : whether the format has a place for a frame without a pose; then `refuse` keeps gaps (NaN).
    up : y or z, the axis of the file that points up, empty for the transmitter's own frame. Still in mm.
    Raises InputError as the parts do.
    """
    motion = in_range(motion, settings.first, settings.last)
    if settings.rate_hz is not None:
        motion = with_rate(motion, settings.rate_hz)
    if not (holds_gaps and settings.gaps == "refuse"):
        motion = closed(motion, settings.gaps, settings.max_gap_s)
    if settings.fps is not None:
        motion = resampled(
            motion, settings.fps, settings.max_gap_s if settings.gaps == "interpolate" else 0.0
        )
    if not holds_gaps:
        _check_whole(motion)
    if settings.rig:
        motion = on_rig(motion, settings.rig)
    if settings.stiff:
        motion = stiffened(motion)
    _check_bones(motion)
    return turned(motion, upright(settings.transmitter_up, up)) if up else motion


def _check_whole(motion: SkeletonMotion) -> None:
    """Refuse a frame without a pose that resampling left where the recording stood still for long."""
    if not motion.whole.all():
        row = int(np.argmin(motion.whole))
        raise InputError(
            f"--fps: nothing was recorded about {motion.time_s[row]:.3f} s (frame {motion.frame[row]}) for "
            "more than 1.5 usual intervals; use --gaps interpolate with a --max-gap-s that spans it"
        )


def _check_bones(motion: SkeletonMotion) -> None:
    """Refuse a bone without length: a joint after a digit's first that is where its parent is."""
    for joint, offset in zip(motion.joints, motion.rest_offset_mm, strict=True):
        above = joint.parent
        if above > 0 and not float(offset @ offset) > 0:
            raise InputError(
                f"{motion.origin.recording.of_hand}: the bone from "
                f"{motion.names[above]} to {joint.name} has no length; look at its joints' status"
            )
