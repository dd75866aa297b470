"""Bones posed from a subject's tables: frames matched by number, and missing tables refused."""

from pathlib import Path

import numpy as np
import pytest
from simulated_hands import FITTED, REPLAYED, SimulatedHand, simulated_hand

from shukotsu.errors import InputError
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.tables.catalogue import BONE_POSES, JOINT_CENTRES, METACARPALS


@pytest.fixture
def hand(tmp_path: Path) -> SimulatedHand:
    return simulated_hand(tmp_path, "right", 20)


def test_selected_frames_equal_those_of_the_whole_recording(hand: SimulatedHand) -> None:
    rows = np.array([3, 4, 11])
    for model in (REPLAYED, FITTED):
        recording = recording_reader(hand.plan, hand.recording, model)
        whole, some = recording.bones(hand.poses()), recording.bones(hand.poses().take(rows))
        np.testing.assert_array_equal(some.position_mm, whole.position_mm[rows])
        np.testing.assert_array_equal(some.quaternion, whole.quaternion[rows])
        assert np.isfinite(whole.quaternion).all(), model


def test_a_frame_missing_from_a_table_is_a_gap(hand: SimulatedHand) -> None:
    rows = [row for row in hand.rows(FITTED, BONE_POSES) if (row["segment"], row["frame"]) != ("hand", 5)]
    hand.write(FITTED, BONE_POSES, rows)
    bones = recording_reader(hand.plan, hand.recording, FITTED).bones(hand.poses())
    assert np.flatnonzero(np.isnan(bones.position_mm[:, 0, 0])).tolist() == [4], "frames count from 1"


def test_a_recording_that_was_not_posed_is_refused(hand: SimulatedHand) -> None:
    for model, table in ((FITTED, BONE_POSES), (REPLAYED, METACARPALS)):
        hand.write(model, table, [row | {"task": "rom"} for row in hand.rows(model, table)])
        reader = recording_reader(hand.plan, hand.recording, model)
        with pytest.raises(InputError, match="no row of opposition; no frame of it could be"):
            reader.bones(hand.poses())


def test_a_failed_or_missing_table_is_refused_with_the_reason(hand: SimulatedHand) -> None:
    hand.write(REPLAYED, JOINT_CENTRES, "subject 01: no calibration recording")
    with pytest.raises(InputError, match="no calibration recording"):
        recording_reader(hand.plan, hand.recording, REPLAYED).bones(hand.poses())
    assert recording_reader(hand.plan, hand.recording, FITTED).bones(hand.poses()).joints, (
        "the other skeleton is not affected"
    )
    hand.path(REPLAYED, JOINT_CENTRES).unlink()
    with pytest.raises(InputError, match="no such file"):
        recording_reader(hand.plan, hand.recording, REPLAYED).bones(hand.poses())
