"""Simulated recordings and the correctness of their truth."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.hand import rotations
from shukotsu.simulate import simulation
from shukotsu.simulate.random_hand import BONES, JOINTS
from shukotsu.simulate.realism import Realism
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import RecordingName

EXACT, FULL = Realism.exact(), Realism()
SHORT = 600
simulate = cache(simulation.simulate)


def test_tasks_share_the_hand_and_its_receivers() -> None:
    first, second = (
        simulate(RecordingName("01", "right", task), 7, FULL, SHORT).truth for task in ("opposition", "rom")
    )
    np.testing.assert_array_equal(first.hand.length_mm, second.hand.length_mm)
    np.testing.assert_array_equal(first.mounts.position_mm, second.mounts.position_mm)


@pytest.mark.parametrize("task", ["opposition", "rom"])
@pytest.mark.parametrize("side", ["right", "left"])
def test_exact_joints_are_hinges_in_the_childs_sagittal_plane(side: str, task: str) -> None:
    simulated = simulate(RecordingName("01", side, task), 7, EXACT, SHORT, forearm=True)
    layout = read_layout("liberty16")
    assert set(simulated.truth.joints) == {joint.name for joint in layout.solvable}
    for joint in simulated.truth.joints.values():
        assert joint.gap_mm.max() < 1e-9
        assert abs(joint.child_mm[1]) < 1e-12
        assert abs(joint.axis_child[1]) > 0.8
        if not joint.name.endswith("_dip"):
            assert joint.range_deg > 10
        parent, child = (
            simulated.quaternion[:, simulated.segments.index(name)]
            for name in (joint.parent_segment, joint.child_segment)
        )
        apart = rotations.rotate(parent, joint.axis_parent) - rotations.rotate(child, joint.axis_child)
        assert np.abs(apart).max() < 1e-12


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_truth_is_the_mean_centre_in_the_receivers_frames(side: str) -> None:
    """Without tracker noise and field distortion, recorded poses are those of the receivers on the skin. The
    truth is the same with noise and distortion.
    """
    realism = replace(FULL, noise=0.0, field_distortion=0.0)
    simulated = simulate(RecordingName("01", side, "rom"), 7, realism, SHORT)
    turn, truth = rotations.matrix(simulated.quaternion), simulated.truth
    noisy = simulate(RecordingName("01", side, "rom"), 7, FULL, SHORT).truth.joints
    for name, joint in truth.joints.items():
        centre_mm = truth.bone_position_mm[:, JOINTS.index(name) + 1]
        for segment, stated in (
            (joint.parent_segment, joint.parent_mm),
            (joint.child_segment, joint.child_mm),
        ):
            if segment:
                index = simulated.segments.index(segment)
                seen = np.einsum("tba,tb->ta", turn[:, index], centre_mm - simulated.position_mm[:, index])
                np.testing.assert_allclose(stated, seen.mean(0), atol=1e-9)
        np.testing.assert_array_equal(joint.child_mm, noisy[name].child_mm)
    for index, segment in enumerate(simulated.segments):
        bone = rotations.matrix(truth.bone_quaternion[:, BONES.index(segment)])
        seen = np.einsum("tba,tb->ta", turn[:, index], bone[..., 0]).mean(0)
        np.testing.assert_allclose(truth.along[index], seen / np.linalg.norm(seen), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "seed", "n_frames", "reason"),
    [
        (RecordingName("01", "both", "rom"), 1, 10, "hand 'both'"),
        (RecordingName("01", "left", "juggling"), 1, 10, "task 'juggling'"),
        (RecordingName("01", "left", "rom", trial="2"), 1, 10, "trial '2'"),
        (RecordingName("01", "left", "rom"), -1, 10, "seed -1"),
        (RecordingName("01", "left", "rom"), 1, 1, "1 frame is"),
    ],
)
def test_unusable_arguments_are_refused(name: RecordingName, seed: int, n_frames: int, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        simulate(name, seed, EXACT, n_frames)
