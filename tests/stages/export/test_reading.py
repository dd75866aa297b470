"""A motion is what the tables say: joints where they are, bones turned as they are, nothing mirrored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand
from pipeline import import_recording, run_hand
from scipy.spatial.transform import Rotation

from kinematics.rotations import angle, conjugate, multiply, rotate
from schemas.catalogue import BONE_LENGTHS, BONE_POSES, JOINT_CENTRES, METACARPALS, TIPS
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import Results
from schemas.study import Hand, Recording
from schemas.tables import Provenance, write_failure
from stages.export.motion import (
    DISTAL,
    SkeletonMotion,
    continuous,
    local_motion,
    rest_pose,
    stiffened,
    translation_mm,
)
from stages.export.reading import read_motion
from stages.simulate.anatomy import BONES, DIGITS


def test_a_fitted_hand_is_where_its_tables_have_it(known: KnownHand) -> None:
    motion, truth = known.motion(FITTED), known.made.truth
    for index, joint in enumerate(motion.joints):
        place = (
            truth.tip_mm[:, DIGITS.index(joint.digit)]
            if joint.tip
            else truth.bone_position_mm[:, BONES.index(joint.segment)]
        )
        np.testing.assert_array_equal(motion.position_mm[:, index], place)
    assert len(motion.joints) == 25
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


def test_a_replayed_skeleton_has_its_joints_on_their_receivers(known: KnownHand) -> None:
    """Child halves of joint_centres as scipy carries them, the base's parent half, tips at the receivers."""
    motion, poses = known.motion(REPLAYED), known.poses()
    rows = {row["joint"]: row for row in known.rows(REPLAYED, JOINT_CENTRES)}
    for index, joint in enumerate(motion.joints):
        side, segment, point = "child", joint.segment, np.zeros(3)
        if not joint.tip:
            merged = joint.parent == 0 and joint.name != "thumb_cmc"
            side = "parent" if joint.name == "thumb_cmc" else "child"
            row = rows["wrist" if merged else joint.name]
            segment = row[f"{side}_segment"]
            point = np.array([row[f"{side}_{axis}_mm"] for axis in "xyz"])
        carrier = poses.index(segment)
        turn = Rotation.from_quat(np.roll(poses.quaternion[:, carrier], -1, -1))
        place = turn.apply(point) + poses.position_mm[:, carrier]
        place[~poses.valid[:, carrier]] = np.nan
        np.testing.assert_allclose(motion.position_mm[:, index], place, atol=1e-9, err_msg=joint.name)


def test_stiff_bones_replay_the_tips_of_the_tips_table(known: KnownHand) -> None:
    motion = stiffened(known.motion(REPLAYED))
    tips = known.rows(REPLAYED, TIPS)
    for digit in DIGITS:
        ours = [[row[f"tip_{axis}_mm"] for axis in "xyz"] for row in tips if row["digit"] == digit]
        found = motion.position_mm[:, motion.index(f"{digit}_tip")]
        expected = np.array(ours, float)
        usable = np.isfinite(expected).all(1)
        np.testing.assert_allclose(found[usable], expected[usable], atol=1e-9)
        assert usable.sum() > 100
    assert "bones kept at their length" in motion.notes[-1]


def test_metacarpals_turn_as_their_table_says(known: KnownHand) -> None:
    motion = known.motion(REPLAYED)
    rows = [row for row in known.rows(REPLAYED, METACARPALS) if row["digit"] == "little"]
    ours = np.array([[row[f"q{part}"] for part in "wxyz"] for row in rows], float)
    found = motion.quaternion[:, motion.index("little_cmc")]
    np.testing.assert_allclose(rotate(found, DISTAL), rotate(ours, np.eye(3)[0]), atol=1e-12)
    assert np.degrees(angle(multiply(conjugate(found[:1]), found))).max() > 1, "and do turn"


def test_bones_are_as_long_as_the_table_says(known: KnownHand) -> None:
    for model, column in ((REPLAYED, "length_mm"), (FITTED, "bone_mm")):
        motion = known.motion(model)
        lengths = {row["bone"]: row[column] for row in known.rows(model, BONE_LENGTHS)}
        for joint, offset in zip(motion.joints, motion.rest_offset_mm, strict=True):
            if joint.parent > 0:
                above = motion.joints[joint.parent].segment
                np.testing.assert_allclose(offset, DISTAL * lengths[above], atol=1e-9)


def test_left_is_left(known: KnownHand) -> None:
    """Palm down and pointing ahead, the thumb of a right hand is on the left, and the other way round."""
    side = -1 if known.recording.hand.hand == "right" else 1
    for model in (REPLAYED, FITTED):
        motion = known.motion(model)
        place, _ = rest_pose(motion)
        assert np.sign(place[motion.index("thumb_tip")][0]) == side
        assert np.sign(place[motion.index("little_tip")][0]) == -side
        assert place[motion.index("middle_tip")][2] < -100
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


def test_hinge_axes_are_those_of_the_tables(known: KnownHand) -> None:
    """A replayed hinge turns about the axis that the table has in the child's receiver."""
    motion, poses = known.motion(REPLAYED), known.poses()
    rows = {row["joint"]: row for row in known.rows(REPLAYED, JOINT_CENTRES)}
    for name in ("index_pip", "ring_dip", "thumb_ip"):
        index = motion.index(name)
        table = np.array([rows[name][f"axis_child_{axis}"] for axis in "xyz"])
        world = rotate(poses.quaternion[:, poses.index(motion.joints[index].segment)], table)
        np.testing.assert_allclose(rotate(motion.quaternion[:, index], motion.axis[index]), world, atol=1e-9)
    assert np.isnan(motion.axis[0]).all()


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


