"""The formats that an export can be written in: one table, an entry each, and how one is written.

The module of a format has `write(motion, path)`, which gets the motion ready (by `settings.prepared`: gaps,
rate, rig, world upright) and the path of its main file; files beside it have the same stem. It returns
sentences on what the file does not hold. It raises InputError where a motion cannot be written, and writes
files whole or not at all (`files.whole_files`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shukotsu.skeleton.posing import PosedRecording
    from shukotsu.stages.export.settings import Settings


@dataclass(frozen=True)
class Format:
    """A format, as the command line and the other formats' neighbours need to know it.

    module : which writes it, by its whole name, for the workflow to know that it belongs to the stage.
    extensions : of all its files, the main one first. up : the axis that points up in it; none: it is in the
    transmitter's frame. holds_gaps : whether it has a place for a frame without a pose. drops : what it never
    holds. shared : where one set of files serves all recordings, its main file's path in the output folder.
    holds_receivers : whether receivers are in it at all.
    """

    what: str
    module: str
    extensions: tuple[str, ...]
    up: str
    drops: str
    holds_gaps: bool = False
    shared: str = ""
    holds_receivers: bool = False

    @property
    def writers(self) -> Any:
        """The module with `write`, imported when it is needed: a start should not wait for all formats."""
        return import_module(self.module)


FORMATS: Mapping[str, Format] = {
    "bvh": Format(
        "animation programs: skeleton and motion",
        "shukotsu.stages.export.bvh",
        (".bvh",),
        "y",
        "device times, frame numbers, receivers, joint axes",
    ),
    "glb": Format(
        "web pages, XR, game engines, Blender: a body of bones that moves",
        "shukotsu.stages.export.glb",
        (".glb",),
        "y",
        "frame numbers but the first, receivers",
    ),
    "osim": Format(
        "OpenSim: model, motion, markers, inverse kinematics",
        "shukotsu.stages.export.opensim",
        (".osim", ".mot", ".trc", "_ik.osim", "_ik_setup.xml"),
        "y",
        "frame numbers, muscles, forces",
        holds_receivers=True,
    ),
    "c3d": Format(
        "motion-capture programs: joints and receivers, points and poses",
        "shukotsu.stages.export.c3d_file",
        (".c3d",),
        "z",
        "device times, joint axes, joint angles",
        holds_gaps=True,
        holds_receivers=True,
    ),
    "bids": Format(
        "Motion-BIDS: a dataset of all recordings",
        "shukotsu.stages.export.motion_bids",
        ("_motion.tsv", "_motion.json", "_channels.tsv", "_channels.json"),
        "",
        "joint axes",
        holds_gaps=True,
        shared="bids/dataset_description.json",
        holds_receivers=True,
    ),
    "csv": Format(
        "anything that reads tables: a row a frame and joint, and angles",
        "shukotsu.stages.export.tidy_csv",
        (".csv", "_angles.csv", ".json"),
        "",
        "receivers",
        holds_gaps=True,
    ),
}

DESCRIPTION = "Write a person's skeletons and their motion for other programs.\n\nformats:" + "".join(
    f"\n  {name:6}{form.what}" for name, form in FORMATS.items()
)


def chosen_formats(names_list: str) -> list[str]:
    """Return names from a comma-separated list, each once; InputError where one is no format."""
    from shukotsu.errors import InputError
    from shukotsu.schemas.left import instead

    names = list(dict.fromkeys(name.strip() for name in names_list.split(",") if name.strip()))
    unknown = [name for name in names if name not in FORMATS]
    if unknown or not names:
        if why := instead("export", unknown[0] if unknown else ""):
            raise InputError(f"--formats: {why}")
        raise InputError(
            f"--formats: {unknown[0] if unknown else 'nothing'!r} is no format; expected one or more of "
            f"{', '.join(FORMATS)}, joined by commas"
        )
    return names


def write_format(motion: PosedRecording, settings: Settings, name: str, path: Path) -> tuple[str, ...]:
    """Write a motion as it was read into a file of one of FORMATS.

    Returns what was done to it and what the file lacks. Raises InputError as getting ready and writing do.
    """
    import numpy as np

    from shukotsu.stages.export.motion import with_receivers
    from shukotsu.stages.export.settings import prepared

    chosen = FORMATS[name]
    if not chosen.holds_receivers:
        motion = with_receivers(motion, np.zeros(len(motion.receivers.segments), bool))
    ready = prepared(motion, settings, holds_gaps=chosen.holds_gaps, up=chosen.up)
    dropped = chosen.writers.write(ready, path)
    return (*ready.notes[len(motion.notes) :], f"not in the file: {chosen.drops}", *dropped)
