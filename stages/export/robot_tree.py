"""What URDF and MJCF share: the skeleton with names for all its frames, and its motion as a table beside it.

The world is the transmitter's frame, in metres and radians, and every coordinate of the tree that OpenSim
gets too (`kinematic_tree`) is a joint of one degree of freedom: of a joint with several, translations come
first, then turns, each carried by those before. The table has device time and every joint's value by its
name, so that forward kinematics gives the hand of the tables. Tips of bones and of the skin are frames that
the last bones carry.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from shukotsu.files.long_arrays import BLOCK_FRAMES
from shukotsu.files.whole_files import replacing, write_text
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.export.axes import Target
from shukotsu.stages.export.file_facts import facts_text
from shukotsu.stages.export.kinematic_tree import (
    Body,
    Coordinate,
    JointForm,
    body_of,
    fixed_points,
    joint_forms,
)
from shukotsu.stages.export.motion import SkeletonMotion, require_whole
from shukotsu.stages.export.opensim_model import as_text, clean
from shukotsu.stages.export.opensim_motion import seconds
from shukotsu.stages.export.rig_names import plain_names

WORLD = "transmitter"
NOMINAL = (
    "capsules, masses and inertias are nominal, by the bones' lengths; a joint's "
    "limits are what this recording reaches"
)
_M_PER_MM = 1e-3
_DECIMALS = 12


@dataclass(frozen=True)
class Tree:
    """A skeleton and its frames, every name once.

    forms : joints, parents first. bodies : what each carries. tips : name, carrier and place (3,) mm.
    capsules_mm : of each form its pairs of ends (2, 3). links : the frame after every coordinate but the last
    of a joint, whose frame is the body's. time_s : (T,). remarks : what the files do not hold.
    """

    title: str
    forms: tuple[JointForm, ...]
    bodies: tuple[Body, ...]
    tips: tuple[tuple[str, JointForm, Array], ...]
    capsules_mm: tuple[tuple[Array, ...], ...]
    links: dict[str, str]
    time_s: Array
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Axis:
    """A joint of one degree of freedom: its coordinate, its axis (3,) and whether it turns about it."""

    coordinate: Coordinate
    axis: Array
    turns: bool

    @property
    def values(self) -> Array:
        """Its value in every frame, (T,), rad or m, to what the table holds."""
        scale = 1.0 if self.turns else _M_PER_MM
        return np.asarray((self.coordinate.values * scale).round(_DECIMALS) + 0.0)

    @property
    def limits(self) -> tuple[float, float]:
        """The least and the most of them."""
        return float(self.values.min()), float(self.values.max())


def axes_of(form: JointForm) -> list[Axis]:
    """Give a joint's axes in the order in which they carry each other."""
    shifts = zip(form.shifts, np.eye(3), strict=False)
    turns = zip(form.turns, form.axes, strict=False)
    return [Axis(c, axis, False) for c, axis in shifts] + [Axis(c, axis, True) for c, axis in turns]


def tree_of(motion: SkeletonMotion, path: Path, program: str) -> Tree:
    """Give the tree of a motion that has no gap.

    Raises InputError where a pose is missing, there is no frame, or times do not grow.
    """
    require_whole(motion, path, program)
    time_s = seconds(motion, path, program)
    forms = joint_forms(motion)
    bodies = tuple(body_of(motion, form) for form in forms)
    between = [axis.coordinate.name for form in forms for axis in axes_of(form)[:-1]]
    taken = [WORLD, *(form.body for form in forms)]
    links = plain_names([*taken, *(f"{name}_link" for name in between)])[len(taken) :]
    tips = tuple(fixed_points(motion, forms, [*taken, *links]))
    return Tree(
        plain_names([path.stem])[0],
        forms,
        bodies,
        tips,
        tuple(_capsules(form, body, tips) for form, body in zip(forms, bodies, strict=True)),
        dict(zip(between, links, strict=True)),
        time_s,
        (NOMINAL,),
    )


def _capsules(
    form: JointForm, body: Body, tips: tuple[tuple[str, JointForm, Array], ...]
) -> tuple[Array, ...]:
    """Ends (2, 3) mm of the middle lines of a body's capsules; the last bone's ends round within the skin."""
    ends = [place for _, carrier, place in tips if carrier is form]
    if not ends:
        return tuple(np.stack([np.zeros(3), span]) for span in body.spans_mm)
    farthest = max(ends, key=lambda place: float(np.linalg.norm(place)))
    length = float(np.linalg.norm(farthest))
    share = max(0.0, 1 - body.capsule_mm / length) if length else 0.0
    return (np.stack([np.zeros(3), share * farthest]),) if share else ()


def write_files(tree: Tree, document: ET.Element, motion: SkeletonMotion, target: Target, path: Path) -> None:
    """Write the model with what it was made from as a comment, and its motion beside it."""
    credit = clean(facts_text(motion, target, tree.remarks)).replace("--", "- -")
    document.insert(0, ET.Comment(f"\n{credit}\n"))
    write_text(path, as_text(document))
    axes = [axis for form in tree.forms for axis in axes_of(form)]
    names = ["time_s", *(axis.coordinate.name for axis in axes)]
    columns = [tree.time_s, *(axis.values for axis in axes)]
    with replacing(path.with_name(f"{path.stem}_joints.csv")) as temporary, temporary.open("wb") as stream:
        stream.write((",".join(names) + "\n").encode("ascii"))
        for start in range(0, len(tree.time_s), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            table = pa.table([pa.array(column[rows]) for column in columns], names=names)
            pc.write_csv(table, stream, pc.WriteOptions(include_header=False))
