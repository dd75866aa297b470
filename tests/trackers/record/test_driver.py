"""Frames that a tracker says are set, against its defaults."""

from trackers.record.driver import is_default_alignment, same_direction


def test_directions() -> None:
    assert same_direction((1, 0, 0), (2.54, 0.001, 0))
    assert not same_direction((1, 0, 0), (-1, 0, 0))
    assert not same_direction((1, 0, 0), (1, 0.1, 0))
    assert not same_direction((0, 0, 0), (1, 0, 0))


def test_the_default_frame_may_be_told_in_any_unit() -> None:
    assert is_default_alignment((0, 0, 0, 1, 0, 0, 0, 1, 0))
    assert is_default_alignment((0, 0, 0, 508, 0, 0, 0, 508, 0))
    assert not is_default_alignment((0, 0, 1, 1, 0, 0, 0, 1, 0))
    assert not is_default_alignment((0, 0, 0, 0, 1, 0, -1, 0, 0))
