"""The second drawing of hands says what is true of the poses it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.other_hands import TASKS, Recording, draw_person, record, true_centres
from benchmarks.other_hands.person import Array, Facing
from schemas.layout import read_layout
from schemas.poses import Poses

MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def calibration() -> Recording:
    return record(draw_person(3), "right", "calibration", seed=5, duration_s=30, rate_hz=60, forearm=True)


def turning(poses: Poses, segment: str) -> Rotation:
    return Rotation.from_quat(poses.quaternion[:, poses.index(segment)], scalar_first=True)


def gap_mm(poses: Poses, parent: str, child: str) -> float:
    """How far apart the best point of either receiver stays, rms: least squares, and nothing of anatomy."""
    one, other = (turning(poses, name).as_matrix() for name in (parent, child))
    between = poses.position_mm[:, poses.index(child)] - poses.position_mm[:, poses.index(parent)]
    equations = np.concatenate([one, -other], axis=2).reshape(-1, 6)
    points = np.linalg.lstsq(equations, between.ravel(), rcond=1e-4)[0]
    left = (equations @ points - between.ravel()).reshape(-1, 3)
    return float(np.sqrt((left**2).sum(axis=1).mean()))


def test_joints_and_receivers_are_the_layouts(calibration: Recording) -> None:
    layout = read_layout("config/layouts/liberty16.yaml")
    assert calibration.poses.segments == tuple(layout.measured)
    assert set(calibration.true_centre_mm) == set(layout.joints)
    bare = record(draw_person(3), "right", "grip", seed=5, duration_s=4, rate_hz=60)
    assert "forearm" not in bare.poses.segments
    assert "wrist" not in bare.true_centre_mm


def test_bones_keep_their_length_but_for_the_joints_wander(calibration: Recording) -> None:
    for bone, length_mm in calibration.true_lengths_mm.items():
        digit, part = bone.split("_")
        ends = {"metacarpal": ("cmc", "mcp"), "proximal": ("mcp", "ip" if digit == "thumb" else "pip")}
        ends |= {"middle": ("pip", "dip"), "distal": ("ip" if digit == "thumb" else "dip", None)}
        first, last = ends[part]
        far = (
            calibration.true_tip_mm[digit] if last is None else calibration.true_centre_mm[f"{digit}_{last}"]
        )
        across = np.linalg.norm(far - calibration.true_centre_mm[f"{digit}_{first}"], axis=1)
        assert np.abs(across - length_mm).max() < (3.5 if bone == "thumb_metacarpal" else 2.2)
        assert np.ptp(across) < 4


def test_lengths_are_those_of_people() -> None:
    people = [draw_person(seed) for seed in range(40)]
    index = [one.bones["index_proximal"].length_mm for one in people]
    assert np.mean(index) == pytest.approx(43.7, abs=1.5)
    assert 2 < np.std(index) < 5
    assert {55 <= one.nail_deg <= 90 for one in people} == {True}
    small = draw_person(0, scale=0.7)
    assert small.bones["middle_proximal"].length_mm == pytest.approx(0.7 * 48.2, rel=0.12)


def test_joints_close_as_well_as_skin_lets_them(calibration: Recording) -> None:
    layout = read_layout("config/layouts/liberty16.yaml")
    for name, joint in layout.joints.items():
        if joint.parent not in calibration.poses.segments or joint.child not in calibration.poses.segments:
            continue
        assert 0.2 < gap_mm(calibration.true_pose, joint.parent, joint.child) < 3
        for segment in (joint.parent, joint.child):
            pose = calibration.true_pose
            centre = true_centres(calibration, name, segment)
            rides = turning(pose, segment).apply(centre) + pose.position_mm[:, pose.index(segment)]
            off = np.linalg.norm(rides - calibration.true_centre_mm[name], axis=1)
            assert np.sqrt((off**2).mean()) < 4


@pytest.mark.parametrize("seed", range(6))
def test_receivers_lie_as_the_layout_says(seed: int) -> None:
    person = draw_person(seed, thumb_facing="between")
    for worn in person.worn["right"]:
        bone = person.bones[worn.bone]
        x, y, z = worn.axes.T
        assert x @ bone.along > np.cos(np.deg2rad(20))  # the cable leaves towards the wrist
        off = worn.place - bone.base
        off = off - (off @ bone.along) * bone.along
        if worn.bone not in ("hand", "forearm"):
            assert 4.5 < np.linalg.norm(off) < 16
            assert z @ off > 0.9 * np.linalg.norm(off)  # flat on the skin, z away from it
        if worn.bone != "thumb_metacarpal":
            assert z @ bone.up > np.cos(np.deg2rad(32))
            assert y @ np.cross(bone.up, bone.along) > 0.8  # to the thumb's side


@pytest.mark.parametrize(
    ("facing", "low", "high"), [("nail", 40, 110), ("hand", -20, 25), ("between", -20, 110)]
)
def test_the_thumbs_receiver_faces_as_asked(facing: Facing, low: float, high: float) -> None:
    turns = []
    for seed in range(20):
        person = draw_person(seed, thumb_facing=facing)
        worn = next(one for one in person.worn["left"] if one.bone == "thumb_metacarpal")
        along = person.bones["thumb_metacarpal"].along
        back = np.array([0.0, 0.0, 1.0]) - along[2] * along
        z = worn.axes[:, 2]
        turns.append(np.rad2deg(np.arctan2(-np.cross(back, z) @ along, back @ z)))
    assert low <= min(turns)
    assert max(turns) <= high
    if facing == "between":
        assert np.ptp(turns) > 50


def test_a_left_hand_is_the_right_one_in_a_mirror() -> None:
    person = draw_person(8)
    person = replace(person, worn={"right": person.worn["right"], "left": person.worn["right"]})
    right, left = (
        record(person, side, "grip", seed=2, duration_s=5, rate_hz=60) for side in ("right", "left")
    )
    assert np.allclose(left.true_pose.position_mm, right.true_pose.position_mm * MIRROR)
    for name, centre in right.true_centre_mm.items():
        assert np.allclose(left.true_centre_mm[name], centre * MIRROR)
    for segment in right.poses.segments:
        ours = turning(right.true_pose, segment).as_matrix() * MIRROR[:, None]
        theirs = turning(left.true_pose, segment).as_matrix()
        assert np.allclose(theirs, ours * [1, -1, 1])  # x to the tip, z off the skin, y to the other side


def thumbs_side(recording: Recording) -> float:
    """How far along the hand receiver's y axis the index finger's knuckle is from the little finger's, mm."""
    return float(
        true_centres(recording, "index_mcp", "hand")[1] - true_centres(recording, "little_mcp", "hand")[1]
    )


