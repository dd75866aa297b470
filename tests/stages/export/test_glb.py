"""A GLB file holds skeleton, body and motion: read by a reader that shares nothing with the writer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from export_samples.minimal_glb import Glb, read_glb
from export_samples.moving_fingers import both_hands, moving_fingers, random_fingers, translation_mm
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from schemas import PROGRAM
from schemas.errors import InputError
from skeleton.rotations import matrix
from stages.export import glb_document
from stages.export.axes import Target
from stages.export.bone_mesh import bone_mesh
from stages.export.file_facts import facts
from stages.export.glb import write, write_scene
from stages.export.motion import SkeletonMotion, rest_pose
from stages.export.rig_names import RIGS
from stages.export.rigging import with_webxr_names

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


@pytest.mark.parametrize("model", [REPLAYED, FITTED])
@pytest.mark.parametrize("stiff", [False, True])
def test_every_joint_is_where_the_motion_has_it(
    known: KnownHand, tmp_path: Path, model: str, stiff: bool
) -> None:
    motion = with_webxr_names(known.ready(model, stiff=stiff))
    glb = written(motion, tmp_path)
    posed = glb.posed(key_times(motion))[:, nodes_of(glb, motion)]
    assert len(posed) == len(motion.frame) > 50
    np.testing.assert_allclose(posed[..., :3, 3], motion.position_mm / 1000, atol=NEAR_M)
    np.testing.assert_allclose(posed[..., :3, :3], matrix(motion.quaternion), atol=2e-6)


def test_a_hand_has_the_names_and_the_tree_of_webxr(known: KnownHand, tmp_path: Path) -> None:
    motion = with_webxr_names(known.ready())
    glb = written(motion, tmp_path)
    side = known.recording.hand.hand
    below = glb.below(f"{side}-hand")
    assert len(below) == 25
    assert set(below) == set(RIGS["webxr"].names(side).values())
    above = {name: glb.names[glb.parents[index]] for name, index in below.items()}
    assert above["wrist"] == f"{side}-hand"
    assert above["index-finger-metacarpal"] == "wrist"
    assert above["pinky-finger-tip"] == "pinky-finger-phalanx-distal"
    assert "25 joints" in glb.json["asset"]["extras"]["motions"][0]["notes"][-1]


def test_other_names_stay(right: KnownHand, tmp_path: Path) -> None:
    """Of another rig, and of a skeleton that is no hand."""
    rigged = with_webxr_names(right.ready(rig="unity"))
    assert set(written(rigged, tmp_path).below("right-hand")) == set(rigged.names)
    made = moving_fingers(5)
    arm = replace(made, joints=tuple(replace(j, name=f"arm {i} 腕") for i, j in enumerate(made.joints)))
    glb = written(arm, tmp_path)
    assert set(glb.below("right-made")) == set(arm.names)
    assert [m["name"] for m in glb.json["materials"]] == ["bone"], "only known digits have nails"


def test_nodes_stand_at_rest_where_the_hand_begins(known: KnownHand, tmp_path: Path) -> None:
    motion = with_webxr_names(known.ready())
    glb = written(motion, tmp_path)
    nodes = nodes_of(glb, motion)
    posed = glb.posed()[0, nodes]
    rest_mm, rest_turn = rest_pose(motion)
    np.testing.assert_allclose(posed[:, :3, 3], (rest_mm + motion.position_mm[0, 0]) / 1000, atol=1e-9)
    expected = Rotation.from_quat(np.roll(rest_turn, -1, -1)).as_matrix()
    np.testing.assert_allclose(posed[:, :3, :3], expected, atol=1e-9)
    (skin,) = glb.json["skins"]
    inverse = glb.arrays[skin["inverseBindMatrices"]].transpose(0, 2, 1)
    np.testing.assert_allclose(inverse @ posed, np.tile(np.eye(4), (25, 1, 1)), atol=NEAR_M)
    assert skin["joints"] == nodes


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


def test_the_body_reaches_from_joint_to_joint(known: KnownHand, tmp_path: Path) -> None:
    """With bones of constant length: a ball about every joint, and the bone before ends in its middle."""
    motion = with_webxr_names(known.ready(stiff=True))
    glb = written(motion, tmp_path)
    body = glb.names.index(f"{known.recording.hand.hand}-hand-body")
    moved = glb.vertices(glb.posed(key_times(motion)[[0, -1]]), body) * 1000
    riders = glb.riders(body)
    for index, node in enumerate(nodes_of(glb, motion)):
        place = motion.position_mm[[0, -1], None, index]
        away = np.linalg.norm(moved[:, riders == node] - place, axis=-1)
        ball = np.abs(away - away[0, 0]).max(0) < 1e-2
        assert ball.sum() >= 42
        assert 3 < away[0, 0] < 8, "a hand's ball is of a finger's size"
        above = motion.joints[index].parent
        if above >= 0 and np.linalg.norm(motion.rest_offset_mm[index]) > 1:
            bone = moved[:, riders == nodes_of(glb, motion)[above]]
            assert np.linalg.norm(bone - place, axis=-1).min(1).max() < 1e-2


def test_nails_are_on_the_back(known: KnownHand) -> None:
    motion = with_webxr_names(known.motion(FITTED))
    mesh = bone_mesh(motion)
    rest_mm, rest_turn = rest_pose(motion)
    nailed = set(mesh.joint[mesh.nail.ravel()])
    assert nailed == {index for index, joint in enumerate(motion.joints) if joint.tip}
    for index in nailed:
        mine = mesh.nail[mesh.joint[mesh.nail[:, 0]] == index].ravel()
        back = Rotation.from_quat(np.roll(rest_turn[index], -1)).inv()
        own = back.apply(mesh.position_mm[mine] - rest_mm[index])
        assert own[:, 1].min() > 2, "above the bone"
        assert own[:, 2].mean() > 0, "before its end"


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


def test_every_joint_turns_and_only_those_that_move_have_places(right: KnownHand, tmp_path: Path) -> None:
    free, stiff = with_webxr_names(right.ready(REPLAYED)), with_webxr_names(right.ready(stiff=True))
    assert (translation_mm(free) > 1e-3).sum() > 10
    assert (translation_mm(stiff) < 1e-9).all()
    for motion in (free, stiff):
        glb = written(motion, tmp_path)
        keys = glb.keys()
        turning = [glb.names[node] for node, path in keys if path == "rotation"]
        placed = [glb.names[node] for node, path in keys if path == "translation"]
        assert sorted(turning) == sorted(webxr(motion))
        names = webxr(motion)
        assert placed == [names[0], *(names[i] for i in np.flatnonzero(translation_mm(motion) > 1e-6))]
        for (_, path), (times, values) in keys.items():
            np.testing.assert_array_equal(times, key_times(motion))
            if path == "rotation":
                assert (np.sum(values[1:] * values[:-1], -1) > 0).all(), "a sign that jumps"


def test_joints_far_from_the_transmitter_are_as_near(tmp_path: Path) -> None:
    motion = moving_fingers(200, slip_mm=2.0)
    motion = replace(motion, position_mm=motion.position_mm + 1700.0)
    glb = written(motion, tmp_path)
    posed = glb.posed(key_times(motion))[:, nodes_of(glb, motion)]
    np.testing.assert_allclose(posed[..., :3, 3], motion.position_mm / 1000, atol=NEAR_M)


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


def test_one_frame_is_a_file_with_or_without_a_time(tmp_path: Path) -> None:
    for time_s in (3.5, np.nan):
        motion = replace(moving_fingers(1), time_s=np.array([time_s]), rate_hz=np.nan)
        glb = written(motion, tmp_path)
        assert [times.tolist() for times, _ in glb.keys().values()] == [[0.0]] * 7
        start = glb.json["animations"][0]["extras"]
        assert start == {"first_frame": 7} | ({} if np.isnan(time_s) else {"first_device_time_s": 3.5})
        posed = glb.posed(np.zeros(1))[:, nodes_of(glb, motion)]
        np.testing.assert_allclose(posed[..., :3, 3], motion.position_mm / 1000, atol=NEAR_M)


def test_it_says_where_it_comes_from(right: KnownHand, tmp_path: Path) -> None:
    motion = with_webxr_names(right.ready())
    motion = replace(motion, origin=replace(motion.origin, licence="CC BY 4.0, © 手"))
    glb = written(motion, tmp_path)
    asset = glb.json["asset"]
    assert asset["copyright"] == "CC BY 4.0, © 手"
    assert asset["generator"].startswith(PROGRAM)
    (said,) = asset["extras"]["motions"]
    assert said["inputs_sha256"] == dict(motion.origin.inputs)
    assert {k: said[k] for k in ("length_unit", "world")} == {
        k: facts(motion, METRES)[k] for k in ("length_unit", "world")
    }
    (animation,) = glb.json["animations"]
    assert animation["name"] == "right-hand opposition"
    assert animation["extras"]["first_device_time_s"] == motion.time_s[0]
    assert "copyright" not in written(moving_fingers(2), tmp_path).json["asset"]


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


def test_times_that_float32_cannot_tell_apart_are_refused(tmp_path: Path) -> None:
    motion = replace(moving_fingers(3), time_s=np.array([0.0, 60_000.0, 60_000.001]))
    with pytest.raises(InputError, match="does not grow from frame 8"):
        write(motion, METRES, tmp_path / "a.glb")


def test_a_file_that_glb_cannot_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glb_document, "LARGEST", 100_000)
    with pytest.raises(InputError, match="GLB cannot have more than 100000; write fewer frames"):
        write(moving_fingers(1000), METRES, tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())
