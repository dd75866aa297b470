"""A motion is what the tables say: joints where they are, bones turned as they are, nothing mirrored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from export_samples.known_hands import FITTED, POSE, REPLAYED, SKIN_MM, TIPS, KnownHand
from export_samples.moving_fingers import translation_mm
from scipy.spatial.transform import Rotation

from schemas.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, POSED_TIPS
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.poses import Poses
from skeleton.posing import PosedBones, SkeletonJoint
from skeleton.rotations import angle, conjugate, multiply, rotate
from stages.export.motion import (
    DISTAL,
    RECEIVER_TIP,
    SKIN_TIP,
    Origin,
    continuous,
    local_motion,
    rest_pose,
    stiffened,
)
from stages.export.recorded_motion import motion_of, read_motion
from stages.simulate.random_hand import BONES, DIGITS


def test_a_fitted_hand_is_where_its_tables_have_it(known: KnownHand) -> None:
    motion, truth = known.motion(FITTED), known.made.truth
    for index, joint in enumerate(motion.joints):
        if joint.name.endswith(SKIN_TIP):
            beyond = motion.position_mm[:, index] - motion.position_mm[:, joint.parent]
            along = rotate(motion.quaternion[:, joint.parent], SKIN_MM * DISTAL)
            np.testing.assert_allclose(beyond, along, atol=1e-9)
            continue
        place = (
            truth.tip_mm[:, DIGITS.index(joint.digit)]
            if joint.tip
            else truth.bone_position_mm[:, BONES.index(joint.segment)]
        )
        np.testing.assert_array_equal(motion.position_mm[:, index], place)
    assert len(motion.joints) == 30
    assert motion.rate_hz == pytest.approx(240)


def test_bone_frames_are_webxr_ones(known: KnownHand) -> None:
    """-Z is distal, +Y dorsal, +X their product: our x, z and -y; the thumb's metacarpal has its own test."""
    motion, truth = known.motion(FITTED), known.made.truth
    for index, joint in enumerate(motion.joints):
        if joint.tip or joint.segment == "thumb_metacarpal":
            continue
        ours = Rotation.from_quat(np.roll(truth.bone_quaternion[:, BONES.index(joint.segment)], -1, -1))
        webxr = Rotation.from_quat(np.roll(motion.quaternion[:, index], -1, -1))
        for here, there in (([0, 0, -1], [1, 0, 0]), ([0, 1, 0], [0, 0, 1]), ([1, 0, 0], [0, -1, 0])):
            np.testing.assert_allclose(webxr.apply(here), ours.apply(there), atol=1e-12)


def test_a_thumb_metacarpal_faces_its_nail(known: KnownHand) -> None:
    """About its long axis it stands as its phalanges do; only that is changed, by a constant."""
    motion, truth = known.motion(FITTED), known.made.truth
    index = motion.index("thumb_cmc")
    ours = truth.bone_quaternion[:, BONES.index("thumb_metacarpal")]
    np.testing.assert_allclose(
        rotate(motion.quaternion[:, index], DISTAL), rotate(ours, np.eye(3)[0]), atol=1e-12
    )
    change = multiply(conjugate(ours), motion.quaternion[:, index])
    assert np.degrees(angle(multiply(conjugate(change[0]), change))).max() < 1e-6
    relative = Rotation.from_quat(np.roll(local_motion(motion).quaternion[:, index + 1], -1, -1))
    twist = np.degrees(2 * np.arctan2(relative.as_quat()[:, 2], relative.as_quat()[:, 3]))
    assert np.abs((twist + 180) % 360 - 180).max() < 45, "against some 100 where it faces the hand's back"


def test_left_is_left(known: KnownHand) -> None:
    """Palm down and pointing ahead, the thumb of a right hand is on the left, and the other way round."""
    side = -1 if known.recording.hand.hand == "right" else 1
    for model in (REPLAYED, FITTED):
        motion = known.motion(model)
        place, _ = rest_pose(motion)
        tip = RECEIVER_TIP if model == REPLAYED else SKIN_TIP
        assert np.sign(place[motion.index(f"thumb{tip}")][0]) == side
        assert np.sign(place[motion.index(f"little{tip}")][0]) == -side
        assert place[motion.index(f"middle{tip}")][2] < -100
        seen = rotate(conjugate(motion.quaternion[:, 0]), motion.position_mm[:, 1] - motion.position_mm[:, 0])
        assert (np.sign(seen[:, 0]) == side).all()


