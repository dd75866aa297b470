"""A joint's and a bone's errors with numbers that can be checked by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.schemas.poses import RecordingName
from shukotsu.stages.evaluate_skeletons.scored_skeleton import Stated
from shukotsu.stages.evaluate_skeletons.truth import Truth, centre_errors, truth_for

Row = dict[str, Any]


def centre(joint: str, child: tuple[float, ...], parent: tuple[float, ...], **other: Any) -> Row:
    row: Row = {"joint": joint, "status": "ok", "dof": 1, "sd_mm": None, "parent_segment": "x"}
    row["n_frames"] = 100
    axes = {"axis_child_": (0.0, 1.0, 0.0), "axis_parent_": (0.0, 1.0, 0.0)}
    for prefix, values in {"child_": child, "parent_": parent}.items():
        row |= {f"{prefix}{axis}_mm": value for axis, value in zip("xyz", values, strict=True)}
    for prefix, values in axes.items():
        row |= {f"{prefix}{axis}": value for axis, value in zip("xyz", values, strict=True)}
    return row | other


def truth_of(task: str, *joints: Row, **length_mm: float) -> Truth:
    bones = {bone: {"length_mm": value} for bone, value in length_mm.items()}
    stated = Stated({row["joint"]: row for row in joints}, bones)
    return Truth(Path(task), RecordingName("01", "right", task), stated)


def test_a_centre_along_and_across_its_axis() -> None:
    """Off by (3, -4, 0) with the true axis along y: 5 in all, 4 along, 3 across; the parent's half by 6."""
    true = centre("index_pip", (1, 1, 1), (0, 0, 0))
    tilted = {"axis_child_x": 0.0, "axis_child_y": -np.cos(0.2), "axis_child_z": np.sin(0.2)}
    found = centre_errors(centre("index_pip", (4, -3, 1), (0, 0, 6), sd_mm=3.8, **tilted), true)
    assert found["error_mm"] == pytest.approx(5.0)
    assert found["along_mm"] == pytest.approx(4.0)
    assert found["across_mm"] == pytest.approx(3.0)
    assert found["parent_error_mm"] == pytest.approx(6.0)
    assert found["axis_deg"] == pytest.approx(np.degrees(0.2))
    assert (found["sd_mm"], found["within_95"]) == (3.8, True)


def test_the_truth_is_where_centres_were_in_the_recordings_that_calibrated() -> None:
    """Each frame counts alike, 300 against 100; without a truth of its own a skeleton is held against all."""
    turned = {"axis_child_x": 1.0, "axis_child_y": 0.0}
    rom = truth_of("rom", centre("index_pip", (1, 0, 0), (0, 0, 0), n_frames=300), index_middle=25.0)
    grasp = truth_of("grasp", centre("index_pip", (5, 0, 0), (0, 0, 8), **turned), index_middle=25.0)
    tap = truth_of("tap", centre("index_pip", (90, 0, 0), (0, 0, 0)), index_middle=25.0)

    def true(*tasks: str, of: tuple[Truth, ...] = (rom, grasp, tap)) -> Row:
        found = truth_for(tasks, of)
        assert found is not None
        assert found.bones["index_middle"]["length_mm"] == 25.0
        return dict(found.joints["index_pip"])

    assert [true("grasp", "other")[f"child_{axis}_mm"] for axis in "xyz"] == [5.0, 0.0, 0.0]
    both = true("rom", "grasp")
    assert (both["child_x_mm"], both["parent_z_mm"]) == (2.0, 2.0)
    axis = np.array([both[f"axis_child_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(axis, np.array([1.0, 3.0, 0.0]) / np.sqrt(10.0))
    assert true("other", of=(rom, grasp)) == both
    assert truth_for(["rom"], []) is None
