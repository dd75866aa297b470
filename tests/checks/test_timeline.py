"""Detection of hemisphere flips, spikes and stuck receivers, exact to the frame."""

from dataclasses import replace

import numpy as np
import pytest

from shukotsu.checks.timeline import Timeline, away, sides, spikes, stuck
from shukotsu.hand.rotations import about_axis

FRAMES = 600
T = np.arange(FRAMES) / 100


def moving(receivers: int = 3) -> Timeline:
    phase = 2 * np.pi * (0.5 * T[:, None] + np.arange(receivers) / 7)
    offset = np.array([300.0, 50.0, -80.0])
    position = offset + 50 * np.stack([np.sin(phase), np.cos(phase), np.sin(2 * phase)], -1)
    quaternion = about_axis(np.array([0.0, 1.0, 0.0]), 0.35 * np.sin(phase))
    return Timeline(T, position, quaternion, np.ones((FRAMES, receivers), bool))


def test_flips_are_located_to_the_frame_even_across_a_gap() -> None:
    line = moving()
    sign = np.ones((FRAMES, 3))
    sign[100:250, 1] = sign[:40, 2] = -1
    line.valid[245:255, 1] = False
    flipped = replace(line, position_mm=line.position_mm * sign[..., None])
    assert (sides(flipped) == sign)[line.valid].all()
    assert away(sides(flipped)).tolist() == [0, 1, 1]


@pytest.mark.parametrize("rows", [[300], [300, 301]])
def test_only_single_absurd_rows_are_spikes(rows: list[int]) -> None:
    line = moving()
    line.position_mm[rows, 2] += 10_000
    assert np.argwhere(spikes(line)).tolist() == [[row, 2] for row in rows]
    line = moving()
    line.quaternion[rows, 0] = [0, 1, 0, 0]
    assert np.argwhere(spikes(line)).tolist() == [[row, 0] for row in rows]


def test_a_receiver_is_stuck_only_while_another_moves() -> None:
    line = moving()
    line.position_mm[200:300, 1], line.quaternion[200:300, 1] = (
        line.position_mm[200, 1],
        line.quaternion[200, 1],
    )
    expected = np.zeros((FRAMES, 3), bool)
    expected[200:300, 1] = True
    assert (stuck(line) == expected).all()
    still = replace(line, position_mm=line.position_mm * 0, quaternion=line.quaternion[:1].repeat(FRAMES, 0))
    assert not stuck(still).any()
