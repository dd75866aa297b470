"""OpenSim files: what a reader of our own makes of them, and OpenSim itself where it is installed.

The reader knows no more than the format: frames with body-fixed x, y, z angles, turns carried one by the
other about a joint's axes after its translations.
"""

from __future__ import annotations

import math
import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.moving_fingers import blanked

from shukotsu.skeleton.rotations import Array, about_axis, angle, conjugate, matrix, multiply, rotate, unit
from shukotsu.stages.export.axes import Target
from shukotsu.stages.export.motion import SkeletonMotion, continuous, stiffened
from shukotsu.stages.export.opensim import write
from shukotsu.stages.export.tidy_csv import bone_angles_deg

READER = Path(__file__).resolve().parents[2] / "export_samples" / "readers" / "read_with_opensim.py"
TARGET = Target("m", "y")
NEAR_M = 1e-9
NEAR_RAD = 1e-8


# -- a reader of our own


def axis_turn(axis: Array, rad: float) -> Array:
    """Rotation matrix by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(rad) * cross + (1 - math.cos(rad)) * cross @ cross


def numbers(parent: ET.Element, tag: str) -> Array:
    found = parent.findtext(tag)
    assert found is not None, f"{parent.tag} {parent.get('name')} has no {tag}"
    return np.array(found.split(), float)


def frame_of(element: ET.Element) -> tuple[Array, Array]:
    """Rotation and translation of a PhysicalOffsetFrame in its parent."""
    turn = np.eye(3)
    for axis, rad in zip(np.eye(3), numbers(element, "orientation"), strict=True):
        turn = turn @ axis_turn(axis, rad)
    return turn, numbers(element, "translation")


@dataclass
class Model:
    """An .osim file."""

    root: ET.Element

    @classmethod
    def read(cls, path: Path) -> Model:
        """Parse a file."""
        return cls(ET.fromstring(path.read_bytes()))

    def every(self, tag: str) -> list[ET.Element]:
        """All elements of that tag."""
        return list(self.root.iter(tag))

    @property
    def joints(self) -> list[ET.Element]:
        """The joints in their order."""
        found = self.root.find("Model/JointSet/objects")
        assert found is not None
        return list(found)

    def placed(self, values: Mapping[str, float]) -> dict[str, tuple[Array, Array]]:
        """Rotation and position in the ground of every body, by name, where coordinates have these values."""
        poses = {"/ground": (np.eye(3), np.zeros(3))}
        for joint in self.joints:
            frame = joint.find("frames/PhysicalOffsetFrame")
            assert frame is not None
            assert joint.findtext("socket_parent_frame") == frame.get("name")
            turn, place = poses[frame.findtext("socket_parent", "")]
            own_turn, own_place = frame_of(frame)
            place, turn = place + turn @ own_place, turn @ own_turn
            moved, turned = np.zeros(3), np.eye(3)
            for axis in joint.iter("TransformAxis"):
                value = function_value(axis, values)
                if axis.get("name", "").startswith("rotation"):
                    turned = turned @ axis_turn(numbers(axis, "axis"), value)
                else:
                    moved = moved + numbers(axis, "axis") * value
            poses[joint.findtext("socket_child_frame", "")] = (turn @ turned, place + turn @ moved)
        return {name.removeprefix("/bodyset/"): pose for name, pose in poses.items()}

    def axis(self, joint: str, name: str) -> Array:
        """An axis of a joint, rotation1 for one."""
        transform = next(j for j in self.joints if j.get("name") == joint).find("SpatialTransform")
        assert transform is not None
        return numbers(next(axis for axis in transform if axis.get("name") == name), "axis")


def function_value(axis: ET.Element, values: Mapping[str, float]) -> float:
    name = axis.findtext("coordinates")
    if not name:
        return float(axis.findtext("Constant/value", "nan"))
    slope, constant = axis.findtext("LinearFunction/coefficients", "").split()
    return float(slope) * values[name] + float(constant)


def read_mot(path: Path) -> tuple[dict[str, str], list[str], Array]:
    """Header, labels and numbers of a .mot file; fails where rows or columns are not as the header says."""
    lines = path.read_text("utf-8").splitlines()
    end = lines.index("endheader")
    header = dict(line.split("=", 1) for line in lines[1:end] if "=" in line)
    labels = lines[end + 1].split("\t")
    table = np.array([[float(cell) for cell in line.split("\t")] for line in lines[end + 2 :]])
    assert table.shape == (int(header["nRows"]), int(header["nColumns"]))
    assert len(labels) == table.shape[1]
    return header, labels, table


def read_trc(path: Path) -> tuple[dict[str, str], list[str], Array, Array]:
    """Header, markers, times and positions (T, M, 3), NaN where a cell is blank."""
    lines = path.read_text("utf-8").split("\n")
    header = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    names = [cell for cell in lines[3].split("\t")[2:] if cell]
    assert [cell for cell in lines[4].split("\t") if cell][-1] == f"Z{len(names)}"
    rows = [line.split("\t") for line in lines[6:-1]]
    assert {len(row) for row in rows} <= {3 + 3 * len(names)}, "one empty cell more at the end of each line"
    assert all(row[-1] == "" for row in rows)
    table = np.array([[float(cell) if cell else np.nan for cell in row[:-1]] for row in rows])
    assert table[:, 0].tolist() == list(range(1, int(header["NumFrames"]) + 1))
    return header, names, table[:, 1], table[:, 2:].reshape(len(table), -1, 3)


def replayed(stem: Path) -> tuple[Model, list[dict[str, tuple[Array, Array]]]]:
    """The model, and its bodies in every frame of the .mot."""
    model = Model.read(stem.with_suffix(".osim"))
    _, labels, table = read_mot(stem.with_suffix(".mot"))
    turning = {
        axis.findtext("coordinates")
        for axis in model.every("TransformAxis")
        if axis.get("name", "").startswith("rotation")
    }
    si = np.where([label in turning for label in labels], np.radians(table), table)
    return model, [model.placed(dict(zip(labels, row.tolist(), strict=True))) for row in si]


def largest_errors(
    motion: SkeletonMotion, frames: list[dict[str, tuple[Array, Array]]]
) -> tuple[float, float]:
    """How far joints are from the motion, m, and bones are turned from it, rad."""
    bones = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    turns = matrix(motion.quaternion)
    off, turned = 0.0, 0.0
    assert len(frames) == len(motion.frame)
    for row, bodies in enumerate(frames):
        poses = list(bodies.values())[1:]
        for index, (turn, place) in zip(bones, poses, strict=True):
            off = max(off, float(np.abs(place - motion.position_mm[row, index] / 1000).max()))
            turned = max(turned, float(np.abs(turn - turns[row, index]).max()))
    return off, turned


def bend(n_frames: int, phase: float, rad: float) -> Array:
    return np.asarray(rad * np.sin(np.linspace(0, 3, n_frames) + phase))


# -- every joint where it is


@pytest.mark.parametrize("rig", ["", "openxr", "vrm", "unreal", "mixamo"])
def test_every_bone_is_where_the_motion_has_it_on_any_rig(right: KnownHand, tmp_path: Path, rig: str) -> None:
    motion = right.ready(FITTED, rig=rig).take(slice(0, 240, 40))
    write(motion, TARGET, tmp_path / "hand.osim")
    model, frames = replayed(tmp_path / "hand")
    assert max(largest_errors(motion, frames)) < NEAR_RAD
    assert all(re.fullmatch(r"\w+", element.get("name", "x"), re.ASCII) for element in model.root.iter())


# -- what coordinates mean


def with_hinges(motion: SkeletonMotion, hinges: Sequence[str]) -> SkeletonMotion:
    """The motion with joints that turn about one axis alone; all others have two degrees of freedom.

    The metacarpals of index and middle finger keep still.
    """
    turn = motion.quaternion.copy()
    joints, axis = list(motion.joints), motion.axis.copy()
    for index, joint in enumerate(motion.joints[1:], 1):
        relative = multiply(conjugate(motion.quaternion[:, joint.parent]), motion.quaternion[:, index])
        if joint.name in hinges:
            if joint.name.endswith("_cmc"):
                axis[index] = unit(np.array([-0.8, -0.1, -0.5]))
            assert np.isfinite(axis[index]).all()
            joints[index] = replace(joint, dof=1)
            relative = multiply(relative[:1], about_axis(axis[index], bend(len(turn), index, 0.4)))
        elif joint.name in ("index_cmc", "middle_cmc"):
            relative = np.broadcast_to(relative[:1], relative.shape)
        elif not joint.tip:
            joints[index], axis[index] = replace(joint, dof=2), np.nan
        turn[:, index] = multiply(turn[:, joint.parent], relative)
    return stiffened(replace(motion, joints=tuple(joints), axis=axis, quaternion=continuous(turn)))


HINGES = ("thumb_ip", "index_pip", "index_dip", "middle_dip", "ring_cmc", "little_cmc")


def test_a_hinge_has_its_estimated_axis_and_flexion_alone(known: KnownHand, tmp_path: Path) -> None:
    motion = with_hinges(known.ready(FITTED), HINGES)
    write(motion, TARGET, tmp_path / "hand.osim")
    model, frames = replayed(tmp_path / "hand")
    assert max(largest_errors(motion, frames)) < NEAR_RAD
    _, labels, table = read_mot(tmp_path / "hand.mot")
    joints, angles = bone_angles_deg(motion)
    for joint in HINGES:
        axis = model.axis(joint, "rotation1")
        np.testing.assert_allclose(np.abs(axis @ motion.axis[motion.index(joint)]), 1, atol=1e-9)
        assert [label for label in labels if label.startswith(joint)] == [f"{joint}_flexion"]
        flexed = np.diff(table[:, labels.index(f"{joint}_flexion")])
        told = np.diff(angles[:, joints.index(joint), 0])
        assert np.corrcoef(flexed, told)[0, 1] > 0.9, "flexion is positive"


def test_coordinates_are_free_in_one_model_and_translations_locked_in_the_other(
    right: KnownHand, tmp_path: Path
) -> None:
    motion = right.ready(REPLAYED)
    told = write(motion, TARGET, tmp_path / "hand.osim")
    free, held = (Model.read(tmp_path / name) for name in ("hand.osim", "hand_ik.osim"))
    assert {c.findtext("locked") for c in free.every("Coordinate")} == {"false"}
    locked = {c.get("name") for c in held.every("Coordinate") if c.findtext("locked") == "true"}
    shifts = {str(c.get("name")) for c in free.every("Coordinate") if "_t" in str(c.get("name"))[-3:]}
    twists = {f"{digit}_cmc_rotation" for digit in ("index", "middle", "ring", "little")}
    assert locked == {name for name in shifts if not name.startswith("wrist_")} | twists
    _, labels, table = read_mot(tmp_path / "hand.mot")
    twist = next(c for c in held.every("Coordinate") if c.get("name") == "ring_cmc_rotation")
    mean = np.radians(table[:, labels.index("ring_cmc_rotation")].mean())
    assert float(twist.findtext("default_value", "")) == pytest.approx(mean, abs=1e-9)
    assert any("coordinates _tx, _ty, _tz" in sentence for sentence in told)


# -- markers


def test_a_receiver_that_carries_its_bone_is_where_the_model_has_it(known: KnownHand, tmp_path: Path) -> None:
    motion = known.ready(REPLAYED).take(slice(0, 240, 24))
    write(motion, TARGET, tmp_path / "hand.osim")
    model, frames = replayed(tmp_path / "hand")
    _, names, time_s, measured = read_trc(tmp_path / "hand.trc")
    np.testing.assert_allclose(time_s, motion.time_s - motion.time_s[0], atol=1e-9)
    receivers = motion.receivers
    at = measured[:, names.index("index_middle_o")]
    number = receivers.segments.index("index_middle")
    np.testing.assert_allclose(at, receivers.position_mm[:, number], atol=1e-6)
    arm = measured[:, names.index("index_middle_y")] - at
    np.testing.assert_allclose(arm, 10 * matrix(receivers.quaternion[:, number])[..., 1], atol=3e-6)
    markers = {str(m.get("name")): m for m in model.every("Marker")}
    for segment in ("hand", "index_middle", "little_distal"):
        for point in "oxyz":
            marker = markers[f"{segment}_{point}"]
            assert marker.findtext("socket_parent_frame") == f"/bodyset/{segment}"
            place = numbers(marker, "location")
            ours = np.array([pose[segment][1] + pose[segment][0] @ place for pose in frames])
            np.testing.assert_allclose(
                ours, measured[:, names.index(f"{segment}_{point}")] / 1000, atol=NEAR_M
            )


# -- OpenSim itself


def read_with_opensim(export_tool: Callable[[str], Path], stem: Path, *options: str) -> dict[str, Any]:
    """What OpenSim reads; the test is skipped where it is not installed."""
    command = [export_tool("opensim/bin/python"), READER, stem, stem.with_suffix(".npz"), *options]
    subprocess.run(list(map(str, command)), check=True, capture_output=True, timeout=300)
    with np.load(stem.with_suffix(".npz")) as found:
        return dict(found)


@pytest.mark.tools
@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_opensim_has_every_bone_where_the_motion_has_it(
    known: KnownHand, tmp_path: Path, export_tool: Callable[[str], Path], model: str
) -> None:
    motion = known.ready(model)
    stem = tmp_path / "sub-母_hand"
    write(motion, TARGET, stem.with_suffix(".osim"))
    found = read_with_opensim(export_tool, stem)
    bones = [index for index, joint in enumerate(motion.joints) if not joint.tip]
    np.testing.assert_allclose(found["mot_time_s"], motion.time_s - motion.time_s[0], atol=1e-9)
    np.testing.assert_allclose(found["mot_place_m"], motion.position_mm[:, bones] / 1000, atol=NEAR_M)
    apart = angle(multiply(conjugate(motion.quaternion[:, bones]), found["mot_turn"]))
    assert apart.max() < NEAR_RAD
    assert found["mot_in_degrees"] == "yes"
    _, names, _, measured = read_trc(stem.with_suffix(".trc"))
    assert found["trc_markers"].tolist() == names
    assert found["trc_units"] == "mm"
    np.testing.assert_allclose(found["trc_mm"], measured, atol=1e-9)


def riding(motion: SkeletonMotion) -> SkeletonMotion:
    """The same with receivers that sit on their bones without skin, the last one blind in some frames."""
    there = motion.receivers
    place, turn = there.position_mm.copy(), there.quaternion.copy()
    segments = [joint.segment for joint in motion.joints]
    for number, segment in enumerate(there.segments):
        if segment in segments:
            bone = segments.index(segment)
            stuck = about_axis(unit(np.array([1.0, number, 2.0])), 0.2)
            turn[:, number] = multiply(motion.quaternion[:, bone], stuck)
            place[:, number] = motion.position_mm[:, bone] + rotate(
                motion.quaternion[:, bone], np.array([1.0, 8.0, -15.0])
            )
    last = there.segments.index("little_distal")
    motion = replace(motion, receivers=replace(there, position_mm=place, quaternion=turn))
    return blanked(motion, receivers=np.s_[4:6, last])


@pytest.mark.tools
def test_inverse_kinematics_of_opensim_finds_our_angles(
    known: KnownHand, tmp_path: Path, export_tool: Callable[[str], Path]
) -> None:
    """Exact receivers of a fitted hand: to 0.1 deg, but where a receiver was blind and tells nothing.

    In one frame all were.
    """
    motion = with_hinges(known.ready(FITTED), HINGES)
    motion = blanked(riding(motion.take(slice(0, 240, 12))), receivers=11)
    write(motion, TARGET, tmp_path / "hand.osim")
    found = read_with_opensim(export_tool, tmp_path / "hand", "--ik")
    assert found["ik_ran"]
    told = np.delete(np.arange(20), 11)
    assert len(found["ik_rms_m"]) == len(told)
    assert found["ik_rms_m"].max() < 1e-5
    theirs = found["ik_values"][
        :, [found["ik_coordinates"].tolist().index(n) for n in found["mot_coordinates"]]
    ]
    turns = [i for i, name in enumerate(found["mot_coordinates"]) if not re.search("_t[xyz]$", str(name))]
    seen = motion.receivers.valid[told, motion.receivers.segments.index("little_distal")]
    apart = (theirs - found["mot_values"][told])[np.ix_(np.flatnonzero(seen), turns)]
    assert np.isfinite(theirs).all()
    assert np.abs(apart).max() < 0.1