def test_the_receivers_y_axis_points_to_the_thumb_of_a_right_hand_only() -> None:
    for side, sign in (("right", 1), ("left", -1)):
        assert (
            sign * thumbs_side(record(draw_person(1), side, "typing", seed=1, duration_s=3, rate_hz=60)) > 25
        )


@pytest.mark.parametrize("task", TASKS)
def test_the_same_seed_draws_the_same(task: str) -> None:
    one, again = (record(draw_person(6), "left", task, seed=9, duration_s=4, rate_hz=60) for _ in range(2))
    assert np.array_equal(one.poses.position_mm, again.poses.position_mm)
    assert np.array_equal(one.poses.quaternion, again.poses.quaternion)
    other = record(draw_person(6), "left", task, seed=10, duration_s=4, rate_hz=60)
    assert not np.allclose(one.poses.position_mm, other.poses.position_mm)


@pytest.mark.parametrize("task", TASKS)
def test_receivers_stay_within_the_trackers_reach(task: str) -> None:
    for seed in range(3):
        recording = record(draw_person(seed), "right", task, seed=seed, duration_s=8, rate_hz=60)
        far = np.linalg.norm(recording.poses.position_mm, axis=2)
        assert far.min() > 60
        assert far.max() < 650
        off = np.linalg.norm(recording.poses.position_mm - recording.true_pose.position_mm, axis=2)
        assert 0.1 < off.mean() < 5


