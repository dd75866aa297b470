"""Reading the motion to export from the tables: bone frames, rest pose, hinges, failures and frame ranges."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated_hands import FITTED, REPLAYED, SimulatedHand

from shukotsu.errors import InputError
from shukotsu.export import exported_motion
from shukotsu.export.exported_motion import in_webxr, local_motion, read_motion, rest_pose
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.hand.posing import Origin, PosedRecording, SkeletonJoint
from shukotsu.hand.rotations import angle, conjugate, multiply, rotate
from shukotsu.simulate.random_hand import BONES
from shukotsu.study.layout import read_layout
from shukotsu.tables.catalogue import JOINT_CENTRES
from shukotsu.tables.poses import Poses, RecordingName


def test_bone_frames_follow_the_webxr_convention(hand: SimulatedHand) -> None:
    """WebXR's -Z (distal), +Y (dorsal) and +X are our x, z and -y; the thumb metacarpal has a separate
    test.
    """
    motion, truth = hand.motion(FITTED), hand.simulated.truth
    for index, joint in enumerate(motion.joints):
        if joint.tip or joint.segment == "thumb_metacarpal":
            continue
        ours = Rotation.from_quat(np.roll(truth.bone_quaternion[:, BONES.index(joint.segment)], -1, -1))
        webxr = Rotation.from_quat(np.roll(motion.quaternion[:, index], -1, -1))
        for here, there in (([0, 0, -1], [1, 0, 0]), ([0, 1, 0], [0, 0, 1]), ([1, 0, 0], [0, -1, 0])):
            np.testing.assert_allclose(webxr.apply(here), ours.apply(there), atol=1e-12)


def test_a_rest_pose_has_straight_fingers_and_the_persons_spread(hand: SimulatedHand) -> None:
    motion = hand.motion(FITTED)
    position_mm, turn = rest_pose(motion)
    for digit in ("index", "middle", "ring", "little"):
        chain = position_mm[[motion.index(f"{digit}_{part}") for part in ("mcp", "pip", "dip", "tip")]]
        steps = np.diff(chain, axis=0)
        along = steps / np.linalg.norm(steps, axis=1)[:, None]
        np.testing.assert_allclose(along, along[:1].repeat(3, 0), atol=1e-9)
    _, local = local_motion(motion)
    base = motion.index("index_cmc")
    off = multiply(conjugate(turn[base]), local[:, base])
    assert np.degrees(angle(off)).max() < 15


def test_a_fitted_hinge_turns_about_its_axis_only(hand: SimulatedHand) -> None:
    motion = hand.motion(FITTED)
    _, local = local_motion(motion)
    for name in ("index_pip", "middle_dip", "little_pip"):
        index = motion.index(name)
        axis = motion.axis[index]
        seen = rotate(local[:, index], axis)
        apart = np.degrees(np.arccos(np.clip(seen @ seen[0], -1, 1)))
        assert apart.max() < 4, "fixed in the proximal bone except for rotation coupled to flexion"
        assert abs(axis[0]) > 0.9, "roughly perpendicular to the bone"


def test_a_layout_without_anatomy_keeps_its_joint_names() -> None:
    """The rest pose of its first joint is the average posture."""
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
    position_mm = np.stack([poses.position_mm[:, 0]] * 2, 1)
    position_mm[:, 1] += rotate(turn[:, 0], np.array([1.0, 2.0, 3.0]))
    unknown = np.full((2, 3), np.nan)
    origin = Origin(RecordingName("01", "right", "reach"), "made", "arm")
    offset = np.stack([np.zeros(3), unknown[0]])
    bones = PosedRecording(joints, position_mm, quaternion, poses, offset, unknown, origin=origin)
    motion = in_webxr(bones, layout)
    assert motion.names == ("scapula", "shoulder")
    assert np.isnan(motion.neutral).all()
    np.testing.assert_allclose(motion.rest_offset_mm[1], [-2, 3, -1], atol=1e-12)
    assert motion.rate_hz == pytest.approx(100)
    local = local_motion(motion)[1][:, 1]
    assert angle(multiply(conjugate(local), motion.rest[1])).max() < 1e-7


def test_a_digit_with_a_failed_joint_is_left_out(fresh: SimulatedHand) -> None:
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
    with pytest.raises(InputError, match=r"wrist failed: it was not solved, and it is the .* root"):
        fresh.motion(REPLAYED)


def test_ranges_use_frame_numbers_and_long_recordings_are_thinned(
    right: SimulatedHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, posed = right.motion(FITTED), recording_reader(right.plan, right.recording, FITTED)
    part = read_motion(posed, frames=(20, 30))
    assert part.frame.tolist() == list(range(20, 31))
    assert part.notes == ("frames 20 to 30 only, as requested",)
    np.testing.assert_array_equal(part.quaternion, whole.quaternion[whole.frame.searchsorted(part.frame)])
    with pytest.raises(InputError, match=r"no frame of the recording is in 900:; it has \d to 2\d\d"):
        read_motion(posed, frames=(900, None))
    monkeypatch.setattr(exported_motion, "MOST_FRAMES", 100)
    some = read_motion(posed)
    assert some.frame.tolist() == whole.frame[::3].tolist()
    assert some.rate_hz == pytest.approx(80)
    assert some.notes == ("one frame in 3, since at most 100 are exported; --frames exports all of a part",)
    np.testing.assert_array_equal(some.position_mm, whole.position_mm[::3])
    assert read_motion(posed, frames=(20, 30)).frame.tolist() == list(range(20, 31))
