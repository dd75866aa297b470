"""Whatever the blocks of frames that a recording is read in, its tips and their errors are the same."""

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long_recordings import hand_with_gaps
from pipeline import HandResults

from schemas.catalogue import METACARPALS
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.table_rows import TableRows, in_row_groups
from schemas.tables import Provenance, read_table, write_table
from stages.evaluate_tips.recording import Skeleton, evaluate_recording

LAYOUT = read_layout("liberty16")
TURNS = ("qw", "qx", "qy", "qz")


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandResults:
    """A hand of 240 frames with gaps in every receiver, the hand's from the first frame on."""
    return hand_with_gaps(tmp_path_factory.mktemp("hand"))


def replayed(hand: HandResults, block_frames: int, table: str = "metacarpals") -> tuple[pa.Table, list[Any]]:
    """Tips and tip_errors with the recording read in such blocks."""
    bones: dict[str, dict[str, Any]] = {}
    for row in hand.rows("bone_lengths"):
        bones.setdefault(row["digit"], {})[row["bone"]] = row
    metacarpals = TableRows(hand.path(table), METACARPALS, ("task", "trial", "digit"), TURNS)
    skeleton = Skeleton(LAYOUT, read_model("paper-fig4"), hand.joints(), bones, metacarpals)
    rows: list[dict[str, Any]] = []
    path = hand.path("poses")
    blocks = evaluate_recording(path, skeleton, rows, held_out=False, block_frames=block_frames)
    return pa.concat_tables(pa.table(part) for part in in_row_groups(blocks)), rows


@given(st.integers(5, 240))
@settings(max_examples=6)
def test_blocks_do_not_matter(hand: HandResults, block_frames: int) -> None:
    """To the last bit, the time included, which no one receiver has in every frame."""
    (whole, whole_rows), (cut, cut_rows) = (replayed(hand, frames) for frames in (240, block_frames))
    assert cut_rows == whole_rows
    assert {row["n_frames"] for row in whole_rows} <= set(range(50, 240))
    for name in whole.column_names:
        np.testing.assert_array_equal(cut.column(name).to_numpy(), whole.column(name).to_numpy())
    assert np.isfinite(whole.column("time_s").to_numpy()).mean() > 0.99


def test_the_binding_frame_is_exact_in_a_later_block(hand: HandResults) -> None:
    """The hand's first frames are gaps: in blocks of 2 the first usable frame is not in the first of them."""
    error = replayed(hand, 2)[0].column("error_first_frame_mm").to_numpy()[:240]
    first = int(np.argmax(np.isfinite(error)))
    assert first > 2
    assert error[first] == pytest.approx(0, abs=1e-9)


def test_metacarpals_of_other_poses_are_refused(hand: HandResults) -> None:
    table = read_table(hand.path("metacarpals"), METACARPALS)
    few = table.filter(pc.less(table.column("frame"), 100))
    columns = {name: few.column(name) for name in few.column_names}
    write_table(hand.path("few"), METACARPALS, columns, Provenance())
    with pytest.raises(InputError, match=r"few\.parquet: task, thumb has fewer frames than the recording"):
        replayed(hand, 240, "few")
