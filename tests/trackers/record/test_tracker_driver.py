"""Frames that a tracker says are set, against its defaults."""

from shukotsu.trackers.record.tracker_driver import is_default_alignment


def test_the_default_frame_may_be_told_in_any_unit() -> None:
    assert is_default_alignment((0, 0, 0, 1, 0, 0, 0, 1, 0))
    assert is_default_alignment((0, 0, 0, 508, 0, 0, 0, 508, 0))
    assert not is_default_alignment((0, 0, 1, 1, 0, 0, 0, 1, 0))
    assert not is_default_alignment((0, 0, 0, 0, 1, 0, -1, 0, 0))
