"""The motion packed into a page: precision, gaps, size, and the still picture."""

import base64
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from report_samples.made_study import FITTED_MODELS, MadeStudy, make_study
from report_samples.pages import page_of_viewer

from shukotsu.arrays import Array
from shukotsu.hand.rotations import matrix
from shukotsu.report import viewer
from shukotsu.report.hand_motion import still_frame
from shukotsu.report.palette import DIGIT_HUES
from shukotsu.report.viewer import ERROR_STEP_MM, FARTHEST_SHOWN_MM, POSITION_STEP_MM, NumberBlock


def unpacked(data: bytes, parts: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    """Unpack the blocks that `viewer.pack_blocks` wrote, by name: (T, N, W), NaN in gaps."""
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


NUMBERS = st.one_of(st.floats(-FARTHEST_SHOWN_MM, FARTHEST_SHOWN_MM), st.just(np.nan))
VALUES = arrays(float, array_shapes(min_dims=3, max_dims=3, max_side=12), elements=NUMBERS)


def header_of(motion: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the header in a page, and its blocks as `viewer.js` reads them."""
    header = json.loads(viewer.motion_text(motion))
    return header, unpacked(base64.b64decode(header["data"]), header["blocks"])


@given(VALUES, st.sampled_from([0.01, 0.05, 0.25]))
def test_a_packed_block_is_exact_to_half_a_step_and_keeps_gaps(values: np.ndarray, step: float) -> None:
    block = NumberBlock("some", step, values)
    read = unpacked(*viewer.pack_blocks([block]))["some"]
    gaps = np.isnan(values).any(-1)
    np.testing.assert_array_equal(np.isnan(read).all(-1), gaps)
    assert (np.abs(read - values)[~gaps] <= step / 2 + 1e-9).all()


def points_in(header: dict[str, Any], blocks: dict[str, np.ndarray], index: int) -> np.ndarray:
    """Return the positions (T, P, 3) of a skeleton's points as `viewer.js` computes them."""
    seats = header["skeletons"][index]["seats"]
    if seats is None:
        return blocks[f"points{index}"]
    receivers, rotations = blocks["receivers"], blocks["rotations"]
    turns = matrix(rotations / np.linalg.norm(rotations, axis=-1, keepdims=True))
    return np.stack([turns[:, carrier] @ point + receivers[:, carrier] for carrier, point in seats], 1)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_packed_motion_is_exact_to_the_stated_steps(study: MadeStudy, side: str) -> None:
    motion = study.motion(side, "paper-fig4", "whole-hand", "paper-fig3")
    header, blocks = header_of(motion)
    for index, skeleton in enumerate(motion.skeletons):
        off = np.linalg.norm(points_in(header, blocks, index) - skeleton.position_mm, axis=-1)
        rides = skeleton.on_receivers is not None
        assert np.nanmax(off) <= np.sqrt(3) / 2 * POSITION_STEP_MM + (0.02 if rides else 1e-9)
        np.testing.assert_array_equal(np.isnan(off), np.isnan(skeleton.position_mm[..., 0]))
        error_off = np.abs(blocks[f"errors{index}"][..., 0] - skeleton.tip_error_mm)
        assert np.nanmax(error_off) <= ERROR_STEP_MM / 2 + 1e-9
    same = np.abs((blocks["rotations"] * motion.receiver_quaternion).sum(-1))
    length = np.linalg.norm(blocks["rotations"], axis=-1)
    assert np.nanmax(np.degrees(2 * np.arccos(np.clip(same / length, -1, 1)))) < 0.02
    np.testing.assert_array_equal(blocks["frame"][:, 0, 0], motion.frame)


def test_the_view_fits_the_hand_and_ignores_outliers(study: MadeStudy) -> None:
    motion = study.motion("right", "paper-fig4")
    header, _ = header_of(motion)
    skeleton = motion.skeletons[0]
    position = skeleton.position_mm.copy()
    position[:, skeleton.points.index("little_dip")] += 3000.0
    spoiled, _ = header_of(replace(motion, skeletons=(replace(skeleton, position_mm=position),)))
    assert 60 < header["half"][1] < 150
    assert max(spoiled["half"]) < 300


@pytest.mark.slow
def test_a_recording_of_the_papers_length_stays_small(tmp_path: Path) -> None:
    motion = make_study(tmp_path, models=FITTED_MODELS, subjects=("S01",), n_frames=3774).motion("right")
    many = replace(motion, skeletons=motion.skeletons[:1] * 6 + motion.skeletons[1:])
    assert len(viewer.motion_text(motion)) < 800_000
    assert len(viewer.motion_text(many)) < 1_300_000


def test_the_page_has_the_data_once_and_a_still_picture(study: MadeStudy) -> None:
    page = page_of_viewer("Right hand", study.motion("right", "paper-fig4", "whole-hand"))
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    assert [skeleton["model"] for skeleton in json.loads(data)["skeletons"]] == ["paper-fig4", "whole-hand"]
    assert len(page) < len(data) + 80_000
    still, live = page.split('<form class="viewer-live"')
    lines = re.findall(r"fill: none; stroke: var\(--(\w+)\); stroke-width: 2.2", still)
    assert set(lines) == set(DIGIT_HUES), "every digit in its colour"
    assert all(f">{digit}</text>" in still for digit in ("thumb", "index", "middle", "ring", "little"))
    assert live.split(">")[0].endswith(" hidden")


def test_the_still_picture_shows_the_most_open_complete_frame(study: MadeStudy) -> None:
    motion = study.motion("right", "paper-fig4")
    skeleton, valid = motion.skeletons[0], np.isfinite(motion.receiver_mm).all((1, 2))
    tips = skeleton.position_mm[:, [skeleton.points.index(f"{digit}_tip") for digit in motion.digits]]
    reach = np.linalg.norm(tips - motion.receiver_mm[:, [motion.base]], axis=-1).sum(1)
    assert still_frame(motion, skeleton) == np.flatnonzero(valid)[np.argmax(reach[valid])]
