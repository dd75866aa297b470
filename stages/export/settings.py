"""Define what the user asks of an export, and how a motion is made ready for a format by it."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shukotsu.stages.export.motion import SkeletonMotion


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


def add_motion_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a motion is made ready; `settings_of` reads them."""
    parser.add_argument("--licence", default="", help="the terms of use, to go into every file")
    parser.add_argument("--fps", type=_positive, help="frames a second to resample to (default: as recorded)")
    parser.add_argument("--frames", type=_frames, default=(None, None), help="A:B, recorded frame numbers")
    parser.add_argument("--rate-hz", type=_positive, help="rate of a recording that has no device time")
    parser.add_argument("--unit", choices=("m", "cm", "mm"), default="", help="where the format has a choice")
    parser.add_argument("--up", choices=("y", "z"), default="", help="likewise, the axis that points up")
    parser.add_argument(
        "--transmitter-up",
        choices=("x", "y", "z", "-x", "-y", "-z"),
        default="z",
        help="the transmitter's axis that points up; write --transmitter-up=-z (default: %(default)s)",
    )
    parser.add_argument(
        "--gaps",
        choices=("refuse", "hold", "cut", "interpolate"),
        default="refuse",
        help="frames without a pose; formats that can hold them keep them by default (default: %(default)s)",
    )
    parser.add_argument(
        "--max-gap-s", type=_positive, default=0.1, help="longest gap to interpolate (default: %(default)s)"
    )
    parser.add_argument("--rig", default="", help="names of webxr, openxr, vrm, unity, unreal or mixamo")
    parser.add_argument(
        "--bones",
        choices=("exact", "stiff"),
        default="exact",
        help="exact: joints where the tables have them, bones stretch by the joints' gaps; stiff: bones keep "
        "their length and only turn (default: %(default)s)",
    )


def settings_of(arguments: argparse.Namespace) -> Settings:
    """Give the settings that the options of `add_motion_options` hold."""
    first, last = arguments.frames
    known = vars(arguments) | {"stiff": arguments.bones == "stiff", "first": first, "last": last}
    return Settings(**{field.name: known[field.name] for field in fields(Settings)})


def _positive(text: str) -> float:
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def _frames(text: str) -> tuple[int | None, int | None]:
    first, colon, last = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return (int(first) if first else None, int(last) if last else None)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B, for example 100:900") from error


def prepared(motion: SkeletonMotion, settings: Settings, *, holds_gaps: bool, up: str) -> SkeletonMotion:
    """The motion as a format is to write it: range, times, gaps, rate, rig and upright world.

    holds_gaps : whether the format has a place for a frame without a pose; then `refuse` keeps gaps (NaN).
    up : y or z, the axis of the file that points up, empty for the transmitter's own frame. Still in mm.
    Raises InputError as the parts do.
    """
    from shukotsu.stages.export.axes import turned, upright
    from shukotsu.stages.export.gaps import closed
    from shukotsu.stages.export.motion import stiffened
    from shukotsu.stages.export.resampling import in_range, resampled, with_rate
    from shukotsu.stages.export.rigging import on_rig

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
    from shukotsu.errors import InputError

    if not motion.whole.all():
        row = int(motion.whole.argmin())
        raise InputError(
            f"--fps: nothing was recorded about {motion.time_s[row]:.3f} s (frame {motion.frame[row]}) for "
            "more than 1.5 usual intervals; use --gaps interpolate with a --max-gap-s that spans it"
        )


def _check_bones(motion: SkeletonMotion) -> None:
    """Refuse a bone without length: a joint after a digit's first that is where its parent is."""
    from shukotsu.errors import InputError

    for joint, offset in zip(motion.joints, motion.rest_offset_mm, strict=True):
        above = joint.parent
        if above > 0 and not float(offset @ offset) > 0:
            raise InputError(
                f"{motion.origin.recording.of_hand}: the bone from "
                f"{motion.names[above]} to {joint.name} has no length; look at its joints' status"
            )
