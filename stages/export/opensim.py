"""OpenSim: a person's skeleton as a model, its motion, its receivers as markers, and inverse kinematics.

Five files with one stem: `.osim`, the model; `.mot`, its coordinates over time, which place every joint where
the tables have it; `.trc`, the receivers as they were measured, a triad of markers each; `_ik_setup.xml`,
which has OpenSim find the coordinates from the markers by its own inverse kinematics, on `_ik.osim`. The
ground is the transmitter's frame with Y up; metres and degrees, markers in mm.

`_ik.osim` is the same model with coordinates locked that markers do not tell: the joints' own translations,
and the axial rotation of bones without a receiver. In `.osim` they are free, as OpenSim leaves a locked
coordinate where it is when it plays a motion, and says nothing.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from shukotsu.files.whole_files import write_text
from shukotsu.skeleton.posing import PosedRecording
from shukotsu.skeleton.rotations import Array, conjugate, rotate
from shukotsu.stages.export.file_facts import facts_text
from shukotsu.stages.export.kinematic_tree import JointForm, joint_forms
from shukotsu.stages.export.motion import carrier, require_whole
from shukotsu.stages.export.opensim_markers import Triad, triads
from shukotsu.stages.export.opensim_model import VERSION, add, as_text, model_xml
from shukotsu.stages.export.opensim_motion import seconds, seen_frames, write_mot, write_trc
from shukotsu.stages.export.rig_names import plain_names

NOMINAL = "masses and inertias are nominal, those of a cylinder of soft tissue as long as the bone"
PUBLICATIONS = (
    "M. Saito, K. Mitobe, M. Suzuki, N. Yoshimura: Modeling of Hand Skeletal Structure from Magnetic Motion "
    "Capture Data. Joint angles: Wu et al. 2005, J Biomech 38:981."
)
_ACCURACY = 1e-8
_STEEP_DEG = 85.0
_NOTABLE_MM = 1e-3


def write(motion: PosedRecording, path: Path) -> tuple[str, ...]:
    """Write `path` (.osim) and the other files with its stem; give what they do not hold.

    The motion has Y up and no gap; receivers may have some. Raises InputError where a pose is missing, there
    is no frame, or times do not grow.
    """
    require_whole(motion, path, "OpenSim")
    time_s = seconds(motion, path, "OpenSim")
    forms = joint_forms(motion)
    receivers, unplaced = triads(motion, forms)
    held = _undetermined(forms, receivers)
    remarks = (NOMINAL, *unplaced, *_of_joints(forms, held), *_of_points(motion, receivers))
    title = plain_names([path.stem])[0]
    credit = facts_text(motion, "m", "y", remarks)
    for file, locked in ((path, {}), (_beside(path, "_ik.osim"), held)):
        write_text(file, model_xml(motion, forms, receivers, title, credit, PUBLICATIONS, locked))
    write_mot(path.with_suffix(".mot"), title, motion.origin, time_s, forms)
    write_trc(path.with_suffix(".trc"), title, time_s, motion, receivers)
    write_text(_beside(path, "_ik_setup.xml"), as_text(_ik_setup(path, title, time_s, receivers)))
    return remarks


def _undetermined(forms: Sequence[JointForm], receivers: Sequence[Triad]) -> dict[str, float]:
    """Coordinates that markers do not tell, and where inverse kinematics is to hold them, rad or mm.

    A joint's own translations, at zero. On a bone without a receiver, what goes beyond its degree of freedom,
    or its axial rotation: with the finger straight that is the next joint's as well. At their means.
    """
    carriers = {triad.form for triad in receivers}
    held = {shift.name: 0.0 for form in forms if form.parent >= 0 for shift in form.shifts}
    for place, form in enumerate(forms):
        if place not in carriers and form.parent >= 0:
            determined = 1 if form.dof == 1 else 2
            held |= {turn.name: float(turn.values.mean()) for turn in form.turns[determined:]}
    return held


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(f"{path.stem}{ending}")


def _ik_setup(path: Path, title: str, time_s: Array, receivers: Sequence[Triad]) -> ET.Element:
    """Write the set-up of OpenSim's InverseKinematicsTool; its files are beside it."""
    document = ET.Element("OpenSimDocument", Version=VERSION)
    tool = add(
        document,
        "InverseKinematicsTool",
        title,
        model_file=_beside(path, "_ik.osim").name,
        marker_file=path.with_suffix(".trc").name,
        time_range=f"0 {time_s[-1]:.9f}",
        report_errors="true",
        output_motion_file=_beside(path, "_ik.mot").name,
        results_directory=".",
        constraint_weight="Inf",
        accuracy=f"{_ACCURACY:g}",
    )
    tasks = ET.SubElement(ET.SubElement(tool, "IKTaskSet"), "objects")
    for name in (marker for triad in receivers for marker in triad.markers):
        add(tasks, "IKMarkerTask", name, apply="true", weight="1")
    return document


