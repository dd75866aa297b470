"""Nothing is tied to a hand: any tree of hinges comes back, and no result depends on how it was recorded."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from chains import Chain, chain_layout, chain_tips, moments_of, quaternions, random_chain
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from schemas.model import read_model
from schemas.poses import Poses
from skeleton.rotations import Array
from stages.evaluate_tips.replay import tip_error_mm
from stages.project_planes.place import place_joint
from stages.solve_joints.closed import solve_closed
from stages.solve_joints.solution_rows import solution_row

MODEL = read_model("rigid")


@st.composite
def trees(draw: st.DrawFn) -> tuple[int, tuple[int, ...]]:
    """A seed and a random tree: every segment after the first hangs from an earlier one."""
    n_joints = draw(st.integers(1, 8))
    parents = tuple(draw(st.integers(0, joint)) for joint in range(n_joints))
    return draw(st.integers(0, 2**32 - 1)), parents


def made(seed: int, parents: tuple[int, ...], **options: float) -> Chain:
    return random_chain(seed, len(parents) + 1, 120, parents=parents, **options)


def solved(chain: Chain, poses: Poses) -> dict[str, dict[str, Any]]:
    """joint_centres by joint, from those poses."""
    moments, layout = moments_of(chain, poses), chain_layout(chain)
    return {
        joint.name: place_joint(
            joint, layout, solution_row(joint, solve_closed(moments, index, 5)), MODEL, None
        )
        for index, joint in enumerate(chain.joints)
    }


def tips(chain: Chain, poses: Poses, rows: Mapping[str, Any]) -> dict[str, tuple[Array, Array]]:
    """Per digit the tips in the least-squares and in the first-frame binding."""
    found = {}
    for name, (digit, *both) in chain_tips(chain, poses, rows).items():
        assert all(np.isfinite(tip_error_mm(tip, digit, poses)).all() for tip in both)
        found[name] = both[0], both[1]
    return found


def numbers(row: Mapping[str, Any]) -> Array:
    """Centre, axes and what is said of them."""
    names = [f"{side}_{k}_mm" for side in ("parent", "child") for k in "xyz"]
    names += [f"axis_{side}_{k}" for side in ("parent", "child") for k in "xyz"]
    return np.array([row[name] for name in (*names, "gap_rms_mm", "gap_rms_free_mm", "axis_plane_deg")])


@given(trees())
@settings(max_examples=25)
def test_any_tree_of_hinges_comes_back(tree: tuple[int, tuple[int, ...]]) -> None:
    """Centres to 1e-6 mm and every digit's tip on its receiver, in both bindings."""
    chain = made(*tree)
    rows = solved(chain, chain.poses)
    for index, joint in enumerate(chain.joints):
        found = rows[joint.name]
        np.testing.assert_allclose([found[f"parent_{k}_mm"] for k in "xyz"], chain.p_mm[index], atol=1e-6)
        np.testing.assert_allclose([found[f"child_{k}_mm"] for k in "xyz"], chain.q_mm[index], atol=1e-6)
    for name, both in tips(chain, chain.poses, rows).items():
        for tip in both:
            measured = chain.poses.position_mm[:, chain.poses.index(name)]
            np.testing.assert_allclose(tip, measured, atol=1e-6)


@given(trees())
@settings(max_examples=25)
def test_results_do_not_move_with_the_transmitter(tree: tuple[int, tuple[int, ...]]) -> None:
    """A moved transmitter, q for -q, a clock of another speed, frames after the first in another order: the
    same joints, and tips that move along.
    """
    chain = made(*tree, off_axis_rad=0.05, noise_mm=0.3)
    poses, rng = chain.poses, np.random.default_rng(tree[0])
    turn, shift = Rotation.random(random_state=rng), rng.normal(size=3) * 1000
    rotation = turn * Rotation.from_quat(np.roll(poses.quaternion, -1, -1).reshape(-1, 4))
    shape = poses.quaternion.shape
    moved = replace(
        poses,
        time_s=poses.time_s * 7.5,
        quaternion=quaternions(rotation).reshape(shape) * rng.choice([-1.0, 1.0], (*shape[:2], 1)),
        position_mm=turn.apply(poses.position_mm.reshape(-1, 3)).reshape(poses.position_mm.shape) + shift,
    )
    order = np.concatenate([[0], 1 + rng.permutation(len(poses.frame) - 1)])  # a binding is to the first
    moved = replace(moved, quaternion=moved.quaternion[order], position_mm=moved.position_mm[order])
    one, other = solved(chain, poses), solved(chain, moved)
    for name, row in one.items():
        tolerance = 1e-7 * (1 + abs(row["slide_mm"]))
        np.testing.assert_allclose(numbers(other[name]), numbers(row), atol=tolerance, err_msg=name)
    scale = 1 + sum(abs(row["slide_mm"]) for row in one.values())
    before, after = tips(chain, poses, one), tips(chain, moved, other)
    for name, both in before.items():
        for tip, tip_moved in zip(both, after[name], strict=True):
            np.testing.assert_allclose(tip_moved, turn.apply(tip[order]) + shift, atol=1e-6 * scale)


@given(trees())
@settings(max_examples=15)
def test_a_mirrored_tree_has_the_mirrored_skeleton(tree: tuple[int, tuple[int, ...]]) -> None:
    """Left and right: mirrored recordings give mirrored centres and the same gaps and lengths."""
    chain = made(*tree, off_axis_rad=0.05, noise_mm=0.3)
    mirror = np.array([1.0, -1.0, 1.0])
    mirrored = replace(
        chain.poses,
        position_mm=chain.poses.position_mm * mirror,
        quaternion=chain.poses.quaternion * np.array([1.0, -1.0, 1.0, -1.0]),
    )
    one, other = solved(chain, chain.poses), solved(chain, mirrored)
    for name, row in one.items():
        tolerance = 1e-7 * (1 + abs(row["slide_mm"]))
        for side in ("parent", "child"):
            centre, image = (np.array([r[f"{side}_{k}_mm"] for k in "xyz"]) for r in (row, other[name]))
            np.testing.assert_allclose(image, centre * mirror, atol=tolerance, err_msg=name)
        for word in ("gap_rms_mm", "range_deg", "sd_mm"):
            np.testing.assert_allclose(other[name][word], row[word], rtol=1e-4, atol=1e-6, err_msg=word)
