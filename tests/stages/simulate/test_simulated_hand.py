"""Anatomy and motion of the simulated hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anatomy.drawn_hands import (
    ANATOMIES,
    BLEND,
    CT,
    MIXED,
    MIXED_TABLE,
    SOFT_TIP_MM,
    SOFT_TIP_SD_MM,
    SOURCES,
)
from skeleton import rotations
from stages.simulate.forward import poses_in_hand
from stages.simulate.mounts import habit_share, mounts_of
from stages.simulate.random_hand import (
    BONES,
    DIGITS,
    FINGERS,
    FLEXION,
    JOINTS,
    PARENT,
    TIP_BONES,
    Hand,
    hand_of,
)
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate


def flexion_deg(simulated: Simulated, joint: str) -> np.ndarray:
    return np.degrees(simulated.truth.angles_rad[:, JOINTS.index(joint), FLEXION])


def pad_distances_mm(simulated: Simulated) -> np.ndarray:
    """Distance (T, 4) of the thumb's pad to each finger's."""
    truth = simulated.truth
    quaternion = truth.bone_quaternion[:, TIP_BONES]
    pads = truth.bone_position_mm[:, TIP_BONES] + rotations.rotate(quaternion, truth.hand.pad_mm)
    return np.linalg.norm(pads[:, 1:] - pads[:, :1], axis=-1)


@pytest.mark.parametrize("anatomy", ANATOMIES)
def test_people_differ_from_the_hand_that_they_are_drawn_around(anatomy: str) -> None:
    """Bones of fifty people: about as long as those of their source, or within those of all sources."""
    realism = Realism(anatomy=anatomy)
    lengths = np.array([hand_of(f"{i:02d}", "right", 3, realism).length_mm for i in range(50)])
    hands = {BLEND: SOURCES.values(), MIXED_TABLE: [MIXED]}.get(anatomy) or [SOURCES[anatomy]]
    for digit in DIGITS:
        bones = [b for b, bone in enumerate(BONES) if bone.startswith(f"{digit}_")]
        means = np.array([hand[digit].lengths_mm for hand in hands])
        off = lengths[:, bones].mean(0)
        assert (off > 0.96 * means.min(0)).all()
        assert (off < 1.04 * means.max(0)).all()
        spread = lengths[:, bones].std(0) / off
        assert spread.min() > 0.05
        assert spread.max() < 0.14


def test_everybody_is_a_blend_of_ones_own() -> None:
    """Shapes differ: the same seed's people are no scaled copies of each other."""
    ratios = [
        hand.length_mm[BONES.index("index_metacarpal")] / hand.length_mm[BONES.index("index_distal")]
        for hand in (hand_of(f"{i:02d}", "right", 3, Realism()) for i in range(30))
    ]
    assert np.std(ratios) > 0.15


def test_centres_lie_equally_deep_in_all_digits() -> None:
    """Of what a source's people differ by in their metacarpals, some is common to all digits."""
    realism = Realism(anatomy="ct")
    metacarpals = [BONES.index(f"{digit}_metacarpal") for digit in DIGITS]
    hands = [hand_of(f"{i:03d}", "right", 3, realism) for i in range(300)]
    mean = np.array([CT[digit].lengths_mm[0] for digit in DIGITS])
    off = np.array([hand.length_mm[metacarpals] / hand.scale - mean for hand in hands])
    covariance = np.cov(off.T)
    common = covariance[~np.eye(len(DIGITS), dtype=bool)].mean()
    assert common == pytest.approx(0.95, abs=0.35)  # mm^2: sd 1 mm, none beyond 2.2


def test_soft_tips_are_drawn_for_each_digit() -> None:
    tips = np.array([hand_of(f"{i:03d}", "left", 3, Realism()).soft_tip_mm for i in range(200)])
    np.testing.assert_allclose(tips.mean(0), list(SOFT_TIP_MM.values()), atol=0.2)
    assert (tips.std(0) > SOFT_TIP_SD_MM * 0.85).all()
    assert abs(np.corrcoef(tips.T)[1, 2]) < 0.4