def _of_joints(forms: Sequence[JointForm], held: Mapping[str, float]) -> list[str]:
    """Sentences on joints that move by more than turns, that are locked, or that come near a right angle."""
    remarks = []
    shifted = [form for form in forms if form.parent >= 0 and form.shifts]
    if shifted:
        most = {f.name: _largest(np.stack([shift.values for shift in f.shifts], -1)) for f in shifted}
        worst = max(most, key=lambda name: most[name])
        remarks.append(
            f"{len(shifted)} joints move against the bone before and have coordinates _tx, _ty, _tz, up to "
            f"{most[worst]:.3f} mm ({worst}); _ik.osim locks them at zero; --bones stiff gives a model "
            "without"
        )
    locked = [turn.name for form in forms for turn in form.turns if turn.name in held]
    if locked:
        remarks.append(
            f"_ik.osim locks at their means {', '.join(locked)}: the bones have no receiver, and markers do "
            "not tell these turns from the next joint's"
        )
    for first, second, third in (form.turns for form in forms if len(form.turns) == 3):
        if np.abs(np.cos(second.values)).min() < np.cos(np.radians(_STEEP_DEG)):
            remarks.append(
                f"{second.name} comes within 5 degrees of a right angle, where {first.name} and {third.name} "
                "turn about nearly the same axis"
            )
    return remarks


def _of_points(motion: PosedRecording, receivers: Sequence[Triad]) -> list[str]:
    """Sentences on tips and receivers that the bones do not carry exactly."""
    remarks = []
    tips = [(index, *carrier(motion, index)) for index, joint in enumerate(motion.joints) if joint.tip]
    beyond = np.zeros((len(motion.frame), len(tips), 3))
    for place, (index, above, rest_mm) in enumerate(tips):
        along = motion.position_mm[:, index] - motion.position_mm[:, above]
        back = conjugate(motion.quaternion[:, above])
        beyond[:, place] = rotate(back, along) - rest_mm
    if tips and _largest(beyond) > _NOTABLE_MM:
        rms = float(np.sqrt(np.mean(np.sum(beyond**2, -1))))
        remarks.append(
            f"tips are markers fixed to their bones; the recording has them up to {_largest(beyond):.3f} mm "
            f"from there, rms {rms:.3f} mm"
        )
    blind = int((~seen_frames(motion, receivers)).sum())
    if blind:
        remarks.append(f"frames in which no receiver is valid, {blind}, are not in the .trc")
    worst = max(receivers, key=lambda triad: triad.spread_mm, default=None)
    if worst is not None:
        remarks.append(
            f"receivers stay within {worst.spread_mm:.2f} mm rms of where their bones carry them (the worst: "
            f"{worst.segment})"
        )
    return remarks


def _largest(vector: Array) -> float:
    return float(np.linalg.norm(vector, axis=-1).max())
