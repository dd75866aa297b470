"""Sudden changes within a recording: which receivers, and when."""

import numpy as np
import pytest
from simulated_poses import hand_of, recorded

from shukotsu.readers.breaks import Break, breaks
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import Poses

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
