"""The formats that an export can be written in: one table, a line each.

A format's writer gets the motion ready (`stages.export.settings.prepared`: range, gaps, rate, rig, world
upright), what its numbers are to be told in, and the path of its main file; files beside it have the same
stem. It gives sentences on what the file does not hold. It raises InputError where a motion cannot be
written, and writes files whole or not at all (`schemas.files`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stages.export.motion import SkeletonMotion


@dataclass(frozen=True)
class Target:
    """What a file's numbers mean: its unit of length (m, cm or mm) and the axis that points up.

    up : y or z, or empty where the file is in the transmitter's own frame.
    """

    unit: str
    up: str


Writer = Callable[["SkeletonMotion", Target, Path], tuple[str, ...]]
SceneWriter = Callable[[Sequence["SkeletonMotion"], Target, Path], tuple[str, ...]]


@dataclass(frozen=True)
class Format:
    """A format, as the command line and the other formats' neighbours need to know it.

    extensions : of all its files, the main one first. units, ups : which it can be written in, its own
    choice first; no ups: in the transmitter's frame. holds_gaps : whether it has a place for a frame without
    a pose. embeds_note : whether its writer puts provenance and notes into the file; else a text file beside
    it has them. drops : what it never holds, in words. shared : where one set of files serves all
    recordings, its main file's path in the folder of exports. write_scene : the writer of several hands in
    one file, of a format that can hold them.
    """

    what: str
    extensions: tuple[str, ...]
    units: tuple[str, ...]
    ups: tuple[str, ...]
    write: Writer
    holds_gaps: bool
    embeds_note: bool
    drops: str
    shared: str = ""
    write_scene: SceneWriter | None = None

    def target(self, unit: str, up: str) -> Target:
        """What the file is written in where the user asks for that unit and axis, or for none (empty)."""
        return Target(
            unit if unit in self.units else self.units[0],
            up if up in self.ups else (self.ups[0] if self.ups else ""),
        )


def _bvh(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.bvh import write

    return write(motion, target, path)


def _glb(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.glb import write

    return write(motion, target, path)


def _glb_scene(motions: Sequence[SkeletonMotion], target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.glb import write_scene

    return write_scene(motions, target, path)


def _osim(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.opensim import write

    return write(motion, target, path)


def _c3d(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.c3d_file import write

    return write(motion, target, path)


def _bids(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.motion_bids import write

    return write(motion, target, path)


def _csv(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.tidy_csv import write

    return write(motion, target, path)


def _usd(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.usd import write

    return write(motion, target, path)


def _usd_scene(motions: Sequence[SkeletonMotion], target: Target, path: Path) -> tuple[str, ...]:
    from stages.export.usd import write_scene

    return write_scene(motions, target, path)


FORMATS: Mapping[str, Format] = {
    "bvh": Format(
        "skeleton and motion for animation programs",
        (".bvh",),
        ("cm", "m", "mm"),
        ("y", "z"),
        _bvh,
        holds_gaps=False,
        embeds_note=False,
        drops="device times, frame numbers, receivers, joint axes",
    ),
    "glb": Format(
        "skeleton, a body of bones and motion for web pages, XR, game engines and Blender",
        (".glb",),
        ("m",),
        ("y",),
        _glb,
        holds_gaps=False,
        embeds_note=True,
        drops="frame numbers but the first, receivers",
        write_scene=_glb_scene,
    ),
    "osim": Format(
        "skeleton, motion, markers and inverse kinematics for OpenSim",
        (".osim", ".mot", ".trc", "_ik.osim", "_ik_setup.xml"),
        ("m",),
        ("y",),
        _osim,
        holds_gaps=False,
        embeds_note=True,
        drops="frame numbers, muscles, forces",
    ),
    "c3d": Format(
        "joints and receivers as points and poses, for motion-capture programs",
        (".c3d",),
        ("mm", "m"),
        ("z", "y"),
        _c3d,
        holds_gaps=True,
        embeds_note=True,
        drops="device times, joint axes, joint angles",
    ),
    "bids": Format(
        "a Motion-BIDS dataset of all recordings, for neuroscience",
        ("_motion.tsv", "_motion.json", "_channels.tsv", "_channels.json"),
        ("m",),
        (),
        _bids,
        holds_gaps=True,
        embeds_note=True,
        drops="joint axes",
        shared="bids/dataset_description.json",
    ),
    "csv": Format(
        "one row a frame and joint, for anything that reads tables",
        (".csv", "_angles.csv", ".json"),
        ("mm",),
        (),
        _csv,
        holds_gaps=True,
        embeds_note=True,
        drops="receivers",
    ),
    "usd": Format(
        "skeleton, a body of bones and motion for film, Omniverse and Blender",
        (".usda",),
        ("m", "cm", "mm"),
        ("y", "z"),
        _usd,
        holds_gaps=False,
        embeds_note=True,
        drops="frame numbers but the first, receivers",
        write_scene=_usd_scene,
    ),
}
