"""OpenSim: a person's skeleton as a model, its motion, its receivers as markers, and inverse kinematics.

There are five files with the same stem: `.osim`, the model; `.mot`, its coordinates over time, which put
every joint where the tables have it; `.trc`, the measured receivers, each as a group of four markers;
`_ik_setup.xml`, with which OpenSim computes the coordinates from the markers by inverse kinematics; and
`_ik.osim`, the model for this. The ground is the transmitter's frame with Y up. Units are metres and degrees,
for markers mm.

In `_ik.osim` the coordinates that markers do not determine are locked: the joints' translations, and the
axial rotation of bones without a receiver. In `.osim` they are free, because OpenSim silently ignores the
values of a locked coordinate when it plays a motion.

A triad is the markers of a receiver: its origin, and a point 10 mm along each of its axes. In the model it is
at its average position on the bone over the recording; in `.trc` it is where the receiver was measured. The
difference is due to skin motion and errors of the skeleton. `.mot` and `.trc` are tab-separated lines under a
header, with no more digits than needed.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from shukotsu.arrays import Array, Bools
from shukotsu.errors import count_of
from shukotsu.export import exported_motion
from shukotsu.export.delimited_text import write_rows
from shukotsu.export.exported_motion import ALONE_HZ, BLOCK_FRAMES, DISTAL, carrier
from shukotsu.export.kinematic_tree import JointForm, fixed_points, joint_forms, shortest_turn
from shukotsu.hand.posing import Origin, PosedRecording, known_points
from shukotsu.hand.rotations import body_fixed_rad, conjugate, matrix, mean_rotation, multiply, rotate, unit
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.poses import Poses
from shukotsu.tables.whole_files import write_text

ARM_MM = 10.0
POINTS_MM = np.vstack([np.zeros(3), ARM_MM * np.eye(3)])
POINTS = ("o", "x", "y", "z")
"""Names of the points of a triad, after the receiver's segment."""


@dataclass(frozen=True)
class Triad:
    """Markers of a receiver, and the body that carries it.

    segment : the segment that wears the receiver. form : index of the body's form. markers : names of the
    points. local_mm : (4, 3), the points in the bone's frame. receiver : index among the motion's receivers.
    spread_mm : RMS distance of the measured points from their positions on the bone.
    """

    segment: str
    form: int
    markers: tuple[str, ...]
    local_mm: Array
    receiver: int
    spread_mm: float

    def measured_mm(self, receivers: Poses) -> Array:
        """Return the measured points in the ground frame, (n, 12), mm; NaN if the receiver is not valid."""
        origin, turn = (values[:, self.receiver] for values in (receivers.position_mm, receivers.quaternion))
        return (origin[:, None] + rotate(turn[:, None], POINTS_MM)).reshape(-1, 12)


def triads(motion: PosedRecording, forms: tuple[JointForm, ...]) -> tuple[list[Triad], list[str]]:
    """Return the triads of all receivers on bones of the skeleton, and sentences on the other receivers."""
    receivers, placed, lost = motion.receivers, [], []
    carriers = {
        motion.joints[form.index].segment: position for position, form in reversed(list(enumerate(forms)))
    }
    names = exported_motion.plain_names(receivers.segments)
    for number, (segment, name) in enumerate(zip(receivers.segments, names, strict=True)):
        position, turn = receivers.position_mm[:, number], receivers.quaternion[:, number]
        seen = np.isfinite(position).all(-1) & np.isfinite(turn).all(-1)
        if segment not in carriers or not seen.any():
            why = "is on no bone of the skeleton" if segment not in carriers else "has no valid pose"
            lost.append(f"receiver {segment}, which {why}")
            continue
        form = carriers[segment]
        index = forms[form].index
        bone_mm, bone = motion.position_mm[:, index], motion.quaternion[:, index]
        back = conjugate(bone)
        origin = rotate(back, position - bone_mm)[seen].mean(0)
        local = origin + rotate(mean_rotation(multiply(back, turn)[seen]), POINTS_MM)
        measured_mm = position[:, None] + rotate(turn[:, None], POINTS_MM)
        beyond = (measured_mm - bone_mm[:, None] - rotate(bone[:, None], local))[seen]
        markers = tuple(f"{name}_{point}" for point in POINTS)
        spread = float(np.sqrt(np.mean(np.sum(beyond**2, -1))))
        placed.append(Triad(segment, form, markers, local, number, spread))
    return placed, lost