def test_receivers_sit_as_far_off_as_in_trials() -> None:
    """Sd along, across and in height of those over proximal phalanges."""
    segments = tuple(f"{digit}_proximal" for digit in FINGERS)
    off, turn = [], []
    for i in range(300):
        hand = hand_of(f"{i:03d}", "right", 3, Realism())
        worn, exact = (
            mounts_of(f"{i:03d}", "right", 3, hand, segments, Realism(mounts=scale)) for scale in (1.0, 0.0)
        )
        off.append(worn.position_mm - exact.position_mm)
        turn.append(np.degrees(rotations.angle(worn.quaternion)))
        share = worn.position_mm[:, 0] / [hand.length_mm[BONES.index(segment)] for segment in segments]
        assert (np.abs(share - 0.5) <= 0.25 + 1e-12).all()
    spread = np.std(off, axis=(0, 1))
    np.testing.assert_allclose(spread, [3.2, 1.6, 1.3], rtol=0.12)
    assert 3 < np.median(turn) < 6


def test_some_people_have_no_habit() -> None:
    """A quarter; of the others, receivers put on anew and anew go together as much as the share says."""
    shares = np.array([habit_share(f"{i:03d}", 3) for i in range(400)])
    assert (shares == 0.0).mean() == pytest.approx(0.25, abs=0.06)
    assert 0.55 < shares.max() <= 0.6
    none, much = f"{np.flatnonzero(shares == 0.0)[0]:03d}", f"{shares.argmax():03d}"
    for subject, share in ((none, 0.0), (much, shares.max())):
        hand, segments = hand_of(subject, "right", 3, Realism()), ("index_proximal", "little_proximal")
        worn = [mounts_of(subject, "right", 3, hand, segments, Realism(), session=f"{n}") for n in range(400)]
        sideways = np.array([mounts.position_mm[:, 1] for mounts in worn])
        rolled = np.array([mounts.quaternion[:, 1] for mounts in worn])
        for off in (sideways, rolled):
            assert np.corrcoef(off.T)[0, 1] == pytest.approx(share, abs=0.15)


def test_nails_scatter_sideways_as_much_as_other_mounts() -> None:
    segments = ("middle_middle", "middle_distal", "ring_middle", "ring_distal")
    people = [f"{i:03d}" for i in range(400)]
    worn = [
        mounts_of(person, "left", 3, hand_of(person, "left", 3, Realism()), segments, Realism())
        for person in people
    ]
    sideways = np.array([mounts.position_mm[:, 1] for mounts in worn]).std(0)
    np.testing.assert_allclose(sideways, 1.55, rtol=0.1)


@pytest.mark.parametrize("side", ["right", "left"])
def test_receivers_on_nails_slope_and_sit_far_out(side: str) -> None:
    hands = [hand_of(f"{i:02d}", side, 3, Realism()) for i in range(50)]
    for i, hand in enumerate(hands):
        worn = mounts_of(f"{i:02d}", side, 3, hand, ("ring_distal",), Realism())
        share = worn.position_mm[0, 0] / hand.length_mm[BONES.index("ring_distal")]
        assert 0.6 - 1e-9 <= share <= 0.85 + 1e-9
        assert rotations.rotate(worn.quaternion[0], np.array([1.0, 0.0, 0.0]))[2] < 0.05


def test_sides_differ_by_less_than_half_a_percent() -> None:
    for subject in ("01", "02", "03"):
        right, left = (hand_of(subject, side, 3, Realism.full()) for side in ("right", "left"))
        ratio = right.length_mm[2:] / left.length_mm[2:]
        assert np.abs(ratio - 1).max() < 0.005
        assert np.abs(ratio - 1).max() > 0


def test_left_hand_is_the_mirror_image_of_the_right() -> None:
    angles = 0.3 * np.random.default_rng(0).standard_normal((20, len(JOINTS), 3))
    right, left = (hand_of("01", side, 3, Realism.full()) for side in ("right", "left"))
    right_mm, right_turn = poses_in_hand(right, angles)
    left_mm, left_turn = poses_in_hand(left, angles)
    mirror = np.array([1.0, -1.0, 1.0])
    assert np.abs(left_mm - right_mm * mirror).max() < 1.0  # 0.5 % of the hand
    mirrored = np.diag(mirror) @ rotations.matrix(right_turn) @ np.diag(mirror)
    np.testing.assert_allclose(rotations.matrix(left_turn), mirrored, atol=1e-12)


