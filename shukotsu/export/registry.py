"""Registry of the export formats, with their options.

The module of a format has a function `write(motion, path)`. It is passed the motion after `prepare` (gaps,
rate, rig, upright world) and the path of its main file; its other files have the same stem. It returns
sentences on what the files lack, raises InputError if the motion cannot be written, and writes files
atomically (`tables.whole_files`).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.errors import InputError
from shukotsu.study.config_files import export_constants

if TYPE_CHECKING:
    from shukotsu.hand.posing import PosedRecording
    from shukotsu.hand.rotations import Array

DIRECTIONS = ("x", "y", "z", "-x", "-y", "-z")


@dataclass(frozen=True)
class ExportSettings:
    """Settings from the command line.

    transmitter_up : axis of the transmitter's frame that points up. gaps, max_gap_s : see `export.gaps`.
    rig : rig whose names to use, or empty for the layout's names. stiff : whether to keep bones at their
    length. fps : rate to resample to, or None.
    """

    transmitter_up: str = "z"
    gaps: str = "refuse"
    max_gap_s: float = 0.1
    rig: str = ""
    stiff: bool = False
    fps: float | None = None


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of an export; `settings_of` reads those that state how to prepare a motion."""
    where = "[STUDY]" if parser.prog == "shukotsu export" else "--plan PLAN ..."
    parser.usage = f"{parser.prog} {where} --formats NAMES --out FOLDER [options]"
    add = parser.add_argument
    add("--hand", choices=("right", "left"), default="", help="which hand (default: each)")
    name = "the task, or TASK_TRIAL (default: all evaluated ones)"
    add("--recording", default="", metavar="NAME", help=name)
    add("--model", "--models", default="", metavar="NAMES", help="models, separated by commas (default: all)")
    add("--formats", required=True, metavar="NAMES", help="formats from the list above, separated by commas")
    add("--out", type=Path, required=True, metavar="FOLDER", help="the folder to write to")
    add("--participants", type=Path, metavar="SHEET", help="the study's participants sheet, for bids")
    add("--licence", default="", help="the terms of use to state in every file")
    add("--fps", type=_positive, help="frames per second to resample to (default: as recorded)")
    add("--frames", type=_frames, default=(None, None), metavar="A:B", help="recorded frame numbers")
    up = "upward axis of the transmitter, such as =-z"
    add("--transmitter-up", choices=DIRECTIONS, default="z", metavar="AXIS", help=up)
    policies = ("refuse", "hold", "cut", "interpolate")
    gaps = f"for frames without a pose: {', '.join(policies)}"
    add("--gaps", choices=policies, default="refuse", metavar="HOW", help=gaps)
    add("--max-gap-s", type=_positive, default=0.1, metavar="S", help="longest gap to interpolate (0.1)")
    add("--rig", default="", help="joint names of webxr, vrm, unity, unreal or mixamo")
    stiff = "stiff: keep bone lengths constant"
    add("--bones", choices=("exact", "stiff"), default="exact", metavar="HOW", help=stiff)


def settings_of(arguments: argparse.Namespace) -> ExportSettings:
    """Return the settings from the options of `add_options`."""
    options = vars(arguments) | {"stiff": arguments.bones == "stiff"}
    return ExportSettings(**{field.name: options[field.name] for field in fields(ExportSettings)})


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