XML_VERSION = "40600"
"""Version of the XML format, that of OpenSim 4.6, which later versions can read."""

_ROOM_DEG = 30.0
_ROOM_MM = 10.0
_BONE_COLOUR = "0.94 0.89 0.78"
_JOINT_COLOUR = "0.55 0.60 0.68"
_RANGE_STEP_DEG = 10.0

TISSUE_KG_M3 = 1100.0
_SLENDER = 0.2
_THINNEST_MM = 6.0
_SHORTEST_MM = 10.0

_M_PER_MM = 1e-3
_Y = np.array([0.0, 1.0, 0.0])


def model_xml(
    motion: PosedRecording,
    forms: Sequence[JointForm],
    receivers: Sequence[Triad],
    title: str,
    credit: str,
    held: Mapping[str, float],
) -> str:
    """Return the text of a model file.

    title : the model's name, in ASCII. credit : text in any script. held : values, rad or mm, of the
    coordinates to lock.
    """
    document = ET.Element("OpenSimDocument", Version=XML_VERSION)
    model = add(document, "Model", title, credits=clean(credit), publications=PUBLICATIONS)
    fill(model, length_units="meters", force_units="N", gravity=numbers((0.0, -9.80665, 0.0)))
    bodies, joints, markers = (
        ET.SubElement(ET.SubElement(model, kind, name=kind.lower()), "objects")
        for kind in ("BodySet", "JointSet", "MarkerSet")
    )
    for form in forms:
        _add_body(bodies, motion, form)
        _add_joint(joints, forms, form, held)
    for triad in receivers:
        for name, at_mm in zip(triad.markers, triad.local_mm, strict=True):
            _add_marker(markers, name, forms[triad.form].body, at_mm)
    taken = [name for triad in receivers for name in triad.markers]
    for name, form, at_mm in fixed_points(motion, forms, taken):
        _add_marker(markers, name, form.body, at_mm)
    return as_text(document)


def add(parent: ET.Element, tag: str, name: str, **properties: str) -> ET.Element:
    """Add an OpenSim object, which is a named element with an element for each property, and return it."""
    return fill(ET.SubElement(parent, tag, name=name), **properties)


def fill(element: ET.Element, **properties: str) -> ET.Element:
    """Add an element for each property to `element`, and return it."""
    for key, text in properties.items():
        ET.SubElement(element, key).text = text
    return element


def as_text(document: ET.Element) -> str:
    """Format XML with a declaration, indented by tabs."""
    ET.indent(document, "\t")
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ET.tostring(document, "unicode") + "\n"


def numbers(values: Iterable[float]) -> str:
    """Format numbers with up to 12 digits, separated by spaces."""
    return " ".join(f"{round(float(value), 12) + 0.0:.12g}" for value in values)


def metres(lengths_mm: Array | float) -> str:
    """Format lengths given in mm as metres."""
    return numbers(np.atleast_1d(lengths_mm) * _M_PER_MM)


def clean(text: str) -> str:
    """Return text with the control characters that XML does not allow replaced by question marks."""
    return "".join(c if c in "\n\t" or (c.isprintable() or c == " ") else "?" for c in text)


def _add_body(parent: ET.Element, motion: PosedRecording, form: JointForm) -> None:
    """Add the body that a joint carries: a bone to each following joint and tip that is not at the origin.

    Mass and inertia are those of a cylinder of soft tissue as long as the longest of these bones.
    """
    after = [index for index, joint in enumerate(motion.joints) if joint.parent == form.index]
    ends_mm = motion.rest_offset_mm[after].reshape(-1, 3)
    spans_mm = ends_mm[np.linalg.norm(ends_mm, axis=1) > 0]
    body = ET.SubElement(parent, "Body", name=form.body)
    components = ET.SubElement(body, "components") if len(spans_mm) else body
    for number, span in enumerate(spans_mm, 1):  # cylinders to the next joints; OpenSim's are along Y
        length = float(np.linalg.norm(span))
        frame = ET.SubElement(components, "PhysicalOffsetFrame", name=f"bone{number}")
        size = {"radius": metres(0.08 * length), "half_height": metres(0.46 * length)}
        _add_shape(frame, "Cylinder", "shape", _BONE_COLOUR, **size)
        turn = body_fixed_rad(matrix(shortest_turn(_Y, span / length)))
        fill(frame, socket_parent="..", translation=metres(span / 2), orientation=numbers(turn))
    length = max(float(np.linalg.norm(spans_mm, axis=1).max(initial=0.0)), _SHORTEST_MM)
    _add_shape(body, "Sphere", "joint_shape", _JOINT_COLOUR, radius=metres(0.06 * length))
    radius = max(_SLENDER * length, _THINNEST_MM)
    mass = TISSUE_KG_M3 * np.pi * radius**2 * length * _M_PER_MM**3
    middle = unit(spans_mm.sum(0)) if len(spans_mm) else DISTAL
    across, along = mass * (3 * radius**2 + length**2) / 12, mass * radius**2 / 2
    moments = np.array([across, across, along]) * _M_PER_MM**2
    inertia = " ".join(f"{value:.9g}" for value in (*moments, 0, 0, 0))
    fill(body, mass=numbers([mass]), mass_center=metres(middle * length / 2), inertia=inertia)


