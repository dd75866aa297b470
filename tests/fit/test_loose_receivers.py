"""Detection of receivers that came loose or slid, of metal near the hand, and no false alarms from skin."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_poses import recorded

from shukotsu.fit.displacement_test import courses, most_within
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand
from shukotsu.fit.left_out import is_elsewhere, without_displaced
from shukotsu.fit.loose_receivers import Displaced, LooseReceiver, displaced_in
from shukotsu.hand.rotations import Array, about_axis, multiply, rotate, unit
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.study.layout import Layout
from shukotsu.tables.poses import Poses, RecordingName

QUICK = FitSettings(n_frames=60, rounds=1)


def hand(side: str = "right", task: str = "rom", seed: int = 5) -> tuple[Simulated, Poses]:
    return recorded(side, task, seed=seed, n_frames=3600)


def loosened(
    poses: Poses, segment: str, at: int, shift_mm: float, turn_deg: float, seed: int = 0, slide: int = 1
) -> Poses:
    """Return the poses with one receiver shifted and turned in its own frame, along and about random axes.

    at : the first displaced row; slide : number of rows over which the displacement grows to its full size.
    """
    rng = np.random.default_rng(seed)
    index = poses.index(segment)
    share = np.clip((np.arange(len(poses.frame)) - at + 1) / slide, 0.0, 1.0)
    position, quaternion = poses.position_mm.copy(), poses.quaternion.copy()
    along, about = unit(rng.normal(size=3)), unit(rng.normal(size=3))
    position[:, index] += rotate(quaternion[:, index], share[:, None] * shift_mm * along)
    turn = about_axis(np.broadcast_to(about, (len(share), 3)), share * np.radians(turn_deg))
    quaternion[:, index] = multiply(quaternion[:, index], turn)
    return replace(poses, position_mm=position, quaternion=quaternion)


def loose_in(layout: Layout, side: str, *recordings: Poses) -> list[LooseReceiver]:
    displaced = displaced_in(fit_hand(recordings, layout, side, settings=QUICK), recordings)
    assert displaced.field is None
    return [*displaced.loose]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("segment", "shift_mm", "turn_deg"),
    [
        ("hand", 4.0, 0.0),
        pytest.param("ring_proximal", 30.0, 40.0, marks=pytest.mark.slow),  # it dangles from its cable
    ],
)
def test_a_loose_receiver_is_found(layout: Layout, segment: str, shift_mm: float, turn_deg: float) -> None:
    poses = hand()[1]
    (loose,) = loose_in(layout, "right", loosened(poses, segment, 1500, shift_mm, turn_deg))
    assert (loose.segment, loose.start.recording, loose.slid) == (segment, 0, False)
    assert loose.start.frame == pytest.approx(poses.frame[1500], abs=24)
    assert loose.start.time_s == poses.time_s[loose.start.frame - poses.frame[0]]
    assert loose.shift_mm == pytest.approx(shift_mm, rel=0.1, abs=1.2)
    assert loose.turn_deg == pytest.approx(turn_deg, rel=0.1, abs=2.0)


@pytest.mark.slow
def test_a_slow_slide_is_detected_with_its_start_and_end(layout: Layout) -> None:
    """A receiver creeps 8 mm over half of the recording; its speed is found to 35 %."""
    poses = hand()[1]
    (loose,) = loose_in(layout, "right", loosened(poses, "index_proximal", 900, 8.0, 0.0, slide=1800))
    assert (loose.segment, loose.slid) == ("index_proximal", True)
    assert loose.start.frame == pytest.approx(poses.frame[900], abs=600)
    assert loose.end.frame == pytest.approx(poses.frame[2700], abs=600)
    slope = loose.shift_mm / (loose.end.frame - loose.start.frame)
    assert slope == pytest.approx(8.0 / 1800, rel=0.35)


def beside_metal(poses: Poses, mm: float) -> tuple[Poses, Array]:
    """Return poses of a hand that moves towards steel and back, and the steel's position (3,) in mm.

    mm : error of the nearest receivers, in mm and as a turn in deg.
    """
    row, way = np.arange(len(poses.frame)), np.array([0.8, -0.6, 0.0])
    gone = np.interp(row / len(row), [0.2, 0.35, 0.55, 0.7], [0.0, 1.0, 1.0, 0.0])
    there = poses.position_mm + 150.0 * gone[:, None, None] * way
    steel = there[len(row) // 2].mean(0) + 170.0 * way
    away = there - steel
    distance = np.linalg.norm(away, axis=-1, keepdims=True)
    size = mm * np.minimum((90.0 / distance) ** 3, 2.0)
    turn = np.radians(size) * np.cross(away / distance, [0.3, -0.5, 0.8])
    turned = multiply(about_axis(unit(turn), np.linalg.norm(turn, axis=-1)), poses.quaternion)
    return replace(poses, position_mm=there + away / distance * size, quaternion=turned), steel


@pytest.mark.slow
def test_metal_is_located_and_no_receiver_called_loose(layout: Layout) -> None:
    poses, steel = beside_metal(hand()[1], 10.0)
    displaced = displaced_in(fit_hand([poses], layout, "right", settings=QUICK), [poses])
    assert displaced.field is not None
    assert not displaced.loose
    assert np.linalg.norm(displaced.field.nearest - steel) < 150.0
    assert 5.0 < np.linalg.norm(displaced.field.error[:3]) < 25.0


def error_mm(fit: HandFit, drawn: Simulated) -> float:
    """Return the larger error of the PIP and DIP centres in the frame of the middle finger's middle
    receiver.
    """
    pip, dip = ((fit.joints[name], drawn.truth.joints[name]) for name in ("middle_pip", "middle_dip"))
    off_mm = pip[0].child_mm - pip[1].child_mm, dip[0].parent_mm - dip[1].parent_mm
    return float(np.linalg.norm(off_mm, axis=-1).max())


@pytest.mark.slow
def test_leaving_out_displaced_frames_restores_the_hand(layout: Layout) -> None:
    drawn, poses = hand()
    loose = loosened(poses, "middle_middle", 2000, 8.0, 12.0)
    untouched, spoilt = (fit_hand([p], layout, "right", settings=QUICK) for p in (poses, loose))
    kept = without_displaced(spoilt, [loose], displaced_in(spoilt, [loose]))
    mended = fit_hand(kept, layout, "right", settings=QUICK)
    assert is_elsewhere(spoilt, mended)
    assert not is_elsewhere(untouched, untouched)
    best, worst, after = (error_mm(fit, drawn) for fit in (untouched, spoilt, mended))
    assert after < best + 0.8
    assert worst > after + 0.5


@pytest.mark.slow
def test_a_displacement_of_any_receiver_is_detected(layout: Layout) -> None:
    """Of displacements of all 16 receivers by 5 mm or 14 deg, in either task, at most one is missed. The
    thumb metacarpal's receiver is displaced by twice as much, as skin alone moves it as far as the others.
    """
    missed = []
    tasks = (("right", "rom"), ("left", "opposition"))
    for number, segment in enumerate(hand(*tasks[0], 6)[1].segments):
        side, task = tasks[number % 2]
        at = int(np.random.default_rng(number).uniform(600, 3000))
        times = 2 if segment == "thumb_metacarpal" else 1
        shift_mm, turn_deg = ((times * 5.0, 0.0), (0.0, times * 14.0))[number // 2 % 2]
        loose = loosened(hand(side, task, 6)[1], segment, at, shift_mm, turn_deg, number)
        if [receiver.segment for receiver in loose_in(layout, side, loose)] != [segment]:
            missed.append(segment)
    assert len(missed) <= 1, missed


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 12))
def test_an_undisturbed_hand_has_no_loose_receiver(layout: Layout, seed: int) -> None:
    """Both tasks, with the usual skin motion and twice as much."""
    side = ("right", "left")[seed % 2]
    for task in ("rom", "opposition"):
        for skin in (1.0, 2.0):
            poses = simulate(RecordingName("01", side, task), seed, replace(Realism(), artefact=skin))
            fit = fit_hand([poses], layout, side)
            assert displaced_in(fit, [poses]) == Displaced([]), (task, skin)


@pytest.mark.slow
def test_a_hand_that_moves_away_and_back_has_no_loose_receiver(layout: Layout) -> None:
    """For 30 frames one receiver's position is that of the transmitter's opposite hemisphere."""
    clean = beside_metal(hand()[1], 0.0)[0]
    flipped = clean.position_mm.copy()
    flipped[1500:1530, 4] *= -1.0
    assert not loose_in(layout, "right", replace(clean, position_mm=flipped))


def test_courses_include_steps_slides_and_returns() -> None:
    """Steps leave blocks on both sides, slides last at least a fifth of the recording, returns end at
    zero.
    """
    ways = courses(40)
    steps = (ways.start == ways.end) & ~ways.returns
    slides = (ways.start < ways.end) & ~ways.returns
    assert [*ways.start[steps]] == [*range(2, 39)]
    assert set(np.unique(ways.share[steps])) == {0.0, 1.0}
    assert (ways.end - ways.start)[slides].min() == 8
    assert (np.diff(ways.share[slides], axis=1) >= 0.0).all()
    assert (ways.share[ways.returns][:, [0, -1]] == 0.0).all()
    assert not len(courses(2).start)


def test_the_gain_is_limited_to_displacements_of_normal_size() -> None:
    """The best displacement's gain counts in full inside the ellipsoid of normal ones; outside, that at its
    edge.
    """
    curvature, radii = np.diag([4.0, 1.0, 1.0, 1.0, 1.0, 1.0])[None], np.full((1, 6), 1.0)
    for step, gain in ((0.5, 0.5), (3.0, 12.0 - 2.0)):
        slope = -4.0 * np.array([[step, 0.0, 0.0, 0.0, 0.0, 0.0]])
        np.testing.assert_allclose(most_within(radii, slope, curvature), gain, rtol=1e-6)