def prepare(motion: PosedRecording, settings: ExportSettings, *, holds_gaps: bool, up: str) -> PosedRecording:
    """Prepare the motion for a format: close gaps, resample, apply a rig and turn the world upright.

    holds_gaps : whether the format can represent a frame without a pose; if so, `refuse` keeps gaps (NaN). up
    : y or z, the axis of the file that points up, or empty for the transmitter's frame. Lengths stay in mm.
    Raises InputError if a step is impossible.
    """
    from shukotsu.export.exported_motion import stiffen, with_unmeasured_at_rest
    from shukotsu.export.gaps import close_gaps, resample_evenly
    from shukotsu.export.rigging import on_rig
    from shukotsu.hand.rotations import multiply, rotate

    if not (holds_gaps and settings.gaps == "refuse"):
        motion = close_gaps(with_unmeasured_at_rest(motion), settings.gaps, settings.max_gap_s)
    if settings.fps is not None:
        widest_s = settings.max_gap_s if settings.gaps == "interpolate" else 0.0
        motion = resample_evenly(motion, settings.fps, widest_s)
    if not holds_gaps and not motion.whole.all():  # the recording stood still for long
        row = int(motion.whole.argmin())
        raise InputError(
            f"--fps: nothing was recorded about {motion.time_s[row]:.3f} s (frame {motion.frame[row]}) for "
            "more than 1.5 usual intervals; use --gaps interpolate with a --max-gap-s that spans it"
        )
    if settings.rig:
        motion = on_rig(motion, settings.rig)
    if settings.stiff:
        motion = stiffen(motion)
    if not up:
        return motion
    turn = upright(settings.transmitter_up, up)
    return motion.mapped(lambda mm: rotate(turn, mm), lambda bones: multiply(turn, bones))


def upright(transmitter_up: str, up: str) -> Array:
    """Return the smallest rotation (4,) that takes the transmitter's upward axis to the file's.

    transmitter_up, up : the axes that point up in the transmitter's frame and in the file. A rotation of 180
    deg is about x. Nothing is mirrored: a left hand stays a left hand.
    """
    import numpy as np

    from shukotsu.export.kinematic_tree import shortest_turn

    signed = dict(zip(DIRECTIONS, np.concatenate([np.eye(3), -np.eye(3)]), strict=True))
    return shortest_turn(signed[transmitter_up], signed[up])


@dataclass(frozen=True)
class ExportFormat:
    """An export format.

    Attributes
    ----------
    what
        Description in one line.
    module
        Full name of the module that writes it.
    extensions
        Endings of its files, the main file's first.
    up
        The axis that points up in its files; empty if they are in the transmitter's frame.
    drops
        What its files never contain.
    holds_gaps
        Whether it can represent a frame without a pose.
    shared
        For a format with one set of files for all recordings, the path of its main file in the output folder;
        else empty.

    """

    what: str
    module: str
    extensions: tuple[str, ...]
    up: str
    drops: str
    holds_gaps: bool = False
    shared: str = ""

    @property
    def writers(self) -> Any:
        """The module with `write`, imported when it is first needed."""
        return import_module(self.module)


FORMATS: Mapping[str, ExportFormat] = {
    name: ExportFormat(**keys) for name, keys in export_constants()["formats"].items()
}

DESCRIPTION = "Write a person's skeletons and their motion for other programs.\n\nformats:" + "".join(
    f"\n  {name:{max(map(len, FORMATS)) + 2}}{form.what}" for name, form in FORMATS.items()
)


def chosen_formats(names_list: str) -> list[str]:
    """Return the formats in a comma-separated list. Raises InputError if one is unknown or repeated."""
    names = [name.strip() for name in names_list.split(",") if name.strip()]
    if twice := [name for name in FORMATS if names.count(name) > 1]:
        raise InputError(f"--formats: {twice[0]} is listed twice; list each format once")
    unknown = [name for name in names if name not in FORMATS]
    if unknown or not names:
        raise InputError(
            f"--formats: {unknown[0] if unknown else 'nothing'!r} is not a format; expected one or more of "
            f"{', '.join(FORMATS)}, separated by commas"
        )
    return names


def write_format(motion: PosedRecording, settings: ExportSettings, name: str, path: Path) -> tuple[str, ...]:
    """Prepare a motion and write it in one of FORMATS.

    Returns notes on what was done to it and what the file lacks. Raises InputError if the motion cannot be
    prepared or written.
    """
    chosen = FORMATS[name]
    ready = prepare(motion, settings, holds_gaps=chosen.holds_gaps, up=chosen.up)
    dropped = chosen.writers.write(ready, path)
    return (*ready.notes[len(motion.notes) :], f"not in the file: {chosen.drops}", *dropped)
