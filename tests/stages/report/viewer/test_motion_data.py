"""What a page holds of a motion is the motion, to the stated error, gaps and all."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from report_samples.unpacked_motion import unpacked

from skeleton.posing import Seat
from skeleton.rotations import matrix
from stages.report.hand_motion import thinned
from stages.report.viewer.packed_motion import (
    ERROR_STEP_MM,
    FARTHEST_MM,
    NOMINAL_HZ,
    POSITION_STEP_MM,
    ROTATION_STEP,
    Block,
    motion_text,
    packed,
    playing_times_s,
)

NUMBERS = st.one_of(st.floats(-FARTHEST_MM, FARTHEST_MM), st.just(np.nan))
VALUES = arrays(float, array_shapes(min_dims=3, max_dims=3, max_side=12), elements=NUMBERS)


def header_of(motion: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header that a page holds, and its blocks as `viewer.js` reads them."""
    header = json.loads(motion_text(motion))
    return header, unpacked(base64.b64decode(header["data"]), header["blocks"])


@given(VALUES, st.sampled_from([0.01, 0.05, 0.25]))
def test_a_block_comes_back_to_half_a_step_with_its_gaps(values: np.ndarray, step: float) -> None:
    block = Block("some", step, values)
    found = unpacked(*packed([block]))["some"]
    gaps = np.isnan(values).any(-1)
    np.testing.assert_array_equal(np.isnan(found).all(-1), gaps)
    assert (np.abs(found - values)[~gaps] <= step / 2 + 1e-9).all()


def points_in(header: dict[str, Any], found: dict[str, np.ndarray], index: int) -> np.ndarray:
    """Positions (T, P, 3) of a skeleton's points as `viewer.js` finds them."""
    seats = header["skeletons"][index]["seats"]
    if seats is None:
        return found[f"points{index}"]
    rotations = found["rotations"]
    turns = matrix(rotations / np.linalg.norm(rotations, axis=-1, keepdims=True))
    nowhere = np.full(found["receivers"][:, 0].shape, np.nan)
    places = [
        nowhere if seat is None else turns[:, seat[0]] @ seat[1] + found["receivers"][:, seat[0]]
        for seat in seats
    ]
    return np.stack(places, 1)


def test_a_motion_comes_back_to_the_stated_errors(known: Any) -> None:
    motion = known.motion("paper-fig4", "whole-hand", "paper-fig3")
    header, found = header_of(motion)
    for index, skeleton in enumerate(motion.skeletons):
        off = np.linalg.norm(points_in(header, found, index) - skeleton.position_mm, axis=-1)
        rides = skeleton.seats is not None
        assert np.nanmax(off) <= np.sqrt(3) / 2 * POSITION_STEP_MM + (0.02 if rides else 1e-9)
        np.testing.assert_array_equal(np.isnan(off), np.isnan(skeleton.position_mm[..., 0]))
        assert np.nanmax(np.abs(found[f"errors{index}"][..., 0] - skeleton.tip_error_mm)) <= (
            ERROR_STEP_MM / 2 + 1e-9
        )
    same = np.abs((found["rotations"] * motion.receiver_quaternion).sum(-1))
    length = np.linalg.norm(found["rotations"], axis=-1)
    assert np.nanmax(np.degrees(2 * np.arccos(np.clip(same / length, -1, 1)))) < 0.02
    np.testing.assert_array_equal(found["frame"][:, 0, 0], motion.frame)


def test_a_quaternion_and_its_negative_are_packed_alike(right: Any) -> None:
    motion = right.motion("paper-fig4")
    signs = np.random.default_rng(3).choice([-1.0, 1.0], motion.receiver_quaternion.shape[:2])
    flipped = replace(motion, receiver_quaternion=motion.receiver_quaternion * signs[..., None])
    _, plain = header_of(motion)
    _, found = header_of(flipped)
    steps = np.abs(np.diff(found["rotations"], axis=0))
    assert np.nanmax(steps) < 0.2
    same = np.abs(found["rotations"]) - np.abs(plain["rotations"])
    assert np.nanmax(np.abs(same)) <= ROTATION_STEP


def test_what_rides_is_not_stored_frame_by_frame(right: Any) -> None:
    motion = right.motion("paper-fig4", "whole-hand")
    header, found = header_of(motion)
    assert set(found) == {
        "time", "frame", "receivers", "rotations", "errors0", "errors1", "points1", "posed1"
    }  # fmt: skip
    tip = header["skeletons"][0]["tips"][2]
    assert header["skeletons"][0]["seats"][tip] == [motion.receivers.index("middle_distal"), [0, 0, 0]]