def _add_shape(parent: ET.Element, kind: str, name: str, colour: str, **size: str) -> None:
    shapes = ET.SubElement(parent, "attached_geometry")
    shape = add(shapes, kind, name, socket_frame="..", scale_factors="1 1 1")
    fill(ET.SubElement(shape, "Appearance"), opacity="1", color=colour)
    fill(shape, **size)


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
            limits = np.multiply(_range(shift.values, _ROOM_MM, _ROOM_MM), _M_PER_MM)
            _add_coordinate(coordinates, shift.name, limits, start * _M_PER_MM, shift.name in held)
    frame = add(ET.SubElement(joint, "frames"), "PhysicalOffsetFrame", frame_name, socket_parent=before)
    orientation = numbers(body_fixed_rad(matrix(form.quaternion)))
    fill(frame, translation=metres(form.offset_mm), orientation=orientation)
    if form.coordinates:
        _add_spatial_transform(joint, form)


def _add_coordinate(parent: ET.Element, name: str, limits: Array, start: float, locked: bool) -> None:
    values = {"default_value": numbers([start]), "range": numbers(limits)}
    add(parent, "Coordinate", name, **values, clamped="false", locked="true" if locked else "false")


def _range(values: Array, step: float, room: float) -> tuple[float, float]:
    """Return the range of a coordinate's slider: the motion's range with a margin, in whole steps."""
    low, high = np.floor((values.min() - room) / step), np.ceil((values.max() + room) / step)
    return float(low * step), float(high * step)


def _add_spatial_transform(joint: ET.Element, form: JointForm) -> None:
    transform = ET.SubElement(joint, "SpatialTransform")
    for kind, used, axes in (("rotation", form.turns, form.axes), ("translation", form.shifts, np.eye(3))):
        for number, axis in enumerate(axes):
            name = used[number].name if number < len(used) else ""
            properties = {"coordinates": name, "axis": numbers(axis)}
            element = add(transform, "TransformAxis", f"{kind}{number + 1}", **properties)
            if name:
                add(element, "LinearFunction", "function", coefficients="1 0")
            else:
                add(element, "Constant", "function", value="0")


def _add_marker(parent: ET.Element, name: str, body: str, place_mm: Array) -> None:
    properties = {"socket_parent_frame": f"/bodyset/{body}", "location": metres(place_mm)}
    add(parent, "Marker", name, **properties, fixed="true")


_ANGLE_DECIMALS = 9
_METRE_DECIMALS = 12
_MM_DECIMALS = 6
_TIME_DECIMALS = 9