def test_thumb_is_on_the_radial_side_and_flexion_bends_towards_the_palm() -> None:
    hand: Hand = hand_of("01", "right", 3, Realism.full())
    angles = np.zeros((2, len(JOINTS), 3))
    angles[1, :, FLEXION] = 0.4
    angles[1, [JOINTS.index(f"{d}_cmc") for d in FINGERS]] = 0.0
    position, _ = poses_in_hand(hand, angles)
    thumb, *fingers = TIP_BONES
    assert position[0, thumb, 1] > 40
    assert (position[1, fingers, 2] < position[0, fingers, 2] - 10).all()


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("subject", ["01", "02", "03"])
def test_thumb_meets_each_finger_in_turn(subject: str, side: str) -> None:
    apart_mm = pad_distances_mm(simulate(subject, side, "opposition", 20090601, Realism.full(), 960))
    assert apart_mm.min(0).max() < 10
    assert (apart_mm.max(0) > 30).all()
    assert (np.diff(apart_mm.argmin(0)) > 0).all()


@pytest.mark.parametrize("side", ["right", "left"])
def test_opposition_hardly_moves_the_dip_joints(side: str) -> None:
    simulated = simulate("01", side, "opposition", 5, Realism.full())
    dip = {digit: np.ptp(flexion_deg(simulated, f"{digit}_dip")) for digit in FINGERS}
    assert all(1.0 < range_deg < 12.0 for range_deg in dip.values())
    assert all(20 < np.ptp(flexion_deg(simulated, f"{digit}_pip")) < 60 for digit in FINGERS)
    if side == "left":
        assert max(dip["ring"], dip["little"]) < 4


def test_range_of_motion_moves_every_joint() -> None:
    simulated = simulate("01", "right", "rom", 5, Realism.full())
    assert len(simulated.frame) == 7200
    for digit in FINGERS:
        for kind in ("mcp", "pip", "dip"):
            assert 45 < np.ptp(flexion_deg(simulated, f"{digit}_{kind}")) < 105
    for joint in ("wrist", "thumb_cmc", "thumb_mcp", "thumb_ip"):
        assert np.ptp(flexion_deg(simulated, joint)) > 30
    assert np.ptp(flexion_deg(simulated, "little_cmc")) > 10


def test_hand_points_away_from_the_transmitters_x_axis() -> None:
    for subject in ("01", "02", "03", "04"):
        truth = simulate(subject, "right", "opposition", 5, Realism.full(), 1000).truth
        distal = rotations.rotate(truth.bone_quaternion[:, BONES.index("hand")], np.array([1.0, 0.0, 0.0]))
        assert 100 < np.degrees(np.arccos(distal[:, 0])).mean() < 125


def test_exact_fingers_stay_clear_of_the_twists_singularity() -> None:
    for task in ("opposition", "rom"):
        truth = simulate("01", "left", task, 5, Realism.exact()).truth
        wrist = truth.bone_position_mm[:, BONES.index("hand")]
        for digit in DIGITS[1:]:
            bone = BONES.index(f"{digit}_proximal")
            along = rotations.unit(truth.bone_position_mm[:, bone] - wrist)
            distal = rotations.rotate(truth.bone_quaternion[:, bone], np.array([1.0, 0.0, 0.0]))
            assert np.degrees(np.arccos((along * distal).sum(-1))).max() < 85


def test_axes_are_tilted_in_bones_that_face_as_their_sources_do() -> None:
    """By some degrees in both directions across them, unless everything is as the paper assumes."""
    tilts = []
    for i in range(60):
        hand = hand_of(f"{i:02d}", "right", 3, Realism(anatomy="ct"))
        pips = [JOINTS.index(f"{digit}_pip") for digit in FINGERS]
        tilts.append(rotations.rotate(rotations.conjugate(hand.rest[pips]), hand.axes[pips, FLEXION]))
    along_and_up = np.degrees(np.array(tilts)[..., [0, 2]])
    assert (np.abs(along_and_up.mean(0)[:, 0] - [-5.0, -2.1, 3.0, 4.4]) < 2.5).all()
    assert (np.abs(along_and_up.mean(0)[:, 1]) < 2.5).all()
    np.testing.assert_allclose(along_and_up.std((0, 1)), 5.0, atol=1.5)
    exact = hand_of("01", "right", 3, Realism.exact())
    facing = rotations.rotate(rotations.conjugate(exact.rest), exact.axes[:, FLEXION])
    assert np.abs(facing[[JOINTS.index(f"{digit}_mcp") for digit in DIGITS], 2]).max() < 1e-9


