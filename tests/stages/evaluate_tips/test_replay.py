"""Section 6: what the replay's error is made of, for any chain."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from chains import Chain, chain_layout, random_chain
from hypothesis import given, settings
from hypothesis import strategies as st

from kinematics.long_sample import LongSample
from kinematics.rotations import Array, matrix
from kinematics.skeleton import DigitChain, digit_chain
from schemas.model import read_model
from stages.estimate_metacarpals.bones import digit_bones
from stages.evaluate_tips.replay import (
    error_statistics,
    replay_first_frame,
    replay_least_squares,
    tip_error_mm,
)

SEEDS = st.integers(0, 2**32 - 1)
NO_COVARIANCE = np.zeros(36)


def rows_with(chain: Chain, off_mm: float, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Rows of joint_centres with the true centres, each half wrong by about off_mm."""
    rng = np.random.default_rng(seed)
    rows = {}
    for j, joint in enumerate(chain.joints):
        p = chain.p_mm[j] + off_mm * rng.normal(size=3)
        q = chain.q_mm[j] + off_mm * rng.normal(size=3)
        rows[joint.name] = {
            "status": "ok",
            "message": "",
            "covariance_mm2": NO_COVARIANCE,
            **{f"parent_{axis}_mm": value for axis, value in zip("xyz", p, strict=True)},
            **{f"child_{axis}_mm": value for axis, value in zip("xyz", q, strict=True)},
        }
    return rows


def built(chain: Chain, rows: dict[str, dict[str, Any]]) -> tuple[DigitChain, dict[str, Any]]:
    layout, model = chain_layout(chain), read_model("rigid")
    digit = digit_chain(layout.digits[chain.poses.segments[-1]], layout, model, rows)
    assert isinstance(digit, DigitChain)
    bones = digit_bones(digit, "none", rows, layout, [chain.poses])
    return digit, {bone.segment: bone.row() for bone in bones}


def gaps(chain: Chain, rows: dict[str, dict[str, Any]]) -> Array:
    """Gap of every joint, R_a p + t_a - R_b q - t_b, (T, J, 3), from matrices."""
    found = []
    rotation, position = matrix(chain.poses.quaternion), chain.poses.position_mm
    for j, joint in enumerate(chain.joints):
        p, q = (np.array([rows[joint.name][f"{side}_{k}_mm"] for k in "xyz"]) for side in ("parent", "child"))
        found.append(rotation[:, j] @ p + position[:, j] - rotation[:, j + 1] @ q - position[:, j + 1])
    return np.stack(found, 1)


@given(SEEDS, st.integers(2, 6), st.floats(0, 30))
@settings(max_examples=30)
def test_the_tip_error_telescopes(seed: int, n_segments: int, off_mm: float) -> None:
    """tip_FK - tip is the sum of the digit's gaps; bound in the first frame, less their values there.

    A gap that is there in the binding frame is part of the bone drawn then, and turns with that bone: the
    first bone (base by its parent half) takes its own joint's gap along, every bone its next joint's.
    """
    chain = random_chain(seed, n_segments, 40, off_axis_rad=0.1, noise_mm=0.5)
    rows = rows_with(chain, off_mm, seed)
    digit, bones = built(chain, rows)
    measured, gap = chain.poses.position_mm[:, -1], gaps(chain, rows)
    tip = replay_least_squares(digit, bones, chain.poses, None)
    np.testing.assert_allclose(tip - measured, gap.sum(1), atol=1e-9)
    rotation = matrix(chain.poses.quaternion)
    since_first = rotation @ rotation[0].transpose(0, 2, 1)
    carrier = [1, *range(1, n_segments - 1)]
    bound = sum(since_first[:, c] @ gap[0, j] for j, c in enumerate(carrier))
    first = replay_first_frame(digit, chain.poses, None, at_rest=False)
    np.testing.assert_allclose(first - measured, gap.sum(1) - bound, atol=1e-9)


def test_true_centres_have_no_error() -> None:
    """Without noise the true skeleton's tip is the receiver, in either binding, to rounding."""
    chain = random_chain(1, 5)
    digit, bones = built(chain, rows_with(chain, 0.0))
    for tip in (
        replay_least_squares(digit, bones, chain.poses, None),
        replay_first_frame(digit, chain.poses, None, at_rest=False),
    ):
        assert tip_error_mm(tip, digit, chain.poses).max() < 1e-9


def test_the_binding_frame_is_the_first_usable_one() -> None:
    """Gaps stay gaps, and the first frame in which all is valid has no error."""
    chain = random_chain(1, 4, 60, noise_mm=0.5)
    chain.poses.valid[:5, 0] = False
    chain.poses.valid[30, 3] = False
    chain.poses.position_mm[~chain.poses.valid] = np.nan
    digit, _ = built(chain, rows_with(chain, 5.0))
    error = tip_error_mm(replay_first_frame(digit, chain.poses, None, at_rest=False), digit, chain.poses)
    assert np.flatnonzero(np.isnan(error)).tolist() == [0, 1, 2, 3, 4, 30]
    assert error[5] == pytest.approx(0, abs=1e-9)
    assert int(np.isfinite(error).sum()) == 54


def test_statistics_are_numpys() -> None:
    known = np.array([3.0, 1.0, 2.0, 10.0])
    sample = LongSample()
    sample.add_known(np.array([3.0, np.nan, 1.0, 2.0, 10.0]))
    assert error_statistics(sample) == {
        "max_mm": 10.0,
        "min_mm": 1.0,
        "mean_mm": 4.0,
        "sd_mm": np.std(known),
        "median_mm": 2.5,
        "p95_mm": np.percentile(known, 95),
        "n_frames": 4,
    }
    assert error_statistics(LongSample()) == {"n_frames": 0}


def test_a_failed_joint_fails_its_digit_in_words() -> None:
    chain = random_chain(1, 4)
    rows = rows_with(chain, 0.0)
    rows["joint_s2"] = {**rows["joint_s2"], "status": "failed", "message": "the joint did not move"}
    layout = chain_layout(chain)
    reason = digit_chain(layout.digits[chain.poses.segments[-1]], layout, read_model("rigid"), rows)
    assert reason == "joint_s2 failed: the joint did not move"


def test_left_and_right_have_the_same_error() -> None:
    """Mirrored poses and joints have the mirrored tips."""
    mirror = np.array([1.0, -1.0, 1.0])
    chain = random_chain(4, 4, 50, off_axis_rad=0.1, noise_mm=0.5)
    turned = np.array([1.0, -1.0, 1.0, -1.0])  # (w, x, y, z) of M R M for a mirror in y
    mirrored = replace(
        chain,
        poses=replace(
            chain.poses,
            position_mm=chain.poses.position_mm * mirror,
            quaternion=chain.poses.quaternion * turned,
        ),
        p_mm=chain.p_mm * mirror,
        q_mm=chain.q_mm * mirror,
    )
    tips = []
    for one in (chain, mirrored):
        digit, bones = built(one, rows_with(one, 0.0))
        tips.append(replay_least_squares(digit, bones, one.poses, None))
    np.testing.assert_allclose(tips[1], tips[0] * mirror, atol=1e-9)
