"""Section 6: the replayed tip's error as a sum of the joints' gaps."""

from typing import Any

import numpy as np
import pytest
from chains import Chain, chain_layout, random_chain, reader_of
from hypothesis import given, settings
from hypothesis import strategies as st

from shukotsu.hand.digit_chain import DigitChain, digit_chain
from shukotsu.hand.posing import Skeleton, receiver_bones
from shukotsu.hand.rotations import Array, matrix
from shukotsu.paper import replay
from shukotsu.paper.hand import build_hand
from shukotsu.study.model import read_model

SEEDS = st.integers(0, 2**32 - 1)


def rows_with(chain: Chain, off_mm: float, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Return rows of joint_centres with an error of sd off_mm per axis in p and q."""
    rng = np.random.default_rng(seed)
    rows = {}
    for j, joint in enumerate(chain.joints):
        p = chain.p_mm[j] + off_mm * rng.normal(size=3)
        q = chain.q_mm[j] + off_mm * rng.normal(size=3)
        rows[joint.name] = {
            "parent_segment": joint.parent_receiver,
            "child_segment": joint.child,
            "dof": 3,
            "status": "ok",
            "message": "",
            "covariance_mm2": np.zeros(36),
            **{f"parent_{axis}_mm": value for axis, value in zip("xyz", p, strict=True)},
            **{f"child_{axis}_mm": value for axis, value in zip("xyz", q, strict=True)},
        }
    return rows


def replayed(chain: Chain, rows: dict[str, dict[str, Any]]) -> tuple[DigitChain, Array, Array]:
    """Return the chain's digit and its tips (T, 3) in the least-squares and the first-frame binding."""
    layout, model, poses = chain_layout(chain), read_model("rigid"), chain.poses
    (digit,) = layout.digits.values()
    bones = build_hand(rows, layout, model, reader_of(poses)).bones
    skeleton = Skeleton(layout, model, rows, {(row["digit"], row["bone"]): row for row in bones})
    built = digit_chain(digit, layout, model, rows)
    assert isinstance(built, DigitChain)
    least_squares = replay.tips_least_squares(receiver_bones(skeleton, poses, {}))[digit.name]
    first = replay.first_frame(built, poses, None)
    return built, least_squares, replay.tip_first_frame(built, poses, None, first, at_rest=False)


def gaps(chain: Chain, rows: dict[str, dict[str, Any]]) -> Array:
    """Return each joint's gap R_a p + t_a - R_b q - t_b, (T, J, 3) in mm, computed from matrices."""
    gap = []
    rotation, position = matrix(chain.poses.quaternion), chain.poses.position_mm
    for j, joint in enumerate(chain.joints):
        p, q = (np.array([rows[joint.name][f"{side}_{k}_mm"] for k in "xyz"]) for side in ("parent", "child"))
        gap.append(rotation[:, j] @ p + position[:, j] - rotation[:, j + 1] @ q - position[:, j + 1])
    return np.stack(gap, 1)


@given(SEEDS, st.integers(2, 6), st.floats(0, 30))
@settings(max_examples=30)
def test_the_tip_error_is_the_sum_of_the_joints_gaps(seed: int, n_segments: int, off_mm: float) -> None:
    """tip_FK - tip is the sum of the digit's gaps; in the first-frame binding, minus the gaps of that frame.

    A gap in the binding frame becomes part of a bone and turns with it: the first bone carries the gaps of
    both its joints, every later bone that of its distal joint.
    """
    chain = random_chain(seed, n_segments, 40, off_axis_rad=0.1, noise_mm=0.5)
    rows = rows_with(chain, off_mm, seed)
    measured, gap = chain.poses.position_mm[:, -1], gaps(chain, rows)
    _, tip, first = replayed(chain, rows)
    np.testing.assert_allclose(tip - measured, gap.sum(1), atol=1e-9)
    rotation = matrix(chain.poses.quaternion)
    since_first = rotation @ rotation[0].transpose(0, 2, 1)
    carrier = [1, *range(1, n_segments - 1)]
    bound = sum(since_first[:, c] @ gap[0, j] for j, c in enumerate(carrier))
    np.testing.assert_allclose(first - measured, gap.sum(1) - bound, atol=1e-9)


def test_the_binding_frame_is_the_first_fully_valid_one() -> None:
    """Frames with an invalid receiver have no error, and the first fully valid frame has error zero."""
    chain = random_chain(1, 4, 60, noise_mm=0.5)
    chain.poses.valid[:5, 0] = False
    chain.poses.valid[30, 3] = False
    chain.poses.position_mm[~chain.poses.valid] = np.nan
    digit, least, first = replayed(chain, rows_with(chain, 5.0))
    error = replay.tip_error_mm(first, digit, chain.poses)
    assert np.flatnonzero(np.isnan(error)).tolist() == [0, 1, 2, 3, 4, 30]
    np.testing.assert_array_equal(np.isnan(replay.tip_error_mm(least, digit, chain.poses)), np.isnan(error))
    assert error[5] == pytest.approx(0, abs=1e-9)
    assert int(np.isfinite(error).sum()) == 54


def test_tip_error_statistics_leave_gaps_out() -> None:
    finite = np.array([3.0, 1.0, 2.0, 10.0])
    assert replay.error_statistics(np.array([3.0, np.nan, 1.0, 2.0, 10.0])) == {
        "max_mm": 10.0,
        "min_mm": 1.0,
        "mean_mm": 4.0,
        "sd_mm": np.std(finite),
        "median_mm": 2.5,
        "p95_mm": np.percentile(finite, 95),
        "n_frames": 4,
    }
    assert replay.error_statistics(np.full(3, np.nan)) == {"n_frames": 0}
