"""The page that shows a moving hand: all in one file, and something to see where nothing moves."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_samples.small_page import page_of_viewer

from shukotsu.stages.report.hand_motion import still_frame
from shukotsu.stages.report.palette import DIGIT_HUES
from shukotsu.stages.report.viewer import view as viewer_view
from shukotsu.stages.report.viewer.view import view_of

FOLDER = Path(viewer_view.__file__).parent


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


def test_one_skeleton_is_not_offered_beside_another(right: Any) -> None:
    alone = page_of_viewer("x", right.motion("paper-fig4"))
    both = page_of_viewer("x", right.motion("paper-fig4", "whole-hand"))
    for name in ("first", "second", "over"):
        control = f'data-part="{name}"'
        assert (control in alone, control in both) == (False, True)


def test_the_lists_stand_at_what_is_shown_first(right: Any) -> None:
    page = page_of_viewer("x", right.motion("paper-fig3", "paper-fig4", "whole-hand"))
    chosen = re.findall(r'<option value="(\d)" selected>([\w-]+)</option>', page)
    assert chosen == [("2", "whole-hand"), ("1", "paper-fig4")]
    assert ">whole-hand, frame " in page


def test_remarks_say_what_is_not_as_recorded(right: Any) -> None:
    motion = right.motion("paper-fig4")
    assert view_of("x", motion).remark == ""
    assert "no device time" in view_of("x", replace(motion, time_s=np.full(120, np.nan))).remark
    assert "one frame in 4" in view_of("x", replace(motion, every=4)).remark


def test_the_still_picture_is_of_the_middlemost_whole_frame(right: Any) -> None:
    motion = right.motion("paper-fig4")
    valid = np.isfinite(motion.receiver_mm).all(-1)
    assert 45 <= still_frame(valid, motion.base) < 50 or 60 <= still_frame(valid, motion.base) < 65
    valid[30:, motion.base] = False
    assert still_frame(valid, motion.base) == 29


def test_the_script_stays_small() -> None:
    assert (FOLDER / "viewer.js").stat().st_size <= 29_000


@pytest.mark.parametrize("name", ["viewer.js", "viewer.css"])
def test_the_template_language_reads_nothing_into_code(name: str) -> None:
    assert not re.search(r"\{[{%#]|</script", (FOLDER / name).read_text("utf-8"))