def write_mot(path: Path, title: str, origin: Origin, time_s: Array, forms: Sequence[JointForm]) -> None:
    """Write all coordinates over time, rotations in degrees, translations in metres; title : in ASCII."""
    whose = {key: getattr(origin.recording, key) for key in ("subject", "session", "hand", "task", "trial")}
    facts = {"program": f"{PROGRAM} {VERSION}", **whose, "model": origin.model, "licence": origin.licence}
    # an equals sign would make a line a key of the header
    lines = [" ".join(f"{key}: {fact}".replace("=", ":").split()) for key, fact in facts.items() if fact]
    names = ["time", *(coordinate.name for form in forms for coordinate in form.coordinates)]
    keys = [title, "version=1", f"nRows={len(time_s)}", f"nColumns={len(names)}", "inDegrees=yes"]
    header = [*keys, "", *lines, "", "endheader", "\t".join(names)]

    def tables() -> Iterator[pa.Table]:
        for start in range(0, len(time_s), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            columns = [time_s[rows]]
            for form in forms:
                columns += [np.degrees(c.values[rows]).round(_ANGLE_DECIMALS) for c in form.turns]
                columns += [(c.values[rows] * _M_PER_MM).round(_METRE_DECIMALS) for c in form.shifts]
            yield pa.table([pa.array(column + 0.0) for column in columns], names)

    write_rows(path, "\n".join(header) + "\n", tables(), "\t")


def write_trc(
    path: Path, title: str, time_s: Array, motion: PosedRecording, receivers: Sequence[Triad]
) -> None:
    """Write all markers over time in mm, with empty cells if a receiver is not valid; title : in ASCII.

    Frames without any marker are left out, because inverse kinematics stops at them. Lines end with a tab,
    because OpenSim's reader drops one empty cell at the end of a line, which could be a marker's.
    """
    names = [marker for triad in receivers for marker in triad.markers]
    rate = f"{motion.rate_hz if np.isfinite(motion.rate_hz) else ALONE_HZ:.9g}"
    seen = seen_frames(motion, receivers)
    count = int(seen.sum())
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{title}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{count}\t{len(names)}\tmm\t{rate}\t1\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t\t",
        "\t\t" + "\t".join(f"{axis}{n}" for n in range(1, len(names) + 1) for axis in "XYZ") + "\t",
        "",
    ]
    number = np.cumsum(seen)

    def tables() -> Iterator[pa.Table]:
        for start in range(0, len(seen), BLOCK_FRAMES):
            rows = slice(start, start + BLOCK_FRAMES)
            kept, part = seen[rows], motion.take(rows).receivers
            columns = [pa.array(number[rows][kept]), pa.array(time_s[rows][kept])]
            for triad in receivers:
                flat = triad.measured_mm(part)[kept].round(_MM_DECIMALS) + 0.0
                columns += [pa.array(column, from_pandas=True) for column in flat.T]
            columns.append(pa.nulls(int(kept.sum()), pa.float64()))
            yield pa.table(columns, [str(number) for number in range(len(columns))])

    write_rows(path, "\n".join(lines) + "\n", tables(), "\t")


def seen_frames(motion: PosedRecording, receivers: Sequence[Triad]) -> Bools:
    """Return the frames (T,) in which any of the receivers is valid."""
    valid = known_points(motion.receivers.position_mm, motion.receivers.quaternion)
    return np.asarray(valid[:, [triad.receiver for triad in receivers]].any(1))


NOMINAL = "masses and inertias are nominal, those of a cylinder of soft tissue as long as the bone"
PUBLICATIONS = (
    "M. Saito, K. Mitobe, M. Suzuki, N. Yoshimura: Modeling of Hand Skeletal Structure from Magnetic Motion "
    "Capture Data. Joint angles: Wu et al. 2005, J Biomech 38:981."
)
_STEEP_DEG = 85.0
_NOTABLE_MM = 1e-3


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Write `path` (.osim) and the other files with its stem; return sentences on what they lack.

    The motion must have Y up and no gaps, except in receivers. Raises InputError if a pose is missing, if
    there is no frame, or if times do not increase.
    """
    exported_motion.require_whole(motion, path, "OpenSim")
    time_s = np.zeros(1)
    if len(motion.frame) > 1:  # time since the first frame, to the nanosecond
        time_s = (motion.time_s - motion.time_s[0]).round(_TIME_DECIMALS)
        exported_motion.require_times(motion, time_s, path, "OpenSim")
    forms = joint_forms(motion)
    receivers, unplaced = triads(motion, forms)
    held = _undetermined_coordinates(forms, receivers)
    remarks = (NOMINAL, *unplaced, *_of_joints(forms, held), *_of_points(motion, receivers))
    title = exported_motion.plain_names([path.stem])[0]
    credit = exported_motion.facts_text(motion, "m", "y", remarks)
    for file, locked in ((path, {}), (path.with_name(f"{path.stem}_ik.osim"), held)):
        write_text(file, model_xml(motion, forms, receivers, title, credit, locked))
    write_mot(path.with_suffix(".mot"), title, motion.origin, time_s, forms)
    write_trc(path.with_suffix(".trc"), title, time_s, motion, receivers)
    setup = as_text(_ik_setup(path, title, time_s, receivers))
    write_text(path.with_name(f"{path.stem}_ik_setup.xml"), setup)
    return remarks


def _undetermined_coordinates(forms: Sequence[JointForm], receivers: Sequence[Triad]) -> dict[str, float]:
    """Return the coordinates that markers do not determine, with the values to lock them at, rad or mm.

    They are joints' translations, locked at zero; and, for a bone without a receiver, the rotations beyond
    its degree of freedom, or its axial rotation, which in a straight finger cannot be distinguished from that
    of the next joint. Rotations are locked at their means.
    """
    carriers = {triad.form for triad in receivers}
    held = {shift.name: 0.0 for form in forms if form.parent >= 0 for shift in form.shifts}
    for index, form in enumerate(forms):
        if index not in carriers and form.parent >= 0:
            determined = 1 if form.dof == 1 else 2
            held |= {turn.name: float(turn.values.mean()) for turn in form.turns[determined:]}
    return held


def _ik_setup(path: Path, title: str, time_s: Array, receivers: Sequence[Triad]) -> ET.Element:
    """Return the settings of OpenSim's InverseKinematicsTool for the files beside `path`."""
    document = ET.Element("OpenSimDocument", Version=XML_VERSION)
    tool = add(document, "InverseKinematicsTool", title, model_file=f"{path.stem}_ik.osim")
    fill(tool, marker_file=f"{path.stem}.trc", time_range=f"0 {time_s[-1]:.9f}", report_errors="true")
    fill(tool, output_motion_file=f"{path.stem}_ik.mot", results_directory=".")
    fill(tool, constraint_weight="Inf", accuracy="1e-08")
    tasks = ET.SubElement(ET.SubElement(tool, "IKTaskSet"), "objects")
    for name in (marker for triad in receivers for marker in triad.markers):
        add(tasks, "IKMarkerTask", name, apply="true", weight="1")
    return document


