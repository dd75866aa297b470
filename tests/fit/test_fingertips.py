"""Fingertips of fitted hands, and their correction by touches and pad contacts."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from simulated_poses import recorded

from shukotsu.fit.fingertips import BONE, PAD, TIP, Fingertips, fingertips, seen_parts
from shukotsu.fit.fit import FitSettings, fit_hand
from shukotsu.fit.touches import CONTACT_SD_MM, MOST_EACH, Touch, find_contacts, touch_in, with_touches
from shukotsu.hand.average_hand import DIGITS as AVERAGE
from shukotsu.hand.rotations import Array, rotate
from shukotsu.simulate.random_hand import DIGITS, TIP_BONES
from shukotsu.simulate.simulation import Simulated
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import Poses

QUICK = FitSettings(n_frames=60, rounds=1)
SOFT_MM = np.array([5.0, 4.4, 3.5, 4.6, 3.9])
"""Soft tissue beyond the bones' ends of the person in these tests, within 2 sd of the published means."""


@dataclass(frozen=True)
class Person:
    """A simulated person: fitted fingertips, the recording that they were fitted to, and its poses."""

    tips: Fingertips
    drawn: Simulated
    poses: Poses

    def true_mm(self, rows: slice | Array, part: str) -> Array:
        """Return the true positions (T, 5, 3) of a part of every tip in the transmitter frame."""
        truth = self.drawn.truth
        turn, offset = truth.bone_quaternion[rows][:, TIP_BONES], np.zeros((5, 3))
        if part == TIP:
            offset[:, 0] = SOFT_MM
        elif part == PAD:
            offset = truth.hand.pad_mm - truth.hand.length_mm[TIP_BONES, None] * [1.0, 0.0, 0.0]
        return truth.tip_mm[rows] + rotate(turn, offset)

    def touches(self, seed: int, digits: tuple[str, ...] = DIGITS) -> list[Touch]:
        """Return one touch of each digit's soft tip, in a random frame, with an error of 0.4 mm per axis."""
        rng, touches = np.random.default_rng(seed), []
        for digit in digits:
            row = rng.integers(0, len(self.poses.frame), 1)
            point = self.true_mm(row, TIP)[0, DIGITS.index(digit)] + 0.4 * rng.normal(size=3)
            touches.append(touch_in(self.tips, self.poses, row, (digit,), 0.4, TIP, point))
        return touches

    def off_mm(self, tips: Fingertips, part: str) -> Array:
        """Return each digit's mean distance (5,) between a part and its true position, in mm."""
        rows = slice(None, None, 20)
        points = tips.in_transmitter(self.poses, part)[rows]
        return np.asarray(np.linalg.norm(points - self.true_mm(rows, part), axis=-1).mean(0))


@pytest.fixture(scope="module", params=["right", pytest.param("left", marks=pytest.mark.slow)])
def person(request: pytest.FixtureRequest) -> Person:
    drawn, poses = recorded(
        request.param, seed=6, field_distortion=0.0
    )  # which would move the touched points
    fit = fit_hand([poses], read_layout("liberty16"), request.param, settings=QUICK)
    return Person(fingertips(fit), drawn, poses)


def test_tips_without_touches_are_within_their_covariance(person: Person) -> None:
    """Without touches, bone end, tip and pad are a few mm off, in agreement with their covariance."""
    assert tuple(person.tips.digits) == DIGITS
    for part, most_mm in ((BONE, 5.0), (TIP, 5.5), (PAD, 5.5)):
        off = person.off_mm(person.tips, part)
        assert off.max() < most_mm, part
    lengths = [bone.length_mm for bone in person.tips.fit.bones.values()]
    size = sum(lengths) / sum(sum(anatomy.lengths_mm) for anatomy in AVERAGE.values())
    assert abs(size - 1) > 0.005
    soft = [anatomy.soft_tip_mm for anatomy in AVERAGE.values()]
    np.testing.assert_allclose(person.tips.offsets_mm[:, 0, 0], size * np.array(soft))
    squares = []
    for i, digit in enumerate(DIGITS):
        tip = person.tips[digit]
        receiver = person.poses.index(tip.receiver)
        back = person.poses.quaternion[:, receiver] * [1.0, -1.0, -1.0, -1.0]
        arm = person.true_mm(slice(None), BONE)[:, i] - person.poses.position_mm[:, receiver]
        off_mm = rotate(back, arm).mean(0) - tip.point_mm
        squares.append(off_mm @ np.linalg.solve(tip.covariance_mm2, off_mm))
    assert sum(squares) < 37.7  # chi-square with 15 degrees of freedom, p = 0.001