def relative_poses(hand: Hand, joint: int, flexion_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (T, 3, 3) and origins (T, 3) of a joint's child in its parent, with nothing else moving."""
    angles = np.zeros((len(flexion_rad), len(JOINTS), 3))
    angles[:, joint, FLEXION] = flexion_rad
    place, quaternion = poses_in_hand(hand, angles)
    turn, parent, child = rotations.matrix(quaternion), PARENT[joint], joint + 1
    back = np.swapaxes(turn[:, parent], -1, -2)
    return back @ turn[:, child], np.einsum("tab,tb->ta", back, place[:, child] - place[:, parent])


def still_point_mm(hand: Hand, joint: int, flexion_rad: float) -> np.ndarray:
    """Where the child does not move across the axis, in the parent's frame, as it bends a little there.

    The point nearest the child's origin on the axis of the small motion between two postures.
    """
    turn, place = relative_poses(hand, joint, flexion_rad + np.array([-1e-4, 1e-4, 0.0]))
    small = turn[1] @ turn[0].T
    axis = rotations.unit(
        np.array([small[2, 1] - small[1, 2], small[0, 2] - small[2, 0], small[1, 0] - small[0, 1]])
    )
    shift = place[1] - small @ place[0]
    from_origin = np.linalg.lstsq(np.eye(3) - small, shift - (shift @ axis) * axis, rcond=1e-7)[0] - place[2]
    return np.asarray(place[2] + from_origin - (from_origin @ axis) * axis)


def with_axes_that_meet(subject: str, side: str) -> Hand:
    """A hand whose thumb's CMC turns about one point, too, but for its glide."""
    return replace(hand_of(subject, side, 3, Realism()), skew_mm=np.zeros((len(JOINTS), 3)))


@pytest.mark.parametrize(
    ("kinds", "over_deg", "least_mm", "most_mm"),
    [
        (("mcp",), 45.0, 0.5, 2.0),
        (("pip",), 90.0, 0.06, 0.73),
        (("dip", "ip"), 60.0, 0.05, 0.5),
        (("thumb_cmc",), 45.0, 0.1, 0.5),
    ],
)
def test_what_joints_turn_about_goes_as_far_as_published(
    kinds: tuple[str, ...], over_deg: float, least_mm: float, most_mm: float
) -> None:
    """And in the relaxed posture it is the joint's centre, the origin of the child's frame."""
    ways_mm = []
    for i in range(20):
        hand = with_axes_that_meet(f"{i:02d}", ("right", "left")[i % 2])
        for joint, name in enumerate(JOINTS):
            if name in kinds or name.partition("_")[2] in kinds:
                start = float(hand.relaxed_rad[joint])
                ends = [still_point_mm(hand, joint, start + way * np.radians(over_deg)) for way in (0, 1)]
                np.testing.assert_allclose(ends[0], hand.origin_mm[joint], atol=2e-3)
                ways_mm.append(np.linalg.norm(ends[1] - ends[0]))
    assert least_mm - 2e-3 < min(ways_mm)
    assert max(ways_mm) < most_mm + 2e-3
    assert max(ways_mm) > 2 * min(ways_mm)


def test_relaxed_hands_are_bent_as_hands_at_rest_are() -> None:
    """Each person's own, of both hands alike."""
    relaxed = np.degrees([hand_of(f"{i:03d}", "right", 3, Realism()).relaxed_rad for i in range(200)])
    for kind, least, most in (("mcp", 15, 45), ("pip", 20, 50), ("dip", 5, 25)):
        own = relaxed[:, [JOINTS.index(f"{digit}_{kind}") for digit in FINGERS]]
        assert least <= own.min() < least + 3
        assert most - 3 < own.max() <= most
    thumb = relaxed[:, [JOINTS.index(f"thumb_{kind}") for kind in ("cmc", "mcp", "ip")]]
    assert 10 <= thumb.min() < 12
    assert 28 < thumb.max() <= 30
    other = hand_of("000", "left", 3, Realism())
    np.testing.assert_allclose(np.degrees(other.relaxed_rad), relaxed[0])
