"""Jumps of single receivers to the opposite hemisphere, and sudden changes within a recording: which
receivers, and when.
"""

import numpy as np
import pytest
from simulated_poses import hand_of, recorded

from shukotsu.readers.jumps import Break, OwnSides, breaks, own_sides
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import Poses


def swinging(rate_hz: float, seconds: float = 10.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    frame = np.arange(int(seconds * rate_hz))
    phase = 2 * np.pi * 0.8 * frame / rate_hz
    position_mm = np.stack([300 + 50 * np.sin(phase), 80 * np.cos(phase), 30 * np.sin(2 * phase)], -1)
    return frame, frame / rate_hz, position_mm


def signs(detected: OwnSides, frame: np.ndarray) -> np.ndarray:
    sign = detected.sign[detected.piece_at(frame)]
    return np.asarray(sign * sign[0])


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("rate_hz", [40, 60, 240, 500])
def test_hemisphere_jumps_are_located_to_the_frame(rate_hz: int, timed: bool) -> None:
    frame, time_s, position_mm = swinging(rate_hz)
    true = np.where((time_s > 2) & (time_s < 5.5), -1, 1)
    detected = own_sides(frame, time_s if timed else np.full(len(frame), np.nan), position_mm * true[:, None])
    assert detected.changes
    assert len(np.unique(detected.run)) == 1
    assert (signs(detected, frame) == true).all()


@pytest.mark.parametrize("smear", [0.3, 0.6, 0.8])
def test_filtered_samples_during_a_jump_are_on_neither_side(smear: float) -> None:
    frame, time_s, position_mm = swinging(240)
    true = np.where((time_s > 2) & (time_s < 5.5), -1, 1)
    seen, lagging = position_mm * true[:, None], position_mm.copy()
    for row in range(1, len(frame)):
        seen[row] = smear * seen[row - 1] + (1 - smear) * seen[row]
        lagging[row] = smear * lagging[row - 1] + (1 - smear) * lagging[row]
    sign = signs(own_sides(frame, time_s, seen), frame)
    sided = sign != 0
    assert np.abs(seen - lagging * sign[:, None])[sided].max() < 30.0
    assert 0 < (~sided).sum() <= 60


def test_moving_past_the_transmitter_is_not_a_jump() -> None:
    frame = np.arange(240)
    position_mm = np.stack([np.linspace(-400, 400, 240), np.full(240, 60.0), np.zeros(240)], -1)
    detected = own_sides(frame, frame / 240, position_mm)
    assert not detected.changes
    assert len(detected.first) == 1


LAYOUT = read_layout("liberty16")
SINCE = 400


def breaks_of(poses: Poses, position_mm: np.ndarray, quaternion: np.ndarray) -> list[Break]:
    numbers = np.concatenate([position_mm, quaternion], -1)
    links = [(joint.parent_receiver, joint.child) for joint in LAYOUT.solvable]
    names = list(poses.segments)
    worn = [link for link in links if {*link} <= {*names}]
    return breaks(names, lambda name: (poses.frame, numbers[:, names.index(name)]), worn)


def fallen(poses: Poses, *segments: str, since: int = SINCE, fall: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and quaternions of receivers that fall for `fall` frames and then hang from their
    cables.
    """
    position_mm, quaternion = poses.position_mm.copy(), poses.quaternion.copy()
    count = len(position_mm) - since
    share = np.clip((np.arange(count) + 1) / fall, 0, 1)[:, None] ** 2
    for column in map(poses.index, segments):
        end_mm = np.array([150.0, -200.0, -80.0]) + np.random.default_rng(column).normal(0, 0.1, (count, 3))
        position_mm[since:, column] = (1 - share) * position_mm[since, column] + share * end_mm
        quaternion[since:, column] = quaternion[since, column]
    return position_mm, quaternion


@pytest.mark.parametrize(
    "segment", ["hand", "thumb_metacarpal", "ring_proximal", "index_middle", "index_distal"]
)
@pytest.mark.parametrize("fall", [1, 60])
def test_a_receiver_that_falls_off_is_detected_with_its_frame(segment: str, fall: int) -> None:
    poses = hand_of(7).poses
    (event,) = breaks_of(poses, *fallen(poses, segment, fall=fall))
    assert (event.segments, event.until) == ((segment,), False)
    assert 0 <= event.frame - poses.frame[SINCE] <= (0 if fall == 1 else fall)


def test_two_receivers_that_fall_off_are_both_detected() -> None:
    poses = hand_of(7).poses
    position_mm, quaternion = fallen(poses, "index_distal", since=300)
    later_mm, later = fallen(poses, "ring_middle", since=600)
    column = poses.index("ring_middle")
    position_mm[:, column], quaternion[:, column] = later_mm[:, column], later[:, column]
    named = [(event.segments, event.frame) for event in breaks_of(poses, position_mm, quaternion)]
    assert named == [(("index_distal",), poses.frame[300]), (("ring_middle",), poses.frame[600])]
    together = breaks_of(poses, *fallen(poses, "index_middle", "index_distal"))
    assert {name for event in together for name in event.segments} == {"index_middle", "index_distal"}


@pytest.mark.parametrize("factor", [0.001, 1 / 25.4, 0.1, 10.0])
def test_a_change_of_unit_is_a_change_of_all_receivers(factor: float) -> None:
    poses = hand_of(7).poses
    position_mm = poses.position_mm.copy()
    position_mm[SINCE:] *= factor
    (event,) = breaks_of(poses, position_mm, poses.quaternion)
    assert (event.segments, event.frame, event.until) == (poses.segments, poses.frame[SINCE], False)
    assert event.grown == pytest.approx(factor, rel=0.1)


def test_small_or_temporary_displacements_are_not_sudden_changes() -> None:
    poses = recorded(seed=7, n_frames=900)[1]
    column = poses.index("index_distal")
    slipped, away = poses.position_mm.copy(), poses.position_mm.copy()
    slipped[SINCE:, column] += 5.0
    away[SINCE : SINCE + 60, column] += 60.0
    for position_mm in (poses.position_mm, slipped, away, -poses.position_mm):
        assert breaks_of(poses, position_mm, poses.quaternion) == []
    assert breaks_of(poses, poses.position_mm, poses.quaternion[..., [1, 2, 3, 0]]) == []
