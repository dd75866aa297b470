"""Wrist points and bones of a simulated hand under every way that a model or layout can ask for them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pipeline import HandResults, import_recording, run_hand

from kinematics.rotations import Array
from schemas.catalogue import JOINT_CENTRES
from schemas.config_files import CONFIG_FOLDER
from schemas.layout import Layout, read_layout
from schemas.model import SkeletonModel, read_model
from schemas.poses import Poses, read_poses
from schemas.tables import read_table, rows_of
from stages.estimate_metacarpals.hand import BuiltHand, build_hand
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate

Build = Callable[..., BuiltHand]


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> HandResults:
    """A realistic hand with a forearm receiver, run once."""
    folder = tmp_path_factory.mktemp("hand")
    write_recording(
        folder / "r.parquet", simulate("01", "right", "rom", 5, Realism.full(), 600, forearm=True)
    )
    poses = import_recording(folder / "r.parquet", folder / "poses.parquet")
    return run_hand(poses, poses, "paper-fig4", folder)


@pytest.fixture(scope="module")
def build(hand: HandResults) -> Build:
    """Build that hand under another model or layout, from its projected joints."""
    projected = read_table(hand.folder / "projected_joints.parquet", JOINT_CENTRES)
    rows = {row["joint"]: row for row in rows_of(projected)}

    def built(model: SkeletonModel, layout: Layout | None = None, without: tuple[str, ...] = ()) -> BuiltHand:
        layout = layout or read_layout("liberty16")
        poses: Poses = read_poses(hand.path("poses"), layout.measured)
        kept = {name: row for name, row in rows.items() if name not in without}
        return build_hand(kept, layout, model, [poses])

    return built


def wrist_of(built: BuiltHand) -> dict[str, object]:
    return next(row for row in built.joints if row["joint"] == "wrist")


def point(row: dict[str, object]) -> Array:
    return np.array([row[f"child_{axis}_mm"] for axis in "xyz"], float)


def with_point(layout: Layout, mm: tuple[float, float, float]) -> Layout:
    assert layout.wrist is not None
    return replace(layout, wrist=replace(layout.wrist, point_mm=mm))


def test_auto_takes_the_first_that_there_is(build: Build) -> None:
    """The forearm's joint, else the configured point, else the estimated one."""
    model, layout = read_model("paper-fig4"), read_layout("liberty16")
    given = with_point(layout, (-40.0, 1.0, -12.0))
    assert wrist_of(build(model, given))["source"] == "fit"
    assert wrist_of(build(model, given))["parent_segment"] == "forearm"
    configured = wrist_of(build(model, given, without=("wrist",)))
    assert configured["source"] == "configured point"
    np.testing.assert_array_equal(point(configured), [-40, 1, -12])
    estimated = wrist_of(build(model, layout, without=("wrist",)))
    assert estimated["source"] == "estimated point"
    assert estimated["parent_segment"] == ""
    assert np.linalg.norm(point(estimated) - [-35, 0, -14]) < 40


@pytest.mark.parametrize(
    ("wanted", "source"),
    [("functional", "fit"), ("point", "configured point"), ("estimated", "estimated point")],
)
def test_a_model_can_ask_for_one(build: Build, wanted: str, source: str) -> None:
    model = replace(read_model("paper-fig4"), wrist=wanted)
    layout = with_point(read_layout("liberty16"), (-40.0, 1.0, -12.0))
    assert wrist_of(build(model, layout))["source"] == source


@pytest.mark.parametrize(("wanted", "says"), [("functional", "forearm"), ("point", "wrist.point_mm")])
def test_what_is_not_there_fails_in_words(build: Build, wanted: str, says: str) -> None:
    """Every digit that starts at the wrist then has bones without lengths that give the reason."""
    model = replace(read_model("paper-fig4"), wrist=wanted)
    built = build(model, without=("wrist",))
    assert wrist_of(built)["status"] == "failed"
    assert says in str(wrist_of(built)["message"])
    reasons = {row["bone"]: row["message"] for row in built.bones}
    assert says in reasons["index_proximal"]
    assert reasons["thumb_proximal"] == ""


def test_an_average_wrist_is_called_weak(build: Build) -> None:
    """Without a palm that moves enough, the estimated point says that the average hand decides."""
    wrist = wrist_of(build(replace(read_model("paper-fig4"), wrist="estimated")))
    assert wrist["status"] == ("weak" if float(str(wrist["sd_mm"])) > 5 else "ok")
    nothing = wrist_of(
        build(
            read_model("paper-fig4"),
            without=("wrist", "index_mcp", "middle_mcp", "ring_mcp", "little_mcp"),
        )
    )
    np.testing.assert_allclose(point(nothing), [-35, 0, -14])
    assert nothing["status"] == "weak"
    assert "average hand" in str(nothing["message"])


def test_bones_end_where_the_model_says(build: Build) -> None:
    """Thumb metacarpals: from its own CMC joint in Fig. 4, from the wrist in Fig. 3, which is longer."""
    bones = {
        name: {row["bone"]: row for row in build(read_model(name)).bones}
        for name in ("paper-fig3-rest", "paper-fig3", "paper-fig4", "rigid")
    }
    assert (
        bones["paper-fig3"]["thumb_metacarpal"]["length_mm"]
        > bones["paper-fig4"]["thumb_metacarpal"]["length_mm"] + 10
    )
    assert bones["paper-fig3-rest"]["thumb_metacarpal"]["driven_by"] == "thumb_metacarpal"
    assert bones["paper-fig3"]["thumb_metacarpal"]["driven_by"] == ""
    assert bones["rigid"]["index_metacarpal"]["driven_by"] == "hand"
    for by_bone in bones.values():
        for name, bone in by_bone.items():
            assert bone["sd_mm"] > 0, name
            if bone["x_mm"] is not None:
                length = np.linalg.norm([bone[f"{axis}_mm"] for axis in "xyz"])
                assert bone["length_mm"] == pytest.approx(length)


def test_own_cmc_of_an_unmeasured_metacarpal_is_refused(hand: HandResults, tmp_path: Path) -> None:
    """A finger's CMC joint carries no receiver, so no model can start there; one sentence says so."""
    text = (CONFIG_FOLDER / "models" / "paper-fig4.yaml").read_text("utf-8")
    (tmp_path / "wrong.yaml").write_text(
        text.replace("paper-fig4", "wrong").replace("[thumb_cmc]", "[thumb_cmc, index_cmc]")
    )
    with pytest.raises(AssertionError, match="estimate_metacarpals"):
        run_hand(hand.path("poses"), hand.path("poses"), str(tmp_path / "wrong.yaml"), tmp_path)