@pytest.fixture(scope="module")
def arm(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> SkeletonMotion:
    """A real arm: any layout has its skeleton, its root the receiver that the digit hangs from."""
    folder = tmp_path_factory.mktemp("arm")
    paths, hand = Results(folder), Hand("01", "right")
    source = real_data / "upper_limb_poses" / "racing_right.csv"
    recording = Recording(hand, "racing", "", "both", source, "x", folder, "csv", None, "+x", "")
    poses = import_recording(source, paths.poses(recording), task="racing", layout="arm")
    run_hand(poses, poses, REPLAYED, paths.skeleton(REPLAYED, hand), "arm")
    return read_motion(paths, recording, read_layout("arm"), read_model(REPLAYED))


def test_an_arm_has_its_own_names(arm: SkeletonMotion) -> None:
    assert arm.names == ("scapula", "shoulder", "elbow", "wrist", "arm_tip")
    assert arm.parents.tolist() == [-1, 0, 1, 2, 3]
    assert np.isnan(arm.neutral).all()
    assert not arm.whole.all(), "markers were hidden at times"
    lengths = np.linalg.norm(arm.rest_offset_mm[2:], axis=1)
    assert 250 < lengths[0] < 400, "an upper arm"
    assert 200 < lengths[1] < 350, "a forearm"


def test_a_failed_joint_leaves_its_digit_out(fresh: KnownHand) -> None:
    rows = fresh.rows(REPLAYED, JOINT_CENTRES)
    for row in rows:
        if row["joint"] == "ring_dip":
            row |= {"status": "failed", "message": "too few frames (3)"}
    fresh.write(REPLAYED, JOINT_CENTRES, rows)
    motion = fresh.motion(REPLAYED)
    assert len(motion.joints) == 20
    assert motion.notes == ("ring left out: ring_dip failed: too few frames (3)",)
    assert motion.joints[motion.index("little_cmc")].parent == 0
    assert motion.joints[motion.index("little_pip")].parent == motion.index("little_mcp")


def test_a_digit_that_is_never_posed_is_left_out(fresh: KnownHand) -> None:
    rows = fresh.rows(FITTED, BONE_POSES)
    for row in rows:
        if row["segment"] == "index_middle":
            row |= dict.fromkeys(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"))
    fresh.write(FITTED, BONE_POSES, rows)
    motion = fresh.motion(FITTED)
    assert "index left out: index_pip has no pose in any frame" in motion.notes
    assert not [joint for joint in motion.joints if joint.digit == "index"]
    assert motion.whole.all()


def test_a_failed_table_is_refused_with_its_reason(fresh: KnownHand) -> None:
    path = fresh.paths.hand_table(REPLAYED, fresh.recording.hand, "joint_centres")
    write_failure(path, JOINT_CENTRES, "subject 01: no calibration recording", Provenance())
    with pytest.raises(InputError, match="no calibration recording"):
        fresh.motion(REPLAYED)
    path.unlink()
    with pytest.raises(InputError, match="no such file"):
        fresh.motion(REPLAYED)


def test_a_recording_that_was_not_posed_is_refused(fresh: KnownHand) -> None:
    fresh.write(FITTED, BONE_POSES, [row | {"task": "rom"} for row in fresh.rows(FITTED, BONE_POSES)])
    with pytest.raises(InputError, match="role evaluation or both"):
        fresh.motion(FITTED)


def test_a_bone_without_length_is_refused(fresh: KnownHand) -> None:
    rows = fresh.rows(FITTED, BONE_LENGTHS)
    rows[1] |= {"bone_mm": 0.0}
    fresh.write(FITTED, BONE_LENGTHS, rows)
    with pytest.raises(InputError, match=r"thumb_proximal is 0\.0 mm long"):
        fresh.motion(FITTED)


def test_signs_are_continuous_and_gaps_stay() -> None:
    turn = np.tile([0.5, 0.5, 0.5, 0.5], (6, 1, 1)) * np.array([-1, 1, -1, -1, 1, 1])[:, None, None]
    turn[2] = np.nan
    found = continuous(turn)
    assert np.isnan(found[2]).all()
    np.testing.assert_array_equal(np.delete(found, 2, 0), np.full((5, 1, 4), 0.5))


def test_inputs_are_told_by_their_hashes(right: KnownHand) -> None:
    origin = right.motion(FITTED).origin
    assert set(origin.inputs) == {
        "sub-01/right/opposition/poses.parquet",
        *(f"models/{FITTED}/sub-01/right/{name}.parquet" for name in ("joint_centres", "bone_lengths")),
        *(f"models/{FITTED}/sub-01/right/{name}.parquet" for name in ("bone_poses", "posed_tips")),
    }
    assert all(len(digest) == 64 for digest in origin.inputs.values())


def test_translations_are_those_of_the_gaps(right: KnownHand) -> None:
    motion: SkeletonMotion = right.motion(REPLAYED)
    moved = dict(zip(motion.names, translation_mm(motion), strict=True))
    assert moved["wrist"] == 0
    assert moved["index_tip"] < 1e-9, "the distal receiver is where the last bone ends"
    assert 0.05 < moved["index_pip"] < 10
