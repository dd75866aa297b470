"""A GLB file holds skeleton, body and motion: read by a reader that shares nothing with the writer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import KnownHand
from export_samples.minimal_glb import Glb, read_glb
from export_samples.moving_fingers import both_hands, moving_fingers, random_fingers
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shukotsu.skeleton.rotations import matrix
from shukotsu.stages.export.axes import Target
from shukotsu.stages.export.bone_mesh import bone_mesh
from shukotsu.stages.export.glb import write, write_scene
from shukotsu.stages.export.motion import SkeletonMotion, rest_pose
from shukotsu.stages.export.rigging import with_webxr_names

METRES = Target("m", "y")
NEAR_M = 3e-7
"""Of float32 and metres; asked for is 1e-6."""


def written(motion: SkeletonMotion, folder: Path) -> Glb:
    write(motion, METRES, folder / "motion.glb")
    return read_glb(folder / "motion.glb")


def webxr(motion: SkeletonMotion) -> list[str]:
    """The motion's joints as WebXR names them."""
    return list(with_webxr_names(motion).names)


def nodes_of(glb: Glb, motion: SkeletonMotion, hand: str | None = None) -> list[int]:
    """The nodes of the motion's joints."""
    below = glb.below(hand or f"{motion.origin.hand}-{_kind(motion)}")
    return [below[name] for name in webxr(motion)]


def _kind(motion: SkeletonMotion) -> str:
    return "hand" if np.isfinite(motion.neutral).any() else motion.origin.layout


def key_times(motion: SkeletonMotion) -> np.ndarray:
    """Times of the keys, as float32 has them."""
    return (motion.time_s - motion.time_s[0]).astype(np.float32).astype(float)


def test_the_body_goes_with_the_bones(known: KnownHand, tmp_path: Path) -> None:
    """Every vertex stays where it is in its joint's frame, and the frame is that of the motion."""
    motion = with_webxr_names(known.ready())
    glb = written(motion, tmp_path)
    body = glb.names.index(f"{known.recording.hand.hand}-hand-body")
    assert glb.parents[body] == -1, "what is above a skinned mesh would not move it"
    riders, nodes = glb.riders(body), nodes_of(glb, motion)
    assert set(riders) == set(nodes)
    moved = glb.vertices(glb.posed(key_times(motion)[::40]), body)
    mesh = bone_mesh(motion)
    rest_mm, rest_turn = rest_pose(motion)
    frame = matrix(motion.quaternion)[::40]
    for index, node in enumerate(nodes):
        mine = riders == node
        back = Rotation.from_quat(np.roll(rest_turn[index], -1)).inv()
        own = back.apply(mesh.position_mm[mine] - rest_mm[index])
        expected = np.einsum("tij,vj->tvi", frame[:, index], own) + motion.position_mm[::40, None, index]
        np.testing.assert_allclose(moved[:, mine], expected / 1000, atol=2e-6)


def test_the_body_is_closed_and_faces_outward() -> None:
    mesh = bone_mesh(moving_fingers(1))
    triangles = mesh.position_mm[mesh.bone]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.linalg.norm(across, axis=1).min() > 0
    facing = mesh.normal[mesh.bone].mean(1)
    assert ((across * facing).sum(-1) > 0).all()
    corner = {tuple(p): i for i, p in enumerate(np.unique(mesh.position_mm.round(6), axis=0))}
    index = np.array([corner[tuple(p)] for p in mesh.position_mm.round(6)])[mesh.bone]
    edges = np.concatenate([index[:, [0, 1]], index[:, [1, 2]], index[:, [2, 0]]])
    there, back = sorted(map(tuple, edges)), sorted((b, a) for a, b in edges)
    assert there == back, "every edge once in either direction"
    assert np.linalg.det(triangles).sum() > 0, "its volume is positive"


@settings(max_examples=12)
@given(st.integers(1, 30), st.integers(0, 2**31), st.sampled_from([0.0, 0.7]))
def test_any_motion_comes_back(
    tmp_path_factory: pytest.TempPathFactory, n: int, seed: int, slip: float
) -> None:
    motion = random_fingers(n, seed, slip)
    glb = written(motion, tmp_path_factory.mktemp("any"))
    posed = glb.posed(key_times(motion))[:, nodes_of(glb, motion)]
    np.testing.assert_allclose(posed[..., :3, 3], motion.position_mm / 1000, atol=1e-6)
    np.testing.assert_allclose(posed[..., :3, :3], matrix(motion.quaternion), atol=3e-6)


def test_joints_tell_their_bone_freedom_and_axis(right: KnownHand, tmp_path: Path) -> None:
    motion = with_webxr_names(right.ready())
    glb = written(motion, tmp_path)
    nodes = nodes_of(glb, motion)
    pip = motion.index("index-finger-phalanx-intermediate")
    said = glb.json["nodes"][nodes[pip]]["extras"]
    assert said["bone"] == "index_middle"
    assert said["degrees_of_freedom"] == motion.joints[pip].dof == 1
    np.testing.assert_allclose(said["axis"], motion.axis[pip], atol=1e-9)
    assert set(glb.json["nodes"][nodes[0]]["extras"]) == {"bone"}


def test_two_hands_are_one_scene_and_an_animation_each(tmp_path: Path) -> None:
    hands = both_hands(0.1)
    (said,) = write_scene(hands, METRES, tmp_path / "both.glb")
    assert said.startswith("2 animations, each from 0 s on its own")
    glb = read_glb(tmp_path / "both.glb")
    assert [skin["name"] for skin in glb.json["skins"]] == ["right-made", "left-made"]
    assert [a["name"] for a in glb.json["animations"]] == ["right-made wave", "left-made wave"]
    for index, hand in enumerate(hands):
        nodes = nodes_of(glb, hand)
        posed = glb.posed(key_times(hand), index)[:, nodes]
        np.testing.assert_allclose(posed[..., :3, 3], hand.position_mm / 1000, atol=NEAR_M)
        assert {node for node, _ in glb.keys(index)} == set(nodes)