def test_derivatives_of_the_points_equal_finite_differences(person: Person) -> None:
    tips = person.tips
    fit, rng = tips.fit, np.random.default_rng(0)
    x, offsets = fit.posterior.x, tips.offsets_mm
    along = rng.normal(size=len(x) + offsets.size)
    by_x, by_offset = along[: len(x)], along[len(x) :].reshape(offsets.shape)
    step = 1e-5
    first, second = (
        seen_parts(fit, x + sign * step * by_x, offsets + sign * step * by_offset) for sign in (-1, 1)
    )
    for which, (_, derivative) in seen_parts(fit, x, offsets).items():
        slope = (second[which][0] - first[which][0]) / (2 * step)
        np.testing.assert_allclose(derivative @ along, slope, rtol=1e-6, atol=1e-6)


def test_one_touch_per_digit_locates_the_tips(person: Person) -> None:
    """Soft tips are then as accurate as the touches, bone ends a little less; the joints' sds do not grow,
    and the covariance and mean states stay consistent.
    """
    tips = with_touches(person.tips, person.touches(1))
    assert tips.refused == ()
    assert person.off_mm(tips, TIP).mean() < 0.8 < 1.5 < person.off_mm(person.tips, TIP).mean()
    assert person.off_mm(tips, BONE).mean() < 1.0
    for digit, before in person.tips.digits.items():
        after = tips[digit]
        assert np.sqrt(np.trace(after.soft_tip_covariance_mm2) / 3) < 0.5
        assert np.trace(after.soft_tip_covariance_mm2) < np.trace(after.covariance_mm2)
        assert np.trace(after.covariance_mm2) < 0.5 * np.trace(before.covariance_mm2)
    np.testing.assert_array_equal(tips.fit.posterior.covariance, tips.covariance[:-30, :-30])
    assert np.linalg.eigvalsh(tips.covariance)[0] > 0
    now, before = tips.fit.posterior, person.tips.fit.posterior
    angles = before.states_by_x @ (now.x - before.x)
    np.testing.assert_allclose(now.mean_states - before.mean_states, angles)
    assert np.abs(angles).max() > 0.001
    for name, joint in person.tips.fit.joints.items():
        assert tips.fit.joints[name].sd_mm < joint.sd_mm + 1e-9
    assert tips.fit.joints["index_dip"].sd_mm < 0.9 * person.tips.fit.joints["index_dip"].sd_mm


