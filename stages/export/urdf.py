"""URDF: the skeleton for programs of robotics; `<stem>_joints.csv` moves it.

A link is a body, or stands between two coordinates of a joint; tips are links without a body.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.export.axes import Target
from shukotsu.stages.export.bvh import euler_zyx_deg
from shukotsu.stages.export.kinematic_tree import IDENTITY, Body, JointForm, shortest_turn
from shukotsu.stages.export.motion import SkeletonMotion
from shukotsu.stages.export.opensim_model import metres, numbers
from shukotsu.stages.export.robot_tree import WORLD, Axis, Tree, axes_of, tree_of, write_files

_UNLIMITED = {"effort": "1000", "velocity": "1000"}
"""URDF wants limits of both; nothing is known of either."""

_ALONG_Z = np.array([0.0, 0.0, 1.0])


def write(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    """Write `path` (.urdf) and its joints' values; give what they do not hold.

    Raises InputError where a pose is missing, there is no frame, or times do not grow.
    """
    tree = tree_of(motion, path, "URDF")
    robot = ET.Element("robot", name=tree.title)
    ET.SubElement(robot, "link", name=WORLD)
    for form, body, capsules in zip(tree.forms, tree.bodies, tree.capsules_mm, strict=True):
        _add_joints(robot, tree, form)
        _add_link(robot, form.body, body, capsules)
    for name, carrier, place in tree.tips:
        ET.SubElement(robot, "link", name=name)
        joint = ET.SubElement(robot, "joint", name=f"{name}_fixed", type="fixed")
        _connect(joint, carrier.body, name, place, IDENTITY)
    write_files(tree, robot, motion, target, path)
    return tree.remarks


def _add_joints(robot: ET.Element, tree: Tree, form: JointForm) -> None:
    """Add a joint for every coordinate from the parent's link to the body's, and the links between them."""
    before = WORLD if form.parent < 0 else tree.forms[form.parent].body
    place, turn = form.offset_mm, form.quaternion
    axes = axes_of(form)
    for axis in axes:
        name = axis.coordinate.name
        after = tree.links.get(name, form.body)
        if after != form.body:
            ET.SubElement(robot, "link", name=after)
        joint = ET.SubElement(robot, "joint", name=name, type="revolute" if axis.turns else "prismatic")
        _connect(joint, before, after, place, turn)
        _limit(joint, axis)
        before, place, turn = after, np.zeros(3), IDENTITY
    if not axes:
        joint = ET.SubElement(robot, "joint", name=form.name, type="fixed")
        _connect(joint, before, form.body, place, turn)


def _connect(joint: ET.Element, before: str, after: str, place_mm: Array, turn: Array) -> None:
    _add_origin(joint, place_mm, turn)
    ET.SubElement(joint, "parent", link=before)
    ET.SubElement(joint, "child", link=after)


def _add_origin(parent: ET.Element, place_mm: Array, turn: Array) -> None:
    yaw_pitch_roll = np.radians(euler_zyx_deg(turn[None])[0])
    ET.SubElement(parent, "origin", xyz=metres(place_mm), rpy=numbers(yaw_pitch_roll[::-1]))


def _limit(joint: ET.Element, axis: Axis) -> None:
    low, high = axis.limits
    ET.SubElement(joint, "axis", xyz=numbers(axis.axis))
    ET.SubElement(joint, "limit", {"lower": f"{low:.12g}", "upper": f"{high:.12g}", **_UNLIMITED})


def _add_link(robot: ET.Element, name: str, body: Body, capsules: tuple[Array, ...]) -> None:
    """Add a body; a capsule is a cylinder and two balls, for URDF has none."""
    link = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    _add_origin(inertial, body.middle_mm, IDENTITY)
    ET.SubElement(inertial, "mass", value=f"{body.mass_kg:.9g}")
    x, y, z = (f"{value:.9g}" for value in body.inertia_kg_m2)
    ET.SubElement(inertial, "inertia", ixx=x, iyy=y, izz=z, ixy="0", ixz="0", iyz="0")
    radius = metres(body.capsule_mm)
    for start, end in capsules:
        length = float(np.linalg.norm(end - start))
        turn = shortest_turn(_ALONG_Z, (end - start) / length)
        cylinder = ("cylinder", {"radius": radius, "length": metres(length)})
        ball = ("sphere", {"radius": radius})
        for place, (shape, size) in (((start + end) / 2, cylinder), (start, ball), (end, ball)):
            for use in ("visual", "collision"):
                element = ET.SubElement(link, use)
                _add_origin(element, place, turn if shape == "cylinder" else IDENTITY)
                ET.SubElement(ET.SubElement(element, "geometry"), shape, size)