def test_a_stiff_joint_hardly_moves() -> None:
    person = draw_person(2)
    usual, stiff = (
        np.ptp(
            record(person, "right", "calibration", seed=1, rate_hz=60, stiff=words).true_angles_deg[
                "index_dip"
            ]
        )
        for words in ((), ("index_dip",))
    )
    assert usual > 35
    assert stiff < 5


def drift_mm(one: Recording, other: Recording, segment: str) -> Array:
    """(T, 3): how a receiver rides differently, in its own axes."""
    at = one.poses.index(segment)
    apart = other.true_pose.position_mm[:, at] - one.true_pose.position_mm[:, at]
    return np.asarray(turning(one.true_pose, segment).inv().apply(apart))


def test_a_receiver_slides_evenly_along_its_bone() -> None:
    person = draw_person(4)
    usual = record(person, "right", "calibration", seed=1, rate_hz=60, duration_s=20)
    slid = record(
        person,
        "right",
        "calibration",
        seed=1,
        rate_hz=60,
        duration_s=20,
        slide=("ring_middle", 8.0, 5.0, 15.0),
    )
    drift = drift_mm(usual, slid, "ring_middle")
    assert np.allclose(drift[:300], 0)
    assert np.linalg.norm(drift[600]) == pytest.approx(4, abs=0.1)
    assert np.linalg.norm(drift[-1]) == pytest.approx(8)
    assert drift[-1, 0] > 7.5
    assert np.allclose(drift_mm(usual, slid, "ring_distal"), 0)


def test_a_loose_receiver_steps_once() -> None:
    person = draw_person(4)
    usual, loose = (
        record(person, "left", "calibration", seed=1, rate_hz=60, duration_s=20, loose=step)
        for step in (None, ("index_proximal", 10.0, 3.0, 12.0))
    )
    drift = np.linalg.norm(drift_mm(usual, loose, "index_proximal"), axis=1)
    assert np.allclose(drift[:600], 0)
    assert np.allclose(drift[600:], 3)
    turned = turning(usual.true_pose, "index_proximal").inv() * turning(loose.true_pose, "index_proximal")
    assert np.rad2deg(turned[-1].magnitude()) == pytest.approx(12, abs=1e-3)


def test_steel_bends_all_poses_at_one_place_alike_and_leaves_the_hand_as_it_is() -> None:
    person = draw_person(5)
    usual, beside = (
        record(person, "right", "grip", seed=3, rate_hz=60, duration_s=15, metal_mm=metal_mm)
        for metal_mm in (None, 15.0)
    )
    assert np.array_equal(usual.true_pose.position_mm, beside.true_pose.position_mm)
    off = beside.poses.position_mm - usual.poses.position_mm
    size = np.linalg.norm(off, axis=2)
    assert size.max() == pytest.approx(15, abs=0.01)
    assert size.min() < 5
    place = usual.true_pose.position_mm.reshape(-1, 3)
    rng = np.random.default_rng(0)
    for row in rng.integers(0, len(place), 50):
        near = np.linalg.norm(place - place[row], axis=1) < 3
        assert np.ptp(off.reshape(-1, 3)[near], axis=0).max() < 2.5


def test_lost_frames_have_no_numbers() -> None:
    recording = record(draw_person(5), "right", "piano", seed=3, rate_hz=60, duration_s=6, dropouts=True)
    assert 0 < (~recording.poses.valid).mean() < 0.2
    assert np.array_equal(np.isnan(recording.poses.position_mm).any(axis=2), ~recording.poses.valid)


def test_pads_meet_in_opposition() -> None:
    recording = record(draw_person(7), "right", "opposition", seed=3, rate_hz=60, duration_s=16)
    for finger in ("index", "middle", "ring", "little"):
        apart = recording.true_tip_mm["thumb"] - recording.true_tip_mm[finger]
        assert np.linalg.norm(apart, axis=1).min() < 25  # from tip to tip, where pads touch
