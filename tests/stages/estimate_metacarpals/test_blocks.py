"""Whatever the blocks of frames that a recording is read in, wrist, bones and metacarpals are the same."""

from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long_recordings import hand_with_gaps
from pipeline import HandResults

from kinematics.recordings import Recordings
from schemas.catalogue import JOINT_CENTRES
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.poses import read_poses
from schemas.table_rows import in_row_groups
from schemas.tables import read_table, rows_of
from stages.estimate_metacarpals.hand import build_hand, pose_metacarpals
from stages.estimate_metacarpals.wrist_row import wrist_row

LAYOUT = read_layout("liberty16")
MODELS = ("paper-fig3", "paper-fig3-rest", "paper-fig4", "rigid")


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandResults:
    """A hand of 240 frames with gaps in every receiver, the hand's from the first frame on."""
    return hand_with_gaps(tmp_path_factory.mktemp("hand"))


def made(hand: HandResults, model_name: str, block_frames: int) -> tuple[Any, Any, pa.Table]:
    """Joints, bones and metacarpals with the recording read in such blocks."""
    rows = {row["joint"]: row for row in rows_of(read_table(hand.path("projected_joints"), JOINT_CENTRES))}
    model, path = read_model(model_name), hand.path("poses")
    built = build_hand(rows, LAYOUT, model, Recordings([path], LAYOUT.measured, block_frames))
    parts = pose_metacarpals(built, LAYOUT, model, [path], block_frames)
    joints = [{**row, "covariance_mm2": str(row["covariance_mm2"])} for row in built.joints]
    return joints, built.bones, pa.concat_tables(pa.table(part) for part in in_row_groups(parts))


@pytest.mark.parametrize("model", MODELS)
@given(block_frames=st.integers(5, 240))
@settings(max_examples=4)
def test_blocks_do_not_matter(hand: HandResults, model: str, block_frames: int) -> None:
    """To the last bit; 240 frames of 16 receivers are kept as they are in blocks of 240, and only there."""
    whole, cut = (made(hand, model, frames) for frames in (240, block_frames))
    assert str(cut[:2]) == str(whole[:2])
    for name in whole[2].column_names:
        np.testing.assert_array_equal(cut[2].column(name).to_numpy(), whole[2].column(name).to_numpy())


def test_the_wrist_of_a_long_recording_goes_by_some_frames(hand: HandResults) -> None:
    """24,000 frames are thinned to evenly spaced ones, the same ones in blocks of an odd number of frames."""
    rows = {row["joint"]: row for row in rows_of(read_table(hand.path("projected_joints"), JOINT_CENTRES))}
    poses = read_poses(hand.path("poses"), LAYOUT.measured).take(np.arange(24000) % 240)
    blocks = [poses.take(slice(start, start + 737)) for start in range(0, 24000, 737)]
    whole, cut = (wrist_row(rows, LAYOUT, read_model("paper-fig3"), part) for part in ([poses], blocks))
    assert whole is not None
    assert str(cut) == str(whole)


def test_a_gap_is_flagged_and_has_no_numbers(hand: HandResults) -> None:
    table = made(hand, "paper-fig4", 240)[2]
    gap = np.char.find(table.column("flags").to_numpy().astype(str), "gap") >= 0
    assert 0 < gap.sum() < len(gap)
    np.testing.assert_array_equal(np.isnan(table.column("qw").to_numpy()), gap)


@given(st.lists(st.integers(0, 30), max_size=8), st.integers(1, 40))
def test_parts_are_packed_in_order(lengths: list[int], rows: int) -> None:
    start, parts = 0, []
    for length in lengths:
        parts.append({"frame": np.arange(start, start + length)})
        start += length
    found = [group["frame"].to_pylist() for group in in_row_groups(parts, rows)]
    assert [frame for group in found for frame in group] == list(range(start))
    assert all(len(group) == rows for group in found[:-1])
    assert all(0 < len(group) <= rows for group in found)
