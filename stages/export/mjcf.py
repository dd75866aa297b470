"""MJCF: the skeleton for MuJoCo; `<stem>_joints.csv` moves it.

A body has all the coordinates of its joint; tips are sites. Capsules collide but with those of the bones next
to them, which overlap. The first frame is the key `start`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations
from pathlib import Path

from shukotsu.stages.export.axes import DIRECTIONS, Target
from shukotsu.stages.export.motion import SkeletonMotion
from shukotsu.stages.export.opensim_model import metres, numbers
from shukotsu.stages.export.robot_tree import Tree, axes_of, tree_of, write_files

_G_M_S2 = 9.80665
_SITE_MM = 2.0


def write(motion: SkeletonMotion, target: Target, path: Path) -> tuple[str, ...]:
    """Write `path` (.xml) and its joints' values; give what they do not hold.

    Raises InputError where a pose is missing, there is no frame, or times do not grow.
    """
    tree = tree_of(motion, path, "MJCF")
    model = ET.Element("mujoco", model=tree.title)
    ET.SubElement(model, "compiler", angle="radian", autolimits="true")
    ET.SubElement(model, "option", gravity=numbers(-_G_M_S2 * DIRECTIONS[target.up]))
    elements = [ET.SubElement(model, "worldbody")]  # the world's, then each form's
    for place in range(len(tree.forms)):
        elements.append(_body(elements[tree.forms[place].parent + 1], tree, place))
    for name, carrier, at_mm in tree.tips:
        at = {"pos": metres(at_mm), "size": metres(_SITE_MM)}
        ET.SubElement(elements[tree.forms.index(carrier) + 1], "site", {"name": name, **at})
    contact = ET.SubElement(model, "contact")
    for first, second in combinations(tree.forms, 2):
        if first.parent == second.parent:
            ET.SubElement(contact, "exclude", body1=first.body, body2=second.body)
    start = [axis.values[0] for form in tree.forms for axis in axes_of(form)]
    ET.SubElement(ET.SubElement(model, "keyframe"), "key", name="start", qpos=numbers(start))
    write_files(tree, model, motion, target, path)
    return tree.remarks


def _body(parent: ET.Element, tree: Tree, place: int) -> ET.Element:
    form, own = tree.forms[place], tree.bodies[place]
    frame = {"pos": metres(form.offset_mm), "quat": numbers(form.quaternion)}
    body = ET.SubElement(parent, "body", {"name": form.body, **frame})
    inertia = " ".join(f"{value:.9g}" for value in own.inertia_kg_m2)
    mass = f"{own.mass_kg:.9g}"
    ET.SubElement(body, "inertial", pos=metres(own.middle_mm), mass=mass, diaginertia=inertia)
    for axis in axes_of(form):
        about = {"type": "hinge" if axis.turns else "slide", "axis": numbers(axis.axis)}
        low, high = axis.limits
        limits = {"range": f"{low:.12g} {high:.12g}"} if high > low else {}
        ET.SubElement(body, "joint", {"name": axis.coordinate.name, **about, **limits})
    for capsule in tree.capsules_mm[place]:
        ET.SubElement(
            body, "geom", type="capsule", fromto=metres(capsule.ravel()), size=metres(own.capsule_mm)
        )
    return body
