"""The .osim file: bodies, joints, markers and shapes to look at, as XML that OpenSim 4 reads."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from shukotsu.skeleton.posing import PosedRecording
from shukotsu.skeleton.rotations import Array, matrix
from shukotsu.stages.export.kinematic_tree import (
    Body,
    JointForm,
    body_fixed_rad,
    body_of,
    fixed_points,
    shortest_turn,
)
from shukotsu.stages.export.opensim_markers import Triad

VERSION = "40600"
"""Of the XML, OpenSim 4.6; later ones read it as well."""

GRAVITY = (0.0, -9.80665, 0.0)
_ROOM_DEG = 30.0
_ROOM_MM = 10.0
_BONE_COLOUR = "0.94 0.89 0.78"
_JOINT_COLOUR = "0.55 0.60 0.68"
_RANGE_STEP_DEG = 10.0

_M_PER_MM = 1e-3
_Y = np.array([0.0, 1.0, 0.0])


def model_xml(
    motion: PosedRecording,
    forms: Sequence[JointForm],
    receivers: Sequence[Triad],
    title: str,
    credit: str,
    publications: str,
    held: Mapping[str, float],
) -> str:
    """The whole file. title : the model's name, ASCII. credit, publications : text of any script.

    held : coordinates that are locked, and where, rad or mm.
    """
    document = ET.Element("OpenSimDocument", Version=VERSION)
    model = add(
        document,
        "Model",
        title,
        credits=clean(credit),
        publications=clean(publications),
        length_units="meters",
        force_units="N",
        gravity=numbers(GRAVITY),
    )
    bodies, joints, markers = (
        ET.SubElement(ET.SubElement(model, kind, name=kind.lower()), "objects")
        for kind in ("BodySet", "JointSet", "MarkerSet")
    )
    for form in forms:
        _add_body(bodies, form, body_of(motion, form))
        _add_joint(joints, forms, form, held)
    for triad in receivers:
        for name, place in zip(triad.markers, triad.local_mm, strict=True):
            _add_marker(markers, name, forms[triad.form].body, place)
    taken = [name for triad in receivers for name in triad.markers]
    for name, form, place in fixed_points(motion, forms, taken):
        _add_marker(markers, name, form.body, place)
    return as_text(document)


def add(parent: ET.Element, tag: str, name: str, **properties: str) -> ET.Element:
    """Add an object of OpenSim: an element with a name, and in it one for every property."""
    element = ET.SubElement(parent, tag, name=name)
    for key, text in properties.items():
        ET.SubElement(element, key).text = text
    return element


def as_text(document: ET.Element) -> str:
    """XML with a declaration, indented by tabs."""
    ET.indent(document, "\t")
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ET.tostring(document, "unicode") + "\n"


def numbers(values: Iterable[float]) -> str:
    """Write numbers to 12 digits, blanks between them."""
    return " ".join(f"{round(float(value), 12) + 0.0:.12g}" for value in values)


def metres(lengths_mm: Array | float) -> str:
    """Write lengths in metres."""
    return numbers(np.atleast_1d(lengths_mm) * _M_PER_MM)


def clean(text: str) -> str:
    """Text without the control characters that XML cannot hold."""
    return "".join(c if c in "\n\t" or (c.isprintable() or c == " ") else "?" for c in text)


def _add_body(parent: ET.Element, form: JointForm, own: Body) -> None:
    body = ET.SubElement(parent, "Body", name=form.body)
    if len(own.spans_mm):
        components = ET.SubElement(body, "components")
        for number, span in enumerate(own.spans_mm, 1):
            _add_bone_shape(components, number, span)
    _add_shape(body, "Sphere", "joint_shape", _JOINT_COLOUR, radius=metres(0.06 * own.length_mm))
    ET.SubElement(body, "mass").text = numbers([own.mass_kg])
    ET.SubElement(body, "mass_center").text = metres(own.middle_mm)
    ET.SubElement(body, "inertia").text = " ".join(f"{value:.9g}" for value in (*own.inertia_kg_m2, 0, 0, 0))


def _add_bone_shape(parent: ET.Element, number: int, span_mm: Array) -> None:
    """A cylinder from the joint to the next; OpenSim's stand along Y."""
    length = float(np.linalg.norm(span_mm))
    frame = ET.SubElement(parent, "PhysicalOffsetFrame", name=f"bone{number}")
    size = {"radius": metres(0.08 * length), "half_height": metres(0.46 * length)}
    _add_shape(frame, "Cylinder", "shape", _BONE_COLOUR, **size)
    ET.SubElement(frame, "socket_parent").text = ".."
    ET.SubElement(frame, "translation").text = metres(span_mm / 2)
    turn = body_fixed_rad(matrix(shortest_turn(_Y, span_mm / length)))
    ET.SubElement(frame, "orientation").text = numbers(turn)


