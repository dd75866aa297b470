"""Wrist points, bones and posed metacarpals of a simulated hand under different models and layouts."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from chains import reader_of
from simulated_poses import recorded, write_poses
from small_study import HandResults, run_hand

from shukotsu.arrays import Array
from shukotsu.paper.hand import BuiltHand, build_hand, pose_metacarpals
from shukotsu.paper.skeleton import judge_hand
from shukotsu.study.layout import Layout, read_layout
from shukotsu.study.model import SkeletonModel, read_model
from shukotsu.study.recording_summary import OF_A_MODEL, _joint_problems
from shukotsu.study.verdict import BELIEVE, TOO_CLOSE, doubts_of
from shukotsu.tables.catalogue import JOINT_CENTRES
from shukotsu.tables.poses import Poses, read_poses
from shukotsu.tables.typed_table import read_table, rows_of

Build = Callable[..., BuiltHand]


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandResults:
    folder = tmp_path_factory.mktemp("hand")
    simulated = recorded("right", "rom", seed=5, n_frames=600, forearm=True)[0]
    poses = write_poses(folder / "poses.parquet", simulated, "right", "rom")
    return run_hand(poses, "paper-fig4", folder)


@pytest.fixture(scope="module")
def build(hand: HandResults) -> Build:
    """Return a function that builds the hand from its projected joints under another model or layout."""
    projected = read_table(hand.folder / "projected_joints.parquet", JOINT_CENTRES)
    rows = {row["joint"]: row for row in rows_of(projected)}

    def built(model: SkeletonModel, layout: Layout | None = None, without: tuple[str, ...] = ()) -> BuiltHand:
        layout = layout or read_layout("liberty16")
        poses: Poses = read_poses(hand.path("poses"), layout.measured)
        kept = {name: row for name, row in rows.items() if name not in without}
        return build_hand(kept, layout, model, reader_of(poses))

    return built


def wrist_of(built: BuiltHand) -> dict[str, object]:
    return next(row for row in built.joints if row["joint"] == "wrist")


def point(row: dict[str, object]) -> Array:
    return np.array([row[f"child_{axis}_mm"] for axis in "xyz"], float)


def with_point(layout: Layout, mm: tuple[float, float, float]) -> Layout:
    assert layout.wrist is not None
    return replace(layout, wrist=replace(layout.wrist, point_mm=mm))


def test_an_automatic_wrist_uses_the_best_available_source(build: Build) -> None:
    """It is the joint to the forearm, else the configured point, else the estimated point."""
    model, layout = read_model("paper-fig4"), read_layout("liberty16")
    configuring = with_point(layout, (-40.0, 1.0, -12.0))
    assert wrist_of(build(model, configuring))["source"] == "fit"
    assert wrist_of(build(model, configuring))["parent_segment"] == "forearm"
    configured = wrist_of(build(model, configuring, without=("wrist",)))
    assert configured["source"] == "configured point"
    np.testing.assert_array_equal(point(configured), [-40, 1, -12])
    estimated = wrist_of(build(model, layout, without=("wrist",)))
    assert estimated["source"] == "estimated point"
    assert estimated["parent_segment"] == ""
    assert np.linalg.norm(point(estimated) - [-35, 0, -14]) < 40


def test_bones_run_between_the_points_that_the_model_names(build: Build) -> None:
    """The thumb metacarpal starts at the CMC joint in Fig. 4 and at the wrist in Fig. 3, where it is
    longer.
    """
    bones = {
        name: {row["bone"]: row for row in build(read_model(name)).bones}
        for name in ("paper-fig3-rest", "paper-fig3", "paper-fig4", "rigid")
    }
    thumbs = {model: by_bone["thumb_metacarpal"] for model, by_bone in bones.items()}
    assert thumbs["paper-fig3"]["length_mm"] > thumbs["paper-fig4"]["length_mm"] + 10
    assert thumbs["paper-fig3-rest"]["driven_by"] == "thumb_metacarpal"
    assert thumbs["paper-fig3"]["driven_by"] == ""
    assert bones["rigid"]["index_metacarpal"]["driven_by"] == "hand"
    assert (thumbs["paper-fig3"]["starts_at"], thumbs["paper-fig3"]["ends_at"]) == ("wrist", "thumb_mcp")
    assert (thumbs["paper-fig4"]["starts_at"], thumbs["paper-fig4"]["ends_at"]) == ("thumb_cmc", "thumb_mcp")
    last = bones["rigid"]["index_distal"]
    assert (last["starts_at"], last["ends_at"]) == ("index_dip", "distal receiver")
    for by_bone in bones.values():
        for name, bone in by_bone.items():
            assert bone["sd_mm"] > 0, name
            if bone["x_mm"] is not None:
                length = np.linalg.norm([bone[f"{axis}_mm"] for axis in "xyz"])
                assert bone["length_mm"] == pytest.approx(length)


def test_metacarpals_are_empty_and_flagged_where_a_receiver_is_lost(build: Build, hand: HandResults) -> None:
    """Only the frames without a receiver that the digit's posture needs are affected."""
    layout, model = read_layout("liberty16"), read_model("paper-fig4")
    poses = read_poses(hand.path("poses"), layout.measured)
    valid = poses.valid.copy()
    valid[:9, poses.index("hand")] = False
    valid[20:25, poses.index("index_proximal")] = False
    with_gaps = replace(poses, valid=valid)
    posed = pose_metacarpals(build(model), reader_of(with_gaps), lambda *_: None)
    columns = {digit_columns["digit"]: digit_columns for digit_columns in posed}
    lost = {"index": [*range(9), *range(20, 25)], "ring": [*range(9)]}
    for digit, frames in lost.items():
        flags = columns[digit]["flags"].to_numpy(zero_copy_only=False).astype(str)
        assert np.flatnonzero(np.char.find(flags, "gap") >= 0).tolist() == frames
        assert np.flatnonzero(np.isnan(columns[digit]["qw"])).tolist() == frames


def test_knuckles_closer_than_in_any_hand_are_doubted(build: Build) -> None:
    """No knuckle of this hand is; with the ring MCP 4 mm beside the middle MCP both are doubted and
    reported.
    """
    layout = read_layout("liberty16")
    built = build(read_model("paper-fig4"))
    assert TOO_CLOSE not in "".join(row["reason_values"] for row in judge_hand(built, layout, {}).joints)
    rows = {row["joint"]: row for row in built.joints}
    moved = {f"parent_{a}_mm": rows["middle_mcp"][f"parent_{a}_mm"] + 4.0 * (a == "y") for a in "xyz"}
    near = replace(built, joints=[*(rows | {"ring_mcp": rows["ring_mcp"] | moved}).values()])
    doubted = {
        row["joint"]: row for row in judge_hand(near, layout, {}).joints if TOO_CLOSE in doubts_of(row)
    }
    assert set(doubted) == {"middle_mcp", "ring_mcp"}
    assert all(row["verdict"] != BELIEVE for row in doubted.values())
    keys = dict.fromkeys(OF_A_MODEL, "a")
    noted = [{**keys, "reason_values": row["reason_values"]} for row in doubted.values()]
    problems = _joint_problems(pa.Table.from_pylist(noted), {})
    assert [problem["kind"] for problem in problems] == [TOO_CLOSE] * 2