def test_a_touch_of_the_wrong_digit_is_refused(person: Person) -> None:
    """A touch far from its digit's tip is refused with its reason; the others are used as without it."""
    touches = person.touches(6)
    wrong = replace(touches[2], point_mm=touches[2].point_mm + np.array([0.0, 9.0, 9.0]))
    alone = with_touches(person.tips, [wrong])
    assert alone.fit is person.tips.fit
    assert "touch 1 (middle, middle_distal)" in alone.refused[0]
    among = with_touches(person.tips, [*touches, wrong])
    assert len(among.refused) == 1
    assert "touch 6 (middle" in among.refused[0]
    without = with_touches(person.tips, touches)
    np.testing.assert_allclose(among.offsets_mm, without.offsets_mm, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("person", ["right"], indirect=True)
def test_pad_contacts_are_found_and_improve_the_pads(person: Person) -> None:
    """In the opposition task contacts of every finger are found, in the range-of-motion task hardly any. They
    bring the fitted pads closer together: a contact determines the pads' relative position only.
    """
    drawn, poses = recorded(person.drawn.name.hand, "opposition", seed=6, field_distortion=0.0)
    other = Person(person.tips, drawn, poses)
    contacts = find_contacts(person.tips, poses)
    fingers = [contact.digits[1] for contact in contacts]
    assert {contact.digits[0] for contact in contacts} == {"thumb"}
    assert set(fingers) == set(DIGITS[1:])
    assert max(fingers.count(finger) for finger in fingers) <= MOST_EACH
    thumb = poses.position_mm[:, poses.index("thumb_distal")]
    pads = other.true_mm(slice(None), PAD)
    for contact in contacts:
        row = np.linalg.norm(thumb - contact.receiver_mm[:, 0].mean(0), axis=-1).argmin()
        apart = pads[row, DIGITS.index(contact.digits[1])] - pads[row, 0]
        assert np.linalg.norm(apart) < 8, contact.digits[1]
    touched = with_touches(person.tips, contacts)
    assert touched.refused == ()
    for digit in DIGITS:
        assert np.trace(touched[digit].pad_covariance_mm2) < np.trace(person.tips[digit].pad_covariance_mm2)
    assert gap_mm(touched, contacts) < 0.6 * gap_mm(person.tips, contacts)
    assert len(find_contacts(person.tips, person.poses)) <= 2
    apart = touch_in(person.tips, poses, np.arange(3), ("thumb", "ring"), CONTACT_SD_MM, PAD)
    among = with_touches(person.tips, [apart, *contacts])
    assert len(among.refused) == 1
    assert "contact 1 (thumb and ring)" in among.refused[0]
    np.testing.assert_allclose(among.offsets_mm, touched.offsets_mm, atol=1e-9)


def scripted_poses(tips: Fingertips, pads_mm: Array) -> Poses:
    """Return poses of receivers that never turn, with the pads at given positions (T, 5, 3) in mm."""
    position = pads_mm - np.array([tip.pad_mm for tip in tips.digits.values()])
    time, still = np.arange(len(pads_mm)), np.tile([1.0, 0.0, 0.0, 0.0], (*position.shape[:2], 1))
    receivers = tuple(tip.receiver for tip in tips.digits.values())
    return Poses(receivers, time, time / 240, position, still, np.ones(position.shape[:2], bool))


def test_a_contact_is_the_nearest_pad_held_close(person: Person) -> None:
    """The index pad is held at the thumb twice, the middle finger close by, while the ring finger only
    passes: two contacts, both of the index.
    """
    tips = person.tips
    pads = np.zeros((1000, 5, 3))
    pads[:, :, 0] = [0.0, 60.0, 60.0, 60.0, 60.0]
    first, second, between = slice(100, 200), slice(400, 500), slice(200, 400)
    away = 60 * np.ones(1000)
    for held in (first, second):
        away[held] = np.abs(np.linspace(-60, 60, 100)).clip(12) - 9.0
    pads[:, 1, 0] = away
    pads[:, 2, 0] = away + 3.0
    pads[between, 3, 0] = np.linspace(-80, 80, 200)
    contacts = find_contacts(tips, scripted_poses(tips, pads))
    assert [contact.digits[1] for contact in contacts] == ["index", "index"]
    for contact in contacts:
        apart = np.diff(pads_mm(tips, contact), axis=1)[:, 0]
        np.testing.assert_allclose(apart[:, 0], 3.0, atol=1.0)
        assert contact.sd_mm == pytest.approx(CONTACT_SD_MM * 2**0.5)
        assert 5 <= len(apart) < 30
    assert find_contacts(tips, scripted_poses(tips, pads[:5])) == []


def pads_mm(tips: Fingertips, contact: Touch) -> Array:
    """Return the positions (N, 2, 3) of both pads in the frames of a contact, transmitter frame."""
    arms_mm = np.array([tips[digit].pad_mm for digit in contact.digits])
    return contact.receiver_mm + rotate(contact.receiver_quaternion, arms_mm)


def gap_mm(tips: Fingertips, contacts: list[Touch]) -> float:
    """Return the mean distance of the pads in contacts."""
    gaps = [np.subtract(*pads_mm(tips, contact).mean(0)) for contact in contacts]
    return float(np.linalg.norm(gaps, axis=-1).mean())
