"""Whatever the blocks of frames that a recording is read in, its scores are the same."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long_recordings import gappy
from pipeline import HandResults, import_recording, run_hand

from schemas.layout import read_layout
from stages.evaluate_skeletons.evaluation import score_rows
from stages.evaluate_skeletons.scores import read_recording
from stages.evaluate_skeletons.skeleton_folder import read_folder
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate

LAYOUT = read_layout("liberty16")


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandResults:
    """A hand of 240 frames with gaps in every receiver, the hand's from the first frame on."""
    folder = tmp_path_factory.mktemp("hand")
    write_recording(folder / "r.parquet", simulate("01", "right", "rom", 5, Realism.full(), 240))
    poses = import_recording(folder / "r.parquet", folder / "whole.parquet")
    return run_hand(poses, gappy(poses, folder / "poses.parquet", 3), "paper-fig4", folder)


@given(st.integers(5, 240))
@settings(max_examples=8)
def test_blocks_do_not_matter(hand: HandResults, block_frames: int) -> None:
    """To the last bit, whether the recording is kept (240) or read in blocks on every pass."""
    folders = [read_folder(hand.folder, "01", "right")]
    whole, cut = (
        score_rows(read_recording(hand.path("poses"), LAYOUT, [], frames), folders, None)
        for frames in (240, block_frames)
    )
    assert cut == whole
    assert all(row["wrist_mcp_sd_mm"] > 0 for row in whole if not row["reference"])
    assert all(50 < row["n_frames"] < 240 for row in whole)
