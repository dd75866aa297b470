"""The average hand: who reads which number, and what follows from the numbers."""

import ast
from pathlib import Path

import numpy as np
import pytest

from anatomy import average_hand
from anatomy.average_hand import AVERAGE_LENGTH_MM, DIGITS

ROOT = Path(__file__).parents[2]
SIMULATOR, JOINT_BY_JOINT, WHOLE_HAND, PLANES = "simulate", "solve_joints", "fit_hand", "project_planes"
READERS = (JOINT_BY_JOINT, WHOLE_HAND, PLANES)

READ_BY = {
    (JOINT_BY_JOINT, WHOLE_HAND, PLANES): "DIGITS MOUNT_SD_MM MOUNT_TURN_SD_RAD BONE_KINDS PALM_SLIDE_SD_MM",
    (JOINT_BY_JOINT, WHOLE_HAND): "AVERAGE_LENGTH_MM SCALE_SD_BY_LENGTH AXIS_SD_RAD DISTAL_TILT "
    "SKEW_MM SCALE_SD SKIN_BENT",
    (JOINT_BY_JOINT, PLANES): "UNKNOWN_SLIDE_SD_MM JOINTWISE_NAIL JOINTWISE_SLIDE_SD_MM JOINTWISE_THENAR "
    "JOINTWISE_TILT_SD",
    (JOINT_BY_JOINT,): "CMC_RANGE_DEG HAND_MOUNT_SD_MM UNDER_READING UNDER_READING_SD",
    (WHOLE_HAND,): "AVERAGE_BREADTH_MM SKEW_SD_MM SKEW_AXIS_SD_RAD SKEW_DEG PRO_SUPINATION PRO_SUPINATION_SD "
    "SCALE_SD_BY_BREADTH BASE_SD_MM DIRECTION_SD_RAD JOINT_SLIDE_SD_MM SLIDE_SD_MM TILT_SD "
    "PHALANX_DEG METACARPAL_DEG PALM_DEG STILL_PALM_DEG ABDUCTION_DEG AXIAL_DEG HINGE_DEG DIP_PER_PIP "
    "DIP_BY_PIP_SD_DEG HABIT_SHARE MOUNT_SHARE NAIL_SHARE NAIL_SLOPE_DEG LENGTH_SD_MM SOURCE_SD_MM "
    "THUMB_METACARPAL_SD_MM ROLL_SD_RAD THUMB_ROLL_SD_RAD FACING_SD_RAD LEAN_SD_RAD HINGE_SLIDE_SD_MM "
    "DISTAL_TILT_SD PLACE_LAG PLACE_LAG_SD TURN_LAG TURN_LAG_SD RELAXED_RAD PALM_TILT_SD PALM_HELD_SD_RAD "
    "FIELD_TURN_SD_RAD FIELD_SLOPE_SD_RAD_PER_MM",
    (): "COVER_MM CAPITATE_TO_CREASE_MM SOURCE_SCALE THENAR LITTLE NAIL",
}
"""Stages with the numbers that just they read, those of `anatomy.skin` by whoever imports it; of names,
JOINTWISE means solve_joints alone where no other reader stands here."""


def read_by(name: str) -> tuple[str, ...]:
    listed = [stages for stages, names in READ_BY.items() if name in names.split()]
    (stages,) = listed or [(JOINT_BY_JOINT,)] * name.startswith("JOINTWISE_")
    return stages


def numbers_read(folder: Path) -> set[str]:
    """Names of numbers that a stage's modules import from the average hand, or look up in it."""
    names = set()
    paths = sorted(folder.rglob("*.py"))
    if any("from anatomy.skin import" in path.read_text("utf-8") for path in paths):
        paths.append(ROOT / "anatomy" / "skin.py")
    for path in paths:
        tree = ast.parse(path.read_text("utf-8"))
        modules = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module == "anatomy.average_hand":
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module == "anatomy":
                modules |= {alias.asname or alias.name for alias in node.names}
        names |= {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id in modules
        }
    return {name for name in names if name.isupper()}


@pytest.mark.parametrize("reader", READERS)
def test_each_stage_reads_the_numbers_that_it_is_said_to_read(reader: str) -> None:
    """Every number has the readers that are listed."""
    expected = {name for name in vars(average_hand) if name.isupper() and reader in read_by(name)}
    assert numbers_read(ROOT / "stages" / reader) == expected


def test_joints_lie_bone_after_bone_from_the_base() -> None:
    for digit in DIGITS.values():
        joints = digit.joints_mm()
        np.testing.assert_allclose(joints[0], digit.base_mm)
        lengths = np.linalg.norm(np.diff(joints, axis=0), axis=-1)
        np.testing.assert_allclose(lengths, digit.lengths_mm[:-1])
    assert pytest.approx(182.6, abs=0.1) == AVERAGE_LENGTH_MM


def test_frames_are_rotations_with_x_along_the_bone_and_the_back_up() -> None:
    for name, digit in DIGITS.items():
        frames = digit.frames()
        np.testing.assert_allclose(
            frames.swapaxes(-1, -2) @ frames, np.tile(np.eye(3), (len(frames), 1, 1)), atol=1e-12
        )
        np.testing.assert_allclose(np.linalg.det(frames), 1.0)
        np.testing.assert_allclose(frames[:, :, 0], digit.directions, atol=1e-12)
        if name != "thumb":
            assert (frames[:, 2, 2] > 0.6).all()
