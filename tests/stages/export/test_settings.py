"""A motion made ready for a format: what the user asked, in an order that loses nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from export_samples.moving_fingers import blanked, moving_fingers

from shukotsu.errors import InputError
from shukotsu.stages.export.settings import Settings, prepared


def test_a_format_that_holds_gaps_keeps_them_unless_told_otherwise() -> None:
    motion = blanked(moving_fingers(40), np.s_[10:13, 2])
    kept = prepared(motion, Settings(), holds_gaps=True, up="")
    np.testing.assert_array_equal(kept.whole, motion.whole)
    assert prepared(motion, Settings(gaps="hold"), holds_gaps=True, up="").whole.all()
    with pytest.raises(InputError, match="joint index_mcp has no pose in frames 17 to 19"):
        prepared(motion, Settings(), holds_gaps=False, up="y")
    outside = prepared(motion, Settings(first=20), holds_gaps=False, up="y")
    assert outside.whole.all()
    assert outside.frame[0] == 20


def test_gaps_are_closed_before_the_rate_is_changed() -> None:
    motion = blanked(moving_fingers(40), np.s_[10:13, 2])
    assert prepared(motion, Settings(gaps="interpolate", fps=30), holds_gaps=False, up="y").whole.all()


def test_a_clock_that_jumps_is_not_bridged_unasked() -> None:
    """Frame numbers go on, time does not: nobody knows what the hand did meanwhile."""
    motion = moving_fingers(40)
    time_s = motion.time_s.copy()
    time_s[20:] += 0.3
    jumped = replace(motion, time_s=time_s)
    with pytest.raises(InputError, match=r"nothing was recorded about 0\.2\d\d s \(frame 26\)"):
        prepared(jumped, Settings(fps=30), holds_gaps=False, up="y")
    assert not prepared(jumped, Settings(fps=30), holds_gaps=True, up="").whole.all()
    wide = Settings(fps=30, gaps="interpolate", max_gap_s=0.5)
    assert prepared(jumped, wide, holds_gaps=False, up="y").whole.all()
