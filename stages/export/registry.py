"""The formats that an export can be written in: one table, an entry each, and how one is written.

The module of a format has `write(motion, target, path)`, which gets the motion ready
(`stages.export.settings.prepared`: range, gaps, rate, rig, world upright), what its numbers are to be told
in, and the path of its main file; files beside it have the same stem. It gives sentences on what the file
does not hold. It raises InputError where a motion cannot be written, and writes files whole or not at all
(`files.whole_files`). Of a format that holds several hands it also has `write_scene(motions, target, path)`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shukotsu.stages.export.axes import Target
    from shukotsu.stages.export.motion import SkeletonMotion
    from shukotsu.stages.export.settings import Settings


@dataclass(frozen=True)
class Format:
    """A format, as the command line and the other formats' neighbours need to know it.

    module : which writes it, by its whole name, for the workflow to know that it belongs to the stage.
    extensions : of all its files, the main one first.
    units, ups : which it can be written in, its own choice first; no ups: in the transmitter's frame.
    holds_gaps : whether it has a place for a frame without a pose. drops : what it never holds.
    embeds_facts : whether its writer puts provenance and notes into the file; else a text file beside it has
    them. shared : where one set of files serves all recordings, its main file's path in the output folder.
    holds_hands : whether several hands can be in one file. holds_receivers : whether they are in it at all.
    """

    what: str
    module: str
    extensions: tuple[str, ...]
    units: tuple[str, ...]
    ups: tuple[str, ...]
    drops: str
    holds_gaps: bool = False
    embeds_facts: bool = True
    shared: str = ""
    holds_hands: bool = False
    holds_receivers: bool = False

    def target(self, unit: str, up: str) -> Target:
        """Return the file's unit and axis: those that the user asks for if there are such, else its first."""
        from shukotsu.stages.export.axes import Target

        return Target(
            unit if unit in self.units else self.units[0],
            up if up in self.ups else (self.ups[0] if self.ups else ""),
        )

    @property
    def writers(self) -> Any:
        """The module with `write`, imported when it is needed: a start should not wait for all formats."""
        return import_module(self.module)


FORMATS: Mapping[str, Format] = {
    "bvh": Format(
        "skeleton and motion for animation programs",
        "shukotsu.stages.export.bvh",
        (".bvh",),
        ("cm", "m", "mm"),
        ("y", "z"),
        "device times, frame numbers, receivers, joint axes",
        embeds_facts=False,
    ),
    "glb": Format(
        "skeleton, a body of bones and motion for web pages, XR, game engines and Blender",
        "shukotsu.stages.export.glb",
        (".glb",),
        ("m",),
        ("y",),
        "frame numbers but the first, receivers",
        holds_hands=True,
    ),
    "osim": Format(
        "skeleton, motion, markers and inverse kinematics for OpenSim",
        "shukotsu.stages.export.opensim",
        (".osim", ".mot", ".trc", "_ik.osim", "_ik_setup.xml"),
        ("m",),
        ("y",),
        "frame numbers, muscles, forces",
        holds_receivers=True,
    ),
    "c3d": Format(
        "joints and receivers as points and poses, for motion-capture programs",
        "shukotsu.stages.export.c3d_file",
        (".c3d",),
        ("mm", "m"),
        ("z", "y"),
        "device times, joint axes, joint angles",
        holds_gaps=True,
        holds_receivers=True,
    ),
    "bids": Format(
        "a Motion-BIDS dataset of all recordings, for neuroscience",
        "shukotsu.stages.export.motion_bids",
        ("_motion.tsv", "_motion.json", "_channels.tsv", "_channels.json"),
        ("m",),
        (),
        "joint axes",
        holds_gaps=True,
        shared="bids/dataset_description.json",
        holds_receivers=True,
    ),
    "csv": Format(
        "one row a frame and joint, for anything that reads tables",
        "shukotsu.stages.export.tidy_csv",
        (".csv", "_angles.csv", ".json"),
        ("mm",),
        (),
        "receivers",
        holds_gaps=True,
    ),
}


def chosen_formats(names_list: str) -> list[str]:
    """Names from a comma-separated list, each once; InputError where one is no format."""
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


def write_format(
    motions: Sequence[SkeletonMotion], settings: Settings, name: str, path: Path
) -> tuple[str, ...]:
    """Write motions as they were read, one a hand, into a file of one of FORMATS.

    Give what was done to them and what the file lacks. Raises InputError where the format holds one hand and
    there are several, and as getting ready and writing do.
    """
    from shukotsu.errors import InputError
    from shukotsu.files.whole_files import write_text
    from shukotsu.stages.export.file_facts import facts_text
    from shukotsu.stages.export.motion import without_receivers
    from shukotsu.stages.export.settings import prepared

    chosen = FORMATS[name]
    if len(motions) > 1 and not chosen.holds_hands:
        raise InputError(f"--hand both: {name} holds one hand a file; choose --hand right or --hand left")
    target = chosen.target(settings.unit, settings.up)
    if not chosen.holds_receivers:
        motions = [without_receivers(motion) for motion in motions]
    ready = [prepared(motion, settings, holds_gaps=chosen.holds_gaps, up=target.up) for motion in motions]
    if len(ready) > 1:
        dropped = chosen.writers.write_scene(ready, target, path)
    else:
        dropped = chosen.writers.write(ready[0], target, path)
    if not chosen.embeds_facts:
        write_text(path.with_name(f"{path.name}.txt"), facts_text(ready[0], target, (chosen.drops, *dropped)))
    changes = (
        note for own, motion in zip(ready, motions, strict=True) for note in own.notes[len(motion.notes) :]
    )
    return (*dict.fromkeys(changes), f"not in the file: {chosen.drops}", *dropped)
