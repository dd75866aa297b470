"""What notebooks get: tables with their units, posed hands wherever the results are."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand, make_hand

import shukotsu
from schemas.catalogue import JOINT_CENTRES, METACARPALS
from schemas.errors import InputError
from schemas.tables import Provenance, column_array, read_table, write_table
from skeleton.posed_recording import posed_bones


@pytest.fixture(scope="module", params=["right", "left"])
def known(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    return make_hand(tmp_path_factory.mktemp("study"), request.param)


@pytest.fixture
def posed(known: KnownHand) -> shukotsu.PosedHand:
    return shukotsu.pose(known.plan.folder.parent, "01", known.made.hand, "opposition")


def test_importing_it_imports_nothing_heavy() -> None:
    look = (
        "import shukotsu, sys; sys.exit(str({'numpy', 'pandas', 'pyarrow', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "set()"


def test_a_name_that_is_not_there_is_told() -> None:
    with pytest.raises(AttributeError, match="no 'raed'; it has PosedHand, bend, plot_hand, pose, read"):
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


def test_integers_that_may_be_missing_stay_integers(tmp_path: Path) -> None:
    from schemas.catalogue import CAPTURE_RECORDS

    columns = {c.name: [None, None] if c.nullable else [1, 2] for c in CAPTURE_RECORDS.columns}
    columns |= {"button": [None, 1], "device_ms": [7, None]}
    write_table(tmp_path / "records.parquet", CAPTURE_RECORDS, columns, Provenance())
    frame = shukotsu.read(tmp_path / "records.parquet")
    assert frame["button"].dtype == pd.Int8Dtype()
    assert frame["device_ms"].tolist() == [7, pd.NA]
    assert frame["frame"].dtype.kind == "i"


def test_a_damaged_table_is_refused_as_a_stage_refuses_it(known: KnownHand, tmp_path: Path) -> None:
    file = tmp_path / "joint_centres.parquet"
    whole = known.path(REPLAYED, JOINT_CENTRES).read_bytes()
    file.write_bytes(whole[:200] + bytes([whole[200] ^ 1]) + whole[201:])
    with pytest.raises(InputError) as stage:
        read_table(file, JOINT_CENTRES)
    with pytest.raises(InputError) as own:
        shukotsu.read(file)
    assert str(own.value) == str(stage.value)


def test_a_table_of_another_program_is_refused(tmp_path: Path) -> None:
    pd.DataFrame({"a": [1]}).to_parquet(tmp_path / "other.parquet")
    with pytest.raises(InputError, match="a Parquet file, but not one that shukotsu wrote"):
        shukotsu.read(tmp_path / "other.parquet")


@pytest.mark.parametrize("model", [FITTED, REPLAYED])
def test_a_hand_is_posed_as_the_pipeline_poses_it(known: KnownHand, model: str) -> None:
    hand = shukotsu.pose(known.plan.folder.parent, "01", known.made.hand, "opposition", model=model)
    bones = posed_bones(known.plan, known.recording, model, known.poses())
    assert hand.joints == bones.names
    np.testing.assert_array_equal(hand.position_mm, bones.position_mm)
    np.testing.assert_array_equal(hand.frame, known.made.frame)
    assert np.isfinite(hand.time_s).all()


def test_results_that_were_moved_are_posed_as_well(
    known: KnownHand, posed: shukotsu.PosedHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(known.plan.folder.parent, tmp_path / "elsewhere")
    monkeypatch.chdir(tmp_path)
    moved = shukotsu.pose("elsewhere", "01", known.made.hand, "opposition")
    np.testing.assert_array_equal(moved.position_mm, posed.position_mm)


def test_in_the_hand_the_root_is_at_rest(posed: shukotsu.PosedHand) -> None:
    places = posed.in_hand_mm()
    np.testing.assert_allclose(places[:, 0], 0.0, atol=1e-9)
    apart = np.linalg.norm(posed.position_mm - posed.position_mm[:, :1], axis=-1)
    np.testing.assert_allclose(np.linalg.norm(places, axis=-1), apart, atol=1e-9)
    assert (np.nanmedian(places[:, posed.index("middle_mcp")], 0)[0]) > 40  # distal


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


def test_a_recording_that_is_excluded_is_told(known: KnownHand, tmp_path: Path) -> None:
    shutil.copytree(known.plan.folder.parent, tmp_path / "made")
    plan = tmp_path / "made" / "sub-01" / "plan.json"
    plan.write_text(plan.read_text().replace('"exclude": ""', '"exclude": "a loose receiver"'))
    with pytest.raises(InputError, match=r"is excluded \(a loose receiver\)"):
        shukotsu.pose(tmp_path / "made", "01", known.made.hand, "opposition")


def test_a_table_that_is_not_there_is_told(known: KnownHand, tmp_path: Path) -> None:
    shutil.copytree(known.plan.folder.parent, tmp_path / "made")
    (tmp_path / "made" / "sub-01" / f"{METACARPALS.name}.parquet").unlink()
    with pytest.raises(InputError, match=r"metacarpals\.parquet"):
        shukotsu.pose(tmp_path / "made", "01", known.made.hand, "opposition", model=REPLAYED)
