"""What notebooks get: tables with their units, posed hands wherever the results are."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand, make_hand

import shukotsu
from shukotsu.errors import InputError
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.tables.catalogue import JOINT_CENTRES
from shukotsu.tables.typed_table import column_array, read_table


@pytest.fixture(scope="module", params=["right", "left"])
def known(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    return make_hand(tmp_path_factory.mktemp("study"), request.param)


def test_importing_it_imports_nothing_heavy() -> None:
    look = (
        "import shukotsu, sys; sys.exit(str({'numpy', 'pandas', 'pyarrow', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "set()"


def test_a_name_that_is_not_there_is_told() -> None:
    with pytest.raises(AttributeError, match="no 'raed'; it has PosedRecording, bend, pose, read"):
        shukotsu.raed  # noqa: B018


def test_a_table_comes_with_units_and_gaps(known: KnownHand) -> None:
    path = known.path(REPLAYED, JOINT_CENTRES)
    frame, table = shukotsu.read(str(path)), read_table(path, JOINT_CENTRES)
    assert list(frame.columns) == table.column_names
    assert len(frame) == table.num_rows > 0
    np.testing.assert_array_equal(frame["child_x_mm"], column_array(table, "child_x_mm"))
    assert frame["axis_child_x"].isna().sum() == table.column("axis_child_x").null_count > 0
    assert frame.attrs["table"] == "joint_centres"
    assert frame.attrs["key"] == list(JOINT_CENTRES.key)
    assert frame.attrs["units"]["child_x_mm"] == "mm"
    assert frame.attrs["descriptions"].keys() == set(frame.columns)


@pytest.mark.parametrize("model", [FITTED, REPLAYED])
def test_a_hand_is_posed_as_the_pipeline_poses_it(known: KnownHand, model: str) -> None:
    hand = shukotsu.pose(known.plan.folder.parent, "01", known.made.hand, "opposition", model=model)
    bones = recording_reader(known.plan, known.recording, model).bones(known.poses())
    assert hand.names == bones.names
    np.testing.assert_array_equal(hand.position_mm, bones.position_mm)
    np.testing.assert_array_equal(hand.frame, known.made.frame)
    assert np.isfinite(hand.time_s).all()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"subject": "02"}, "run the study to write the subject's plan"),
        ({"task": "scales"}, "subject 01 has no recording .* scales; expected one of .* opposition"),
        ({"model": "whole_hand"}, "model 'whole_hand' is not in study made; did you mean 'whole-hand'"),
    ],
)
def test_what_is_not_in_the_study_is_told(known: KnownHand, words: dict[str, str], message: str) -> None:
    own = {"subject": "01", "hand": known.made.hand, "task": "opposition"} | words
    with pytest.raises(InputError, match=message):
        shukotsu.pose(known.plan.folder.parent, **own)