def _of_joints(forms: Sequence[JointForm], held: Mapping[str, float]) -> list[str]:
    """Return sentences on joints that translate, that are locked, or whose second angle is nearly 90 deg."""
    remarks = []
    shifted = [form for form in forms if form.parent >= 0 and form.shifts]
    if shifted:
        most = {f.name: _largest(np.stack([shift.values for shift in f.shifts], -1)) for f in shifted}
        worst = max(most, key=lambda name: most[name])
        remarks.append(
            f"{count_of(len(shifted), 'joint', 'move')} by up to {most[worst]:.3f} mm ({worst}) relative to "
            "the parent bone, in coordinates _tx, _ty, _tz, which _ik.osim locks at zero; --bones stiff "
            "gives a model without them"
        )
    locked = [turn.name for form in forms for turn in form.turns if turn.name in held]
    if locked:
        remarks.append(
            f"_ik.osim locks {', '.join(locked)} at their means: the bones have no receiver, and markers "
            "do not distinguish these rotations from those of the next joint"
        )
    for first, second, third in (form.turns for form in forms if len(form.turns) == 3):
        if np.abs(np.cos(second.values)).min() < np.cos(np.radians(_STEEP_DEG)):
            remarks.append(
                f"{second.name} comes within 5 degrees of a right angle, where {first.name} and {third.name} "
                "rotate about nearly the same axis"
            )
    return remarks


def _of_points(motion: PosedRecording, receivers: Sequence[Triad]) -> list[str]:
    """Return sentences on tips and receivers that do not move exactly with their bones."""
    remarks = []
    tips = [(index, *carrier(motion, index)) for index, joint in enumerate(motion.joints) if joint.tip]
    beyond = np.zeros((len(motion.frame), len(tips), 3))
    for column, (index, above, rest_mm) in enumerate(tips):
        along = motion.position_mm[:, index] - motion.position_mm[:, above]
        back = conjugate(motion.quaternion[:, above])
        beyond[:, column] = rotate(back, along) - rest_mm
    if tips and _largest(beyond) > _NOTABLE_MM:
        rms = float(np.sqrt(np.mean(np.sum(beyond**2, -1))))
        remarks.append(
            f"tips are markers fixed to their bones; in the recording they are up to {_largest(beyond):.3f} "
            f"mm away from there, rms {rms:.3f} mm"
        )
    blind = int((~seen_frames(motion, receivers)).sum())
    if blind:
        remarks.append(f"the .trc omits {count_of(blind, 'frame')} in which no receiver is valid")
    worst = max(receivers, key=lambda triad: triad.spread_mm, default=None)
    if worst is not None:
        remarks.append(
            f"receivers deviate by up to {worst.spread_mm:.2f} mm rms from fixed positions on their bones "
            f"(largest: {worst.segment})"
        )
    return remarks


def _largest(vector: Array) -> float:
    return float(np.linalg.norm(vector, axis=-1).max())
