"""The coach's requests, findings and summaries for simulated hands, and live poses of an archive."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from recording_files import LIBERTY, WHO
from simulated_poses import recorded

from benchmarks.faultless_hands import exchange_receivers
from shukotsu.__main__ import main as capture
from shukotsu.coach.coach import ENDED, ENOUGH, FIRST, MOST_VAIN, MOVEMENTS, Coach, Estimate
from shukotsu.coach.live_poses import MOST_FRAMES, EvenFrames, LivePoses
from shukotsu.coach.study import hand_alone
from shukotsu.simulate.random_hand import FINGERS
from shukotsu.study.verdict import BELIEVE, CARE
from shukotsu.tables.poses import Poses, joined_poses, read_poses
from shukotsu.tracker.archive import open_archive

pytestmark = pytest.mark.slow

SWAPPED = ("index_middle", "middle_middle")
RATE_HZ = 240


def calibration(frames: int = 7 * RATE_HZ) -> Poses:
    """Return poses of a hand moving through the range of its joints."""
    return recorded(seed=7001, n_frames=frames)[1]


def a_coach(wanted_mm: float = 2.0) -> Coach:
    hand = hand_alone(None, "right")
    return Coach(replace(hand, layout=replace(hand.layout, wanted_mm=wanted_mm)))


def coached(coach: Coach, poses: Poses) -> list[str]:
    blocks = (poses.take(slice(start, start + 60)) for start in range(0, len(poses.frame), 60))
    return [line for block in blocks for line in coach.take(block)]


def from_frame(poses: Poses, frame: int) -> Poses:
    number = poses.frame - poses.frame[0] + frame
    return replace(poses, frame=number, time_s=number / RATE_HZ)


def test_it_asks_for_a_movement_checks_it_and_lists_every_joint() -> None:
    coach = a_coach()
    lines = [*coached(coach, calibration(5 * RATE_HZ)), *coach.end()]
    assert f">> {MOVEMENTS[FIRST].sentence}" in lines[0]
    assert "Nothing is wrong in these 4 s" in lines[1]
    assert "joints good enough; the least certain is thumb_cmc" in lines[2]
    assert coach.phase == ENDED
    joints = [line for line in lines if line[:1] != " "]
    assert len(joints) == 15
    assert any(line.startswith("index_pip") and "believe" in line for line in joints)
    assert any(line.startswith("thumb_cmc") and "care     the error exceeds" in line for line in joints)
    assert any(f"What would help: {coach.gains()[0]}" in line for line in lines)


def test_it_stops_when_every_joint_is_good_enough() -> None:
    coach = a_coach(wanted_mm=8.0)
    lines = coach.take(calibration(), may_leave_out=True)
    assert coach.phase == ENOUGH
    assert sum("Enough: 15 of 15 joints good enough" in line for line in lines) == 1
    assert coach.calibration.estimate is not None
    assert coach.calibration.estimate.time_s > 5.9


def test_swapped_receivers_are_named_and_their_correction_restarts_it() -> None:
    poses = calibration(5 * RATE_HZ)
    coach = a_coach()
    lines = coached(coach, exchange_receivers(poses, SWAPPED))
    assert len(lines) == 2
    assert all(name in lines[1] for name in (*SWAPPED, "swapped"))
    assert coach.calibration.request is None
    assert coach.calibration.estimate is None
    lines = coached(coach, joined_poses([from_frame(poses, 1200), from_frame(poses, 2400)]))
    assert coach.restarts == 1
    assert any("Corrected." in line for line in lines)
    assert coach.findings == []
    assert "joints good enough after" in coach.end()[-16]


def test_a_silent_receiver_is_named() -> None:
    poses, coach = calibration(), a_coach()
    valid = poses.valid.copy()
    valid[:, poses.index("ring_middle")] = False
    assert any(
        "receiver on ring_middle: is it connected?" in line
        for line in coached(coach, replace(poses, valid=valid))
    )
    assert "Not calibrated" in coach.end()[0]


def advised(sd_mm: Mapping[str, float], range_deg: float, *times_s: float) -> Coach:
    """Return a coach after the first movement and estimates at times_s [s].

    sd_mm : errors of doubtful joints; the others are believed. range_deg : the range that every joint moved.
    """
    joints = {joint for movement in MOVEMENTS.values() for joint in movement.range_deg}
    rows = {
        joint: {"joint": joint, "sd_mm": sd_mm.get(joint, 1.0), "range_deg": range_deg}
        | {"verdict": CARE if joint in sd_mm else BELIEVE}
        for joint in sorted(joints)
    }
    coach = a_coach()
    coach.calibration.done.add(FIRST)
    coach.gains = list  # type: ignore[method-assign]
    for coach.time_s in times_s:
        coach.calibration.estimate = Estimate(0.0, cast(Any, None), rows)
        coach._advise(coach.calibration.estimate)
    return coach


@pytest.mark.parametrize(
    ("sd_mm", "range_deg", "times_s", "movement"),
    [
        ({"thumb_ip": 5.0}, 90.0, (0.0,), "thumb-tip"),
        ({"ring_mcp": 5.0}, 90.0, (0.0,), "alone-ring"),
        ({f"{finger}_pip": 4.0 for finger in FINGERS}, 90.0, (0.0,), "fist"),
        ({"thumb_ip": 5.0}, 5.0, (0.0, 4.5), "thumb-tip"),
        ({"thumb_ip": 5.0}, 5.0, (0.0, 4.5, 6.5), None),
    ],
    ids=["thumb", "ring", "all", "waited-for", "no-longer"],
)
def test_the_movement_of_the_least_certain_joints_is_requested(
    sd_mm: dict[str, float], range_deg: float, times_s: tuple[float, ...], movement: str | None
) -> None:
    request = advised(sd_mm, range_deg, *times_s).calibration.request
    assert (request and request.movement.name) == movement


def test_it_stops_at_joints_that_movements_do_not_improve() -> None:
    times_s = [7.0 * step for step in range(MOST_VAIN + 2)]
    assert advised({"index_mcp": 5.0}, 90.0, *times_s[: MOST_VAIN - 1]).phase != ENOUGH
    coach = advised({"index_mcp": 5.0}, 90.0, *times_s)
    assert coach.phase == ENOUGH
    assert "left are index_mcp at 5.00 mm" in coach.advice


def test_a_long_gap_is_skipped_and_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = calibration().take(slice(0, 480))
    coach = a_coach()
    monkeypatch.setattr(coach, "_estimate", lambda: None)
    coached(coach, joined_poses([poses, from_frame(poses, 3600 * RATE_HZ)]))
    assert coach.time_s > 3600.0
    assert coach.calibration.kept.poses().frame.size == 960
    frames = EvenFrames()
    for _ in range(40):
        frames.add(calibration())
    assert 100 < len({*frames.poses().frame.tolist()}) <= MOST_FRAMES


def test_live_poses_equal_those_of_an_import(archive: Path, tmp_path: Path) -> None:
    live = LivePoses(LIBERTY, archive)
    parts = [poses for piece in open_archive(archive).pieces() if (poses := live.add(piece)) is not None]
    poses, table = joined_poses(parts), tmp_path / "poses.parquet"
    assert capture(["import", f"--in={archive}", f"--out={table}", *WHO]) == 0
    expected = read_poses(table, LIBERTY.measured)
    assert live.ended
    np.testing.assert_array_equal(poses.frame, expected.frame)
    np.testing.assert_array_equal(poses.valid, expected.valid)
    np.testing.assert_allclose(
        poses.position_mm[poses.valid], expected.position_mm[expected.valid], atol=1e-9
    )
    np.testing.assert_allclose(poses.quaternion[poses.valid], expected.quaternion[expected.valid], atol=1e-9)
    assert np.ptp(poses.time_s - expected.time_s) < 1e-4