def _add_shape(parent: ET.Element, kind: str, name: str, colour: str, **size: str) -> None:
    shapes = ET.SubElement(parent, "attached_geometry")
    shape = add(shapes, kind, name, socket_frame="..", scale_factors="1 1 1")
    look = ET.SubElement(shape, "Appearance")
    ET.SubElement(look, "opacity").text = "1"
    ET.SubElement(look, "color").text = colour
    for key, text in size.items():
        ET.SubElement(shape, key).text = text


def _add_joint(
    parent: ET.Element, forms: Sequence[JointForm], form: JointForm, held: Mapping[str, float]
) -> None:
    kind = "CustomJoint" if form.coordinates else "WeldJoint"
    before = "/ground" if form.parent < 0 else f"/bodyset/{forms[form.parent].body}"
    frame_name = f"{form.name}_frame"
    sockets = {"socket_parent_frame": frame_name, "socket_child_frame": f"/bodyset/{form.body}"}
    joint = add(parent, kind, form.name, **sockets)
    if form.coordinates:
        coordinates = ET.SubElement(joint, "coordinates")
        for turn in form.turns:
            start = held.get(turn.name, float(turn.values[0]))
            limits = np.radians(_range(np.degrees(turn.values), _RANGE_STEP_DEG, _ROOM_DEG))
            _add_coordinate(coordinates, turn.name, limits, start, turn.name in held)
        for shift in form.shifts:
            start = float(shift.values[0]) if form.parent < 0 else held.get(shift.name, 0.0)
            locked = shift.name in held
            limits = np.multiply(_range(shift.values, _ROOM_MM, _ROOM_MM), _M_PER_MM)
            _add_coordinate(coordinates, shift.name, limits, start * _M_PER_MM, locked)
    add(
        ET.SubElement(joint, "frames"),
        "PhysicalOffsetFrame",
        frame_name,
        socket_parent=before,
        translation=metres(form.offset_mm),
        orientation=numbers(body_fixed_rad(matrix(form.quaternion))),
    )
    if form.coordinates:
        _add_spatial_transform(joint, form)


def _add_coordinate(parent: ET.Element, name: str, limits: Array, start: float, locked: bool) -> None:
    values = {"default_value": numbers([start]), "range": numbers(limits)}
    add(parent, "Coordinate", name, **values, clamped="false", locked="true" if locked else "false")


def _range(values: Array, step: float, room: float) -> tuple[float, float]:
    """Slider's range, in whole steps: the motion's and some room."""
    return (
        float(np.floor((values.min() - room) / step) * step),
        float(np.ceil((values.max() + room) / step) * step),
    )


def _add_spatial_transform(joint: ET.Element, form: JointForm) -> None:
    transform = ET.SubElement(joint, "SpatialTransform")
    for kind, used, axes in (("rotation", form.turns, form.axes), ("translation", form.shifts, np.eye(3))):
        for number, axis in enumerate(axes):
            name = used[number].name if number < len(used) else ""
            known = {"coordinates": name, "axis": numbers(axis)}
            element = add(transform, "TransformAxis", f"{kind}{number + 1}", **known)
            if name:
                add(element, "LinearFunction", "function", coefficients="1 0")
            else:
                add(element, "Constant", "function", value="0")


def _add_marker(parent: ET.Element, name: str, body: str, place_mm: Array) -> None:
    place = {"socket_parent_frame": f"/bodyset/{body}", "location": metres(place_mm)}
    add(parent, "Marker", name, **place, fixed="true")
