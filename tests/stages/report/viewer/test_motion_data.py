"""What a page holds of a motion is the motion, to the stated error, gaps and all."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from shukotsu.skeleton.rotations import matrix
from shukotsu.stages.report.hand_motion import Array
from shukotsu.stages.report.viewer import (
    ERROR_STEP_MM,
    FARTHEST_MM,
    POSITION_STEP_MM,
    Block,
    motion_text,
    packed,
)


def unpacked(data: bytes, parts: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    """What `viewer.packed` wrote, by block: (T, N, W), NaN in gaps."""
    raw = np.frombuffer(zlib.decompress(data), np.uint8)
    blocks, at = {}, 0
    for part in parts:
        n_frames, count, width, planes = (part[key] for key in ("frames", "count", "width", "planes"))
        code = np.zeros((count, width, n_frames), np.int64)
        for plane in range(planes):
            code |= raw[at : at + code.size].reshape(code.shape).astype(np.int64) << (8 * plane)
            at += code.size
        change = np.where(code > 0, ((code - 1) >> 1) ^ -((code - 1) & 1), 0)
        values = np.where(code > 0, np.cumsum(change, axis=-1) * part["step"], np.nan)
        blocks[part["name"]] = values.transpose(2, 0, 1)
    return blocks


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
        rides = skeleton.on_receivers is not None
        assert np.nanmax(off) <= np.sqrt(3) / 2 * POSITION_STEP_MM + (0.02 if rides else 1e-9)
        np.testing.assert_array_equal(np.isnan(off), np.isnan(skeleton.position_mm[..., 0]))
        assert np.nanmax(np.abs(found[f"errors{index}"][..., 0] - skeleton.tip_error_mm)) <= (
            ERROR_STEP_MM / 2 + 1e-9
        )
    same = np.abs((found["rotations"] * motion.receiver_quaternion).sum(-1))
    length = np.linalg.norm(found["rotations"], axis=-1)
    assert np.nanmax(np.degrees(2 * np.arccos(np.clip(same / length, -1, 1)))) < 0.02
    np.testing.assert_array_equal(found["frame"][:, 0, 0], motion.frame)


def test_the_view_holds_the_hand_and_not_what_is_far_off(right: Any) -> None:
    motion = right.motion("paper-fig4")
    header, _ = header_of(motion)
    skeleton = motion.skeletons[0]
    position = skeleton.position_mm.copy()
    position[:, skeleton.points.index("little_dip")] += 3000.0
    spoiled, _ = header_of(replace(motion, skeletons=(replace(skeleton, position_mm=position),)))
    assert 60 < header["half"][1] < 150
    assert max(spoiled["half"]) < 300


@pytest.mark.slow
def test_a_recording_as_long_as_the_papers_is_small_under_seven_models(
    make_known: Callable[[str, int], Any],
) -> None:
    motion = make_known("right", 3774).motion("paper-fig4", "whole-hand")
    many = replace(motion, skeletons=motion.skeletons[:1] * 6 + motion.skeletons[1:])
    assert len(motion_text(motion)) < 800_000
    assert len(motion_text(many)) < 1_300_000
