"""OpenSim reads the files that are written for it, and has every bone where the motion has it."""

from __future__ import annotations

import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.moving_fingers import blanked

from shukotsu.skeleton.rotations import Array, about_axis, angle, conjugate, multiply, rotate, unit
from shukotsu.stages.export.axes import Target
from shukotsu.stages.export.motion import SkeletonMotion, continuous, stiffened
from shukotsu.stages.export.opensim import write

READER = Path(__file__).resolve().parents[2] / "export_samples" / "readers" / "read_with_opensim.py"
TARGET = Target("m", "y")
NEAR_M = 1e-9
NEAR_RAD = 1e-8


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


def test_files_have_every_bone_coordinate_and_receiver(known: KnownHand, tmp_path: Path) -> None:
    """What they mean is OpenSim's to say, below."""
    motion = known.ready(REPLAYED).take(slice(0, 240, 24))
    write(motion, TARGET, tmp_path / "hand.osim")
    model = ET.parse(tmp_path / "hand.osim")
    bodies = [body.get("name") for body in model.iter("Body")]
    assert bodies == [joint.segment for joint in motion.joints if not joint.tip]
    _, labels, table = read_mot(tmp_path / "hand.mot")
    assert labels[1:] == [coordinate.get("name") for coordinate in model.iter("Coordinate")]
    assert np.isfinite(table).all()
    _, names, time_s, measured = read_trc(tmp_path / "hand.trc")
    np.testing.assert_allclose(time_s, motion.time_s - motion.time_s[0], atol=1e-9)
    receivers = motion.receivers
    for number, segment in enumerate(receivers.segments):
        if segment in bodies:  # else no bone carries it
            at = measured[:, names.index(f"{segment}_o")]
            np.testing.assert_allclose(at, receivers.position_mm[:, number], atol=1e-6)


def bend(n_frames: int, phase: float, rad: float) -> Array:
    return np.asarray(rad * np.sin(np.linspace(0, 3, n_frames) + phase))


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