def test_other_blocks_go_with_the_viewers_own(right: Any) -> None:
    motion = right.motion("paper-fig4")
    values = np.arange(240.0).reshape(120, 2, 1)
    header = json.loads(motion_text(motion, [Block("angles", 0.5, values)], {"unit": "deg"}))
    found = unpacked(base64.b64decode(header["data"]), header["blocks"])
    np.testing.assert_array_equal(found["angles"], values)
    assert header["extra"] == {"unit": "deg"}
    with pytest.raises(ValueError, match="two blocks are called errors0"):
        motion_text(motion, [Block("errors0", 0.5, values)])
    with pytest.raises(ValueError, match="angles: 119 frames, the motion has 120"):
        motion_text(motion, [Block("angles", 0.5, values[1:])])
    with pytest.raises(ValueError, match="JSON"):
        motion_text(motion, [], {"unit": np.nan})


def test_what_is_out_of_all_reach_has_no_place_or_becomes_a_gap(right: Any) -> None:
    ridden, fitted = (motion := right.motion("paper-fig4", "whole-hand")).skeletons
    far = Seat("a", "hand", np.array([0.0, 2 * FARTHEST_MM, 0.0]))
    seats = (far, Seat("b", "forearm", np.zeros(3)), *ridden.seats[2:])
    position = fitted.position_mm.copy()
    position[5, 2] = (0.0, 2 * FARTHEST_MM, 0.0)
    moved = (replace(ridden, seats=seats), replace(fitted, position_mm=position))
    header, found = header_of(replace(motion, skeletons=moved))
    assert [seat is None for seat in header["skeletons"][0]["seats"][:3]] == [True, True, False]
    assert np.isnan(found["points1"][5, 2]).all()
    assert np.isfinite(found["points1"][4, 2]).all()


def test_one_frame_is_a_motion(right: Any) -> None:
    motion = right.motion("whole-hand")
    one = thinned(motion, 1)
    header, found = header_of(one)
    assert found["points0"].shape == (1, 25, 3)
    assert all(np.isfinite(header["middle"] + header["half"]))


def test_the_view_holds_the_hand_and_not_what_is_far_off(right: Any) -> None:
    motion = right.motion("paper-fig4")
    header, _ = header_of(motion)
    skeleton = motion.skeletons[0]
    position = skeleton.position_mm.copy()
    position[:, skeleton.points.index("little_dip")] += 3000.0
    spoiled, _ = header_of(replace(motion, skeletons=(replace(skeleton, position_mm=position),)))
    assert 60 < header["half"][1] < 150
    assert max(spoiled["half"]) < 300


def test_the_first_frame_with_a_base_is_named(right: Any) -> None:
    motion = right.motion("paper-fig4")
    receiver_mm = motion.receiver_mm.copy()
    receiver_mm[:7, motion.base] = np.nan
    assert header_of(motion)[0]["firstBase"] == 0
    assert header_of(replace(motion, receiver_mm=receiver_mm))[0]["firstBase"] == 7


def test_a_name_cannot_end_the_script_element(right: Any) -> None:
    motion = right.motion("paper-fig4")
    hostile = replace(motion.skeletons[0], model="</script><b>")
    text = motion_text(replace(motion, skeletons=(hostile,)))
    assert "<" not in text
    assert json.loads(text)["skeletons"][0]["model"] == "</script><b>"


@pytest.mark.slow
def test_a_recording_as_long_as_the_papers_is_small_under_seven_models(
    make_known: Callable[[str, int], Any],
) -> None:
    motion = make_known("right", 3774).motion("paper-fig4", "whole-hand")
    many = replace(motion, skeletons=motion.skeletons[:1] * 6 + motion.skeletons[1:])
    assert len(motion_text(motion)) < 800_000
    assert len(motion_text(many)) < 1_300_000


@pytest.mark.parametrize(
    ("time_s", "shown"),
    [
        ([5.0, 5.004, 5.1, 5.1042], [0.0, 0.004, 0.1, 0.1042]),
        ([np.nan, 1.0, np.nan, 3.0, np.nan], [0.0, 0.0, 1.0, 2.0, 2.0]),
        ([1.0, 3.0, 2.0, 4.0], [0.0, 2.0, 2.0, 3.0]),
        ([np.nan, np.nan, np.nan], [0.0, 1 / NOMINAL_HZ, 2 / NOMINAL_HZ]),
    ],
)
def test_time_never_runs_backwards_and_gaps_lie_between_neighbours(
    time_s: list[float], shown: list[float]
) -> None:
    np.testing.assert_allclose(playing_times_s(np.array(time_s)), shown)
