"""Options of the command lines that say how a motion is written."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stages.export.settings import Settings


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
    """The settings that the options of `add_motion_options` hold."""
    from stages.export.settings import Settings

    same = ("unit", "up", "transmitter_up", "gaps", "max_gap_s", "rig", "fps", "rate_hz")
    first, last = arguments.frames
    own = {name: getattr(arguments, name) for name in same}
    return Settings(stiff=arguments.bones == "stiff", first=first, last=last, **own)


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
