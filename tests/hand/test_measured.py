"""Which joints and bones receivers measure, and the effect on the tables of fitted and paper models."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_poses import fitted, recorded, write_poses
from small_study import run_hand

from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.part_tables import posed_blocks
from shukotsu.hand.measured import measured_in, not_worn
from shukotsu.study.layout import read_layout
from shukotsu.study.verdict import NOT_WORN
from shukotsu.tables.poses import Poses, read_poses, seen_segments

LAYOUT = read_layout("liberty16")
LITTLE = ("little_proximal", "little_middle", "little_distal")
HANDS = [("right", 4), ("left", 4), ("right", 6), ("left", 6)]


def without(poses: Poses, *segments: str, since: int = 0) -> Poses:
    valid = poses.valid.copy()
    valid[since:, [poses.index(segment) for segment in segments]] = False
    return replace(poses, valid=valid)


@pytest.mark.parametrize(
    ("gone", "joints"),
    [
        (LITTLE, {"little_cmc", "little_mcp", "little_pip", "little_dip"}),
        (("little_distal",), {"little_dip"}),
        (("little_middle",), set()),  # the distal receiver's position separates PIP and DIP
        (("little_proximal", "little_middle"), set()),
        (("hand",), set()),
        (("ring_middle", "ring_distal"), {"ring_pip", "ring_dip"}),
    ],
)
def test_joints_between_two_receivers_are_measured(gone: tuple[str, ...], joints: set[str]) -> None:
    worn = {*LAYOUT.expected} - {*gone}
    names = [name for digit in LAYOUT.digits.values() for name in digit.joints]
    assert {name for name in names if not_worn(LAYOUT, name, worn)} == joints
    valid = np.array([[name in worn for name in LAYOUT.measured]])
    measured = measured_in(LAYOUT, LAYOUT.measured, valid)
    assert {name for name in names if not measured.joints[name][0]} == joints
    unposed = {LAYOUT.joints[name].child for name in joints}
    assert {name for name, seen in measured.bones.items() if not seen[0]} - {"forearm"} == unposed
    lost = {digit.name for digit in LAYOUT.digits.values() if digit.tip in gone}
    assert {name for name, seen in measured.tips.items() if not seen[0]} == lost
    assert not measured_in(LAYOUT, LAYOUT.measured, valid & False).bones["hand"].any()


FINGER = {"joints": ("cmc", "mcp", "pip", "dip"), "bones": ("metacarpal", "proximal", "middle", "distal")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("side", "gone", "since"),
    [("right", LITTLE, 0), ("right", ("little_distal",), 0), ("right", LITTLE, 20), ("left", LITTLE, 20)],
)
def test_a_fitted_hand_has_no_numbers_for_unmeasured_parts(
    side: str, gone: tuple[str, ...], since: int, tmp_path: Path
) -> None:
    joints, bones = (names if gone == LITTLE else names[-1:] for names in FINGER.values())
    poses = without(recorded(side, seed=4, n_frames=1600)[1].take(slice(0, 40)), *gone, since=since)
    path = write_poses(tmp_path / "poses.parquet", poses, side, "rom")
    assert seen_segments(path) == {*LAYOUT.expected} - ({*gone} if since == 0 else set())
    block = next(posed_blocks(fingertips(fitted(side)), path))
    for table, key, number, lost in (
        ("joint_angles", "joint", "flexion_deg", {f"little_{name}" for name in joints}),
        ("bone_poses", "segment", "qw", {f"little_{name}" for name in bones}),
        ("posed_tips", "digit", "tip_x_mm", {"little"}),
    ):
        columns = block[table]
        null = np.isin(np.array(columns[key], object), [*lost]) & (columns["frame"] >= poses.frame[since])
        assert null.sum() == len(lost) * (40 - since)
        assert np.array_equal(np.isnan(columns[number]), null), table
        assert np.array_equal(np.array(columns["flags"], object) == "not-measured", null), table


@pytest.mark.parametrize(("side", "seed"), HANDS)
@pytest.mark.parametrize("gone", [LITTLE, ("little_distal",)])
def test_a_joint_without_worn_receivers_is_reported_as_not_worn(
    side: str, seed: int, gone: tuple[str, ...], tmp_path: Path
) -> None:
    poses = without(recorded(side, seed=seed, n_frames=600)[1], *gone)
    path = write_poses(tmp_path / "poses.parquet", poses, side, "rom")
    assert not read_poses(path, gone).valid.any()
    results = run_hand(path, "rigid", tmp_path)
    joints = {row["joint"]: row for row in results.rows("joint_centres")}
    unworn = {name for name, row in joints.items() if row["reason"] == NOT_WORN}
    assert unworn == {f"little_{kind}" for kind in ("mcp", "pip", "dip") if len(gone) > 1 or kind == "dip"}
    for name in unworn:
        numbers = [joints[name][column] for column in ("status", "verdict", "sd_mm")]
        assert numbers == ["failed", "no", None]
        assert joints[name]["message"].startswith("not measured: no receiver on ")
        assert "check that receiver" not in joints[name]["message"]
