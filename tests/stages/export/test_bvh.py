"""A BVH file holds the motion: read back by a reader that shares nothing with the writer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.minimal_bvh import Bvh, read_bvh
from export_samples.moving_fingers import moving_fingers, random_fingers
from hypothesis import given, settings
from hypothesis import strategies as st

from shukotsu.stages.export.bvh import AT_REST, write
from shukotsu.stages.export.motion import SkeletonMotion, rest_pose, stiffened

NEAR_MM = 1e-4
"""A tenth of a micrometre; asked for is 10."""


def positions_mm(bvh: Bvh, motion: SkeletonMotion) -> np.ndarray:
    """Positions (T, J, 3) that the file has for the motion's joints, tips among them."""
    names = [node.name for node in bvh.nodes]
    series = [
        bvh.series(joint.name) if joint.name in names else bvh.end(motion.names[joint.parent])
        for joint in motion.joints
    ]
    return 10 * np.stack(series, 1)


def written(motion: SkeletonMotion, folder: Path) -> Bvh:
    write(motion, folder / "motion.bvh")
    return read_bvh(folder / "motion.bvh")


@pytest.mark.parametrize("model", [REPLAYED, FITTED])
def test_every_joint_is_where_the_motion_has_it(known: KnownHand, tmp_path: Path, model: str) -> None:
    motion = known.motion(model)
    motion = motion.take(motion.whole)
    bvh = written(motion, tmp_path)
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)
    assert bvh.frame_time_s == pytest.approx(1 / 240, abs=1e-9)


def test_the_hierarchy_is_the_skeleton_at_rest(known: KnownHand, tmp_path: Path) -> None:
    motion = known.motion(FITTED)
    bvh = written(motion, tmp_path)
    place = np.zeros((len(bvh.nodes), 3))
    for index, node in enumerate(bvh.nodes[1:], 1):
        place[index] = place[node.parent] + node.offset
    rest = rest_pose(motion)[0]
    for index, node in enumerate(bvh.nodes):
        if node.name and not node.name.endswith(AT_REST):
            np.testing.assert_allclose(10 * place[index], rest[motion.index(node.name)], atol=1e-5)


def test_stiff_bones_need_rotations_only(known: KnownHand, tmp_path: Path) -> None:
    motion = stiffened(known.motion(FITTED))
    bvh = written(motion, tmp_path)
    assert [len(node.channels) for node in bvh.nodes if node.name] == [6] + [3] * 24
    assert sum(not node.name for node in bvh.nodes) == 5, "the skin's ends are end sites"
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


@settings(max_examples=12)
@given(st.integers(1, 40), st.integers(0, 2**31), st.sampled_from([0.0, 0.7]))
def test_any_motion_comes_back(
    tmp_path_factory: pytest.TempPathFactory, n: int, seed: int, slip: float
) -> None:
    motion = random_fingers(n, seed, slip)
    motion = motion if slip else stiffened(motion)
    bvh = written(motion, tmp_path_factory.mktemp("any"))
    np.testing.assert_allclose(positions_mm(bvh, motion), motion.position_mm, atol=NEAR_MM)


def test_angles_run_on_and_never_jump(tmp_path: Path) -> None:
    """Also of a bone that bends beyond a right angle and a root that spins beyond half a turn."""
    motion = moving_fingers(600)
    bvh = written(motion, tmp_path)
    assert np.abs(np.diff(bvh.numbers[:, 3:], axis=0)).max() < 40
    assert np.abs(bvh.numbers[:, 3:]).max() > 180


def test_names_without_ascii_are_written(tmp_path: Path) -> None:
    motion = moving_fingers(3)
    joints = (*motion.joints[:4], replace(motion.joints[4], name="小指 1"), motion.joints[5])
    bvh = written(replace(motion, joints=joints), tmp_path)
    assert "_u5c0f_u6307_u00201" in [node.name for node in bvh.nodes]
