"""The page that shows a moving hand: all in one file, and something to see where nothing moves."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
from report_samples.small_page import page_of_viewer

from shukotsu.stages.report.hand_motion import still_frame
from shukotsu.stages.report.palette import DIGIT_HUES


def test_the_data_stand_in_the_page_once(right: Any) -> None:
    motion = right.motion("paper-fig4", "whole-hand")
    page = page_of_viewer("Right hand", motion)
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    header = json.loads(data)
    assert [skeleton["model"] for skeleton in header["skeletons"]] == ["paper-fig4", "whole-hand"]
    assert len(page) < len(data) + 80_000


def test_a_still_picture_stands_in_until_the_hand_moves(right: Any) -> None:
    page = page_of_viewer("Right hand", right.motion("whole-hand"))
    still, live = page.split('<form class="viewer-live"')
    assert "<svg" in still
    lines = re.findall(r"fill: none; stroke: var\(--(\w+)\); stroke-width: 2.2", still)
    assert set(lines) == set(DIGIT_HUES), "a digit in its colour"
    assert all(f">{digit}</text>" in still for digit in ("thumb", "index", "middle", "ring", "little"))
    assert live.split(">")[0].endswith(" hidden")


def test_the_still_picture_is_of_the_most_open_whole_frame(right: Any) -> None:
    motion = right.motion("paper-fig4")
    skeleton, valid = motion.skeletons[0], np.isfinite(motion.receiver_mm).all((1, 2))
    tips = skeleton.position_mm[:, [skeleton.points.index(f"{digit}_tip") for digit in motion.digits]]
    reach = np.linalg.norm(tips - motion.receiver_mm[:, [motion.base]], axis=-1).sum(1)
    assert still_frame(motion, skeleton) == np.flatnonzero(valid)[np.argmax(reach[valid])]
