"""BIDS labels and names of files: legal, and of one name each."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from shukotsu.motion_bids.labels import label, recording_stem
from shukotsu.schemas.poses import RecordingName


@given(st.text(), st.text())
def test_labels_are_legal_and_of_one_name_each(one: str, other: str) -> None:
    assert label(one).isascii()
    assert label(one).isalnum() or not one
    assert (label(one) == label(other)) == (one == other)


def test_no_two_recordings_share_their_files() -> None:
    names = [
        RecordingName(subject, hand, task, trial)
        for subject in ("1", "01", "0-1", "Q")
        for hand in ("left", "right")
        for task in ("rom", "r_om", "rQuom")
        for trial in ("", "1", "01", "a", "run-1")
    ]
    assert len({recording_stem(name) for name in names}) == len(names)