def test_a_rest_pose_has_straight_fingers_and_this_persons_fan(known: KnownHand) -> None:
    motion = known.motion(FITTED)
    place, turn = rest_pose(motion)
    for digit in ("index", "middle", "ring", "little"):
        chain = place[[motion.index(f"{digit}_{part}") for part in ("mcp", "pip", "dip", "tip")]]
        steps = np.diff(chain, axis=0)
        along = steps / np.linalg.norm(steps, axis=1)[:, None]
        np.testing.assert_allclose(along, along[:1].repeat(3, 0), atol=1e-9)
    local = local_motion(motion)
    base = motion.index("index_cmc")
    off = multiply(conjugate(turn[base]), local.quaternion[:, base])
    assert np.degrees(angle(off)).max() < 15


def test_local_motion_builds_the_world_again(known: KnownHand) -> None:
    motion = known.motion(REPLAYED)
    local = local_motion(motion)
    place, turn = local.offset_mm.copy(), local.quaternion.copy()
    for index, joint in enumerate(motion.joints[1:], 1):
        place[:, index] = place[:, joint.parent] + rotate(turn[:, joint.parent], place[:, index])
        turn[:, index] = multiply(turn[:, joint.parent], turn[:, index])
    np.testing.assert_allclose(place, motion.position_mm, atol=1e-9)
    assert angle(multiply(conjugate(turn), motion.quaternion)).max() < 1e-9


def test_signs_are_continuous_and_gaps_stay() -> None:
    turn = np.tile([0.5, 0.5, 0.5, 0.5], (6, 1, 1)) * np.array([-1, 1, -1, -1, 1, 1])[:, None, None]
    turn[2] = np.nan
    found = continuous(turn)
    assert np.isnan(found[2]).all()
    np.testing.assert_array_equal(np.delete(found, 2, 0), np.full((5, 1, 4), 0.5))


def test_bones_are_as_long_as_the_table_says(known: KnownHand) -> None:
    for model in (REPLAYED, FITTED):
        motion = known.motion(model)
        lengths = {row["bone"]: row["length_mm"] for row in known.rows(model, BONE_LENGTHS)}
        for joint, offset in zip(motion.joints, motion.rest_offset_mm, strict=True):
            if joint.name.endswith(SKIN_TIP):
                np.testing.assert_allclose(offset, SKIN_MM * DISTAL, atol=1e-9)
            elif joint.parent > 0:
                above = motion.joints[joint.parent].segment
                np.testing.assert_allclose(offset, DISTAL * lengths[above], atol=1e-9)


def test_stiff_bones_keep_their_length_and_say_what_that_moves(known: KnownHand) -> None:
    moving = known.motion(REPLAYED)
    motion = stiffened(moving)
    assert translation_mm(motion).max() < 1e-9
    np.testing.assert_array_equal(motion.quaternion, moving.quaternion)
    assert "bones kept at their length, which moves joints by up to" in motion.notes[-1]


def test_a_fitted_hinge_turns_about_its_axis_only(known: KnownHand) -> None:
    motion = known.motion(FITTED)
    local = local_motion(motion)
    for name in ("index_pip", "middle_dip", "little_pip"):
        index = motion.index(name)
        axis = motion.axis[index]
        seen = rotate(local.quaternion[:, index], axis)
        apart = np.degrees(np.arccos(np.clip(seen @ seen[0], -1, 1)))
        assert apart.max() < 4, "fixed in the bone before, but for the rotation that goes with flexion"
        assert abs(axis[0]) > 0.9, "about across the bone"


def test_a_tree_that_is_no_hand() -> None:
    """No anatomy, no thumb: names as they are, a first bone at rest as it stands on average."""
    layout, rng = read_layout("arm"), np.random.default_rng(1)
    shape = (20, len(layout.measured))
    turn = Rotation.random(20 * 4, random_state=rng).as_quat(scalar_first=True).reshape(*shape, 4)
    poses = Poses(
        layout.measured,
        np.arange(20),
        np.arange(20) / 100,
        rng.normal(size=(*shape, 3)),
        turn,
        np.ones(shape, bool),
    )
    joints = (SkeletonJoint("scapula", -1, "scapula"), SkeletonJoint("shoulder", 0, "upper_arm", "arm"))
    relative = turn[:1, 1].repeat(20, 0)
    quaternion = np.stack([turn[:, 0], multiply(turn[:, 0], relative)], 1)
    place = np.stack([poses.position_mm[:, 0]] * 2, 1)
    place[:, 1] += rotate(turn[:, 0], np.array([1.0, 2.0, 3.0]))
    unknown = np.full((2, 3), np.nan)
    bones = PosedBones(joints, place, quaternion, np.stack([np.zeros(3), unknown[0]]), unknown, {})
    motion = motion_of(bones, poses, layout, Origin("01", "right", "reach", "", "made", "arm"))
    assert motion.names == ("scapula", "shoulder")
    assert np.isnan(motion.neutral).all()
    np.testing.assert_allclose(motion.rest_offset_mm[1], [-2, 3, -1], atol=1e-12)
    assert motion.rate_hz == pytest.approx(100)
    local = local_motion(motion).quaternion[:, 1]
    assert angle(multiply(conjugate(local), motion.rest_rotation[1])).max() < 1e-7


