"""The interface for notebooks: tables with units, posed recordings, and hands at given joint angles."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from simulated_hands import FITTED, REPLAYED, SimulatedHand, simulated_hand

import shukotsu
from shukotsu.errors import InputError
from shukotsu.hand.joint_angles import joint_angles
from shukotsu.hand.posed_recording import recording_reader
from shukotsu.tables.catalogue import JOINT_CENTRES
from shukotsu.tables.typed_table import column_array, read_table


@pytest.fixture(scope="module", params=["right", "left"])
def study(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> SimulatedHand:
    return simulated_hand(tmp_path_factory.mktemp("study"), request.param)


def test_importing_the_package_imports_no_large_package() -> None:
    heavy = "{'numpy', 'pandas', 'pyarrow', 'matplotlib', 'xarray'}"
    look = f"import shukotsu, sys; sys.exit(str({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "set()"
    with pytest.raises(AttributeError, match="no 'raed'; it has PosedRecording, bend, pose, read"):
        shukotsu.raed  # noqa: B018


def test_a_table_is_read_with_units_and_gaps(study: SimulatedHand) -> None:
    path = study.path(REPLAYED, JOINT_CENTRES)
    frame, table = shukotsu.read(str(path)), read_table(path, JOINT_CENTRES)
    assert list(frame.columns) == table.column_names
    assert len(frame) == table.num_rows > 0
    np.testing.assert_array_equal(frame["child_x_mm"], column_array(table, "child_x_mm"))
    assert frame["parent_x_mm"].isna().sum() == table.column("parent_x_mm").null_count > 0
    assert frame.attrs["table"] == "joint_centres"
    assert frame.attrs["key"] == list(JOINT_CENTRES.key)
    assert frame.attrs["units"]["child_x_mm"] == "mm"
    assert frame.attrs["descriptions"].keys() == set(frame.columns)


def test_a_folder_is_read_as_joined_tables_with_factors(study: SimulatedHand, tmp_path: Path) -> None:
    """Two subjects are in two groups; factors of recordings appear only in tables with rows per recording."""
    table = pq.read_table(study.path(REPLAYED, JOINT_CENTRES))
    plan = json.loads(study.plan_path.read_text("utf-8"))
    for subject, group in (("01", "piano"), ("02", "none")):
        folder = tmp_path / f"sub-{subject}"
        folder.mkdir()
        own = table.set_column(0, table.field(0), pa.array([subject] * len(table)).cast(table.field(0).type))
        pq.write_table(own, folder / "joint_centres.parquet")
        recordings = [entry | {"factors": {"tempo": "slow"}} for entry in plan["recordings"]]
        levels = {"subject": subject, "factors": {"group": group}, "recordings": recordings}
        (folder / "plan.json").write_text(json.dumps(plan | levels), "utf-8")
    tables = shukotsu.read(tmp_path)
    assert list(tables) == ["joint_centres"]
    frame = tables["joint_centres"]
    whole = sum(name == "" for name in table.column("made_without").to_pylist())
    assert frame.groupby("subject")["group"].agg(["first", "size"]).values.tolist() == [
        ["piano", whole],
        ["none", whole],
    ]
    assert "tempo" not in frame  # a joint has no recording
    assert frame.attrs["units"]["child_x_mm"] == "mm"
    assert tables._recordings[0]["tempo"] == "slow"
    with pytest.raises(InputError, match=r"has no table 'joint_centers'; did you mean 'joint_centres'"):
        tables["joint_centers"]
    with pytest.raises(InputError, match="has no results of a study"):
        shukotsu.read(tmp_path / "sub-01")


@pytest.mark.parametrize("model", [FITTED, REPLAYED])
def test_a_hand_is_posed_as_by_the_pipeline(study: SimulatedHand, model: str) -> None:
    hand = shukotsu.pose(study.plan.folder.parent, "01", study.simulated.name.hand, "opposition", model=model)
    bones = recording_reader(study.plan, study.recording, model).bones(study.poses())
    assert hand.names == bones.names
    np.testing.assert_array_equal(hand.position_mm, bones.position_mm)
    np.testing.assert_array_equal(hand.frame, study.simulated.frame)
    assert np.isfinite(hand.time_s).all()


def test_a_posed_hand_converts_to_xarray_with_names_and_units(
    posed: shukotsu.PosedRecording, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = posed.to_xarray()
    assert dict(data.position.sizes) == {"time": len(posed.frame), "bone": len(posed.names), "space": 3}
    tip = data.position.sel(bone="index_tip", space="z")
    np.testing.assert_array_equal(tip, posed.position_mm[:, posed.index("index_tip"), 2])
    turn = data.rotation.sel(bone="index_mcp", quaternion="w")
    np.testing.assert_array_equal(turn, posed.quaternion[:, posed.index("index_mcp"), 0])
    np.testing.assert_array_equal(data.time, posed.time_s)
    assert (data.position.units, data.time.units, round(data.fs)) == ("mm", "s", 240)
    assert str(data.parent.sel(bone="index_pip").item()) == "index_mcp"
    assert data.source_software.startswith("shukotsu ")
    bent = shukotsu.bend(posed, {"index_pip": np.zeros((4, 3))}).to_xarray()
    assert (bent.time.units, bent.time.values.tolist()) == ("frames", [0, 1, 2, 3])
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"pip install shukotsu\[xarray\]"):
        posed.to_xarray()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"subject": "02"}, "run the study to write the subject's plan"),
        ({"task": "scales"}, "subject 01 has no recording .* scales; expected one of .* opposition"),
        ({"model": "whole_hand"}, "model 'whole_hand' is not in study test; did you mean 'whole-hand'"),
    ],
)
def test_unknown_subjects_tasks_and_models_are_refused(
    study: SimulatedHand, words: dict[str, str], message: str
) -> None:
    which = {"subject": "01", "hand": study.simulated.name.hand, "task": "opposition"} | words
    with pytest.raises(InputError, match=message):
        shukotsu.pose(study.plan.folder.parent, **which)


ANGLES = {"index_mcp": (60.0, 8.0, -5.0), "index_pip": (80.0, 0.0, 0.0), "thumb_mcp": (20.0, -6.0, 4.0)}


@pytest.fixture(scope="module")
def posed(study: SimulatedHand) -> shukotsu.PosedRecording:
    return shukotsu.pose(study.plan.folder.parent, "01", study.simulated.name.hand, "opposition")


def angles_in(posed: shukotsu.PosedRecording, joint: str) -> np.ndarray:
    """Return the joint angles (T, 3) of a posed hand in deg."""
    child = posed.index(joint)
    bones = posed.quaternion[:, posed.parents[child]], posed.quaternion[:, child]
    return joint_angles(*bones, posed.hand, posed.neutral[child])


def test_a_bent_hand_has_the_requested_angles(posed: shukotsu.PosedRecording) -> None:
    bent = shukotsu.bend(posed, ANGLES)
    for joint in ("index_mcp", "index_pip", "thumb_mcp", "ring_pip"):
        expected = ANGLES.get(joint, (0.0, 0.0, 0.0))
        np.testing.assert_allclose(angles_in(bent, joint), [expected], atol=1e-6)


def test_a_flexed_finger_moves_to_the_palm(posed: shukotsu.PosedRecording) -> None:
    tip = posed.index("index_tip")
    straight, flexed = (shukotsu.bend(posed, {"index_mcp": angle}).position_mm[0, tip] for angle in (0, 80))
    assert flexed[2] < straight[2] - 40  # dorsal
    assert flexed[0] < straight[0] - 40  # distal


def test_bending_by_the_recordings_angles_gives_its_fingers(posed: shukotsu.PosedRecording) -> None:
    moving = ("index_mcp", "index_pip", "index_dip")
    bent = shukotsu.bend(posed, {joint: angles_in(posed, joint) for joint in moving})
    base = posed.index("index_mcp")
    for joint in ("index_pip", "index_dip", "index_tip"):
        index = posed.index(joint)
        far, again = (
            np.linalg.norm(h.position_mm[:, index] - h.position_mm[:, base], axis=-1) for h in (posed, bent)
        )
        np.testing.assert_allclose(again, far, atol=0.05)  # joints glide as they bend
    assert len(bent.frame) == len(posed.frame)
    assert np.isnan(bent.time_s).all()


@pytest.mark.parametrize(
    ("angles", "message"),
    [
        ({"index_mpc": 5}, "the hand has no joint 'index_mpc'; did you mean 'index_mcp'"),
        ({"index_mcp": (1, 2)}, "index_mcp: angles of shape"),
        ({"index_mcp": np.zeros((3, 3)), "ring_mcp": np.zeros((4, 3))}, "angles over 3 frames and 4 frames"),
    ],
)
def test_angles_of_unknown_joints_or_wrong_shapes_are_refused(
    posed: shukotsu.PosedRecording, angles: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        shukotsu.bend(posed, angles)
