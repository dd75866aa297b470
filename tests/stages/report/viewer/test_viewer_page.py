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
    lines = re.findall(r'clip-path="[^"]*" style="fill:none;stroke:var\(--(\w+)\)', still)
    assert [hue for hue in lines if hue in DIGIT_HUES] == list(DIGIT_HUES) * 2, "a line a digit in both views"
    assert live.split(">")[0].endswith(" hidden")


def test_the_still_picture_is_of_the_middlemost_whole_frame(right: Any) -> None:
    motion = right.motion("paper-fig4")
    valid = np.isfinite(motion.receiver_mm).all(-1)
    assert 45 <= still_frame(valid, motion.base) < 50 or 60 <= still_frame(valid, motion.base) < 65
    valid[30:, motion.base] = False
    assert still_frame(valid, motion.base) == 29