def test_a_failed_joint_leaves_its_digit_out(fresh: KnownHand) -> None:
    rows = fresh.rows(REPLAYED, JOINT_CENTRES)
    for row in rows:
        if row["joint"] == "ring_dip":
            row |= {"status": "failed", "message": "too few frames (3)"}
    fresh.write(REPLAYED, JOINT_CENTRES, rows)
    motion = fresh.motion(REPLAYED)
    assert motion.notes == ("ring left out: ring_dip failed: too few frames (3)",)
    assert not [joint for joint in motion.joints if joint.digit == "ring"]
    fail_all = [row | {"status": "failed", "message": "x"} for row in rows if row["joint"] != "wrist"]
    fresh.write(REPLAYED, JOINT_CENTRES, [*fail_all, *(row for row in rows if row["joint"] == "wrist")])
    with pytest.raises(InputError, match=r"no digit of opposition can be exported: thumb left out: .*; ring"):
        fresh.motion(REPLAYED)
    fresh.write(REPLAYED, JOINT_CENTRES, [row for row in rows if row["joint"] != "wrist"])
    with pytest.raises(InputError, match=r"wrist failed \(it was not solved\), and it is the .* root"):
        fresh.motion(REPLAYED)


def test_a_digit_that_is_never_posed_is_left_out(fresh: KnownHand) -> None:
    rows = fresh.rows(FITTED, BONE_POSES)
    for row in rows:
        if row["segment"] == "index_middle":
            row |= dict.fromkeys(POSE)
    fresh.write(FITTED, BONE_POSES, rows)
    motion = fresh.motion(FITTED)
    assert "index left out: index_pip has no pose in any frame" in motion.notes
    assert not [joint for joint in motion.joints if joint.digit == "index"]
    assert motion.joints[motion.index("middle_mcp")].parent == motion.index("middle_cmc")
    assert motion.whole.all()


def test_skin_that_nobody_knows_is_left_out_and_its_digit_stays(fresh: KnownHand) -> None:
    rows = [row | dict.fromkeys(TIPS[3:]) for row in fresh.rows(FITTED, POSED_TIPS)]
    fresh.write(FITTED, POSED_TIPS, rows)
    motion = fresh.motion(FITTED)
    assert [name for name in motion.names if name.endswith(SKIN_TIP)] == []
    assert sum(joint.tip for joint in motion.joints) == 5
    assert motion.notes == ()


def test_a_bone_without_length_is_refused(fresh: KnownHand) -> None:
    rows = fresh.rows(FITTED, BONE_LENGTHS)
    rows[1] |= {"length_mm": 0.0}
    fresh.write(FITTED, BONE_LENGTHS, rows)
    with pytest.raises(InputError, match=r"thumb_proximal is 0\.0 mm long"):
        fresh.motion(FITTED)


def test_a_digit_that_hangs_from_no_bone_is_refused(fresh: KnownHand) -> None:
    plan = fresh.plan
    layout = plan.layouts["right"]
    digits = {**layout.digits, "thumb": replace(layout.digits["thumb"], base="forearm")}
    layouts = {"right": replace(layout, digits=digits)}
    with pytest.raises(InputError, match="digit thumb hangs from forearm, which is no bone"):
        read_motion(replace(plan, layouts=layouts), fresh.recording, REPLAYED)


def test_inputs_are_told_by_their_hashes(right: KnownHand) -> None:
    origin = right.motion(FITTED).origin
    assert set(origin.inputs) == {
        "sub-01/right/opposition/poses.parquet",
        *(f"sub-01/{name}.parquet" for name in ("joint_centres", "bone_lengths")),
        *(f"sub-01/fits/right/{FITTED}/{name}.parquet" for name in ("bone_poses", "posed_tips")),
    }
    assert all(len(digest) == 64 for digest in origin.inputs.values())
