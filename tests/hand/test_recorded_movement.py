"""Unwrapping a recording's angles, their ranges, and the number of effective samples."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shukotsu.hand.recorded_movement import RecordedMovement, assumed_angles, running_on
from shukotsu.hand.series import angle_range, effective_samples, flattening
from shukotsu.study.layout import read_layout
from shukotsu.study.model import read_model

TIME_S = np.arange(2400) / 240


def wrapped(angle_deg: np.ndarray) -> np.ndarray:
    """Return angles wrapped to (-180, 180], as in the tables."""
    return 180.0 - np.mod(180.0 - angle_deg, 360.0)


@pytest.mark.parametrize("middle_deg", [170.0, -175.0, 180.0, 60.0])
def test_an_angle_beyond_half_a_turn_is_unwrapped(middle_deg: float) -> None:
    true_deg = middle_deg + 40.0 * np.sin(2 * np.pi * TIME_S) + 0.3
    unwrapped = running_on(np.column_stack([wrapped(true_deg), 30.0 * np.cos(TIME_S)]))
    turns = (unwrapped[:, 0] - true_deg) / 360.0
    assert turns == pytest.approx(np.full(len(TIME_S), np.round(turns[0])), abs=1e-9)
    assert abs(np.median(unwrapped[:, 0])) <= 181.0
    assert unwrapped[:, 1] == pytest.approx(30.0 * np.cos(TIME_S))


def test_gaps_stay_and_do_not_add_turns() -> None:
    true_deg = 175.0 + 30.0 * np.sin(2 * np.pi * TIME_S)
    gapped = wrapped(true_deg)
    gapped[100:900] = np.nan
    unwrapped = running_on(np.column_stack([gapped, np.full(len(TIME_S), np.nan)]))
    assert np.isnan(unwrapped[100:900, 0]).all()
    assert np.isnan(unwrapped[:, 1]).all()
    assert np.nanmax(unwrapped[:, 0]) - np.nanmin(unwrapped[:, 0]) == pytest.approx(60.0, abs=0.1)


def test_angles_within_half_a_turn_are_unchanged() -> None:
    angle_deg = np.linspace(-110.0, 120.0, 500)[:, None]
    assert running_on(angle_deg) is angle_deg
    assert running_on(np.empty((0, 3))).shape == (0, 3)


def test_few_bad_frames_do_not_change_the_range() -> None:
    angle = np.linspace(0.0, 100.0, 1001)
    assert angle_range(angle) == pytest.approx(95.0)
    assert angle_range(np.append(angle, [500.0] * 10)) == pytest.approx(95.0, abs=1.0)


def test_weighting_postures_keeps_the_range_of_a_mostly_resting_joint() -> None:
    angle = np.concatenate([np.zeros(9000), np.linspace(0.0, 1.0, 1000)])
    assert angle_range(angle) < 0.8
    assert angle_range(angle, flattening(angle)) == pytest.approx(0.95, abs=0.03)


@pytest.mark.parametrize("waves", [0.5, 1.5, 20.0])
def test_effective_samples_equal_the_sum_of_autocovariances(waves: float) -> None:
    """The series are slow or fast, so that their autocovariance crosses zero late or early."""
    rng = np.random.default_rng(2)
    series = np.cos(np.linspace(0, 2 * np.pi * waves, 401))[:, None] + 0.1 * rng.normal(size=(401, 2))
    centred = series - series.mean(0)
    lags = [np.sum(centred[: 401 - lag] * centred[lag:]) / 401 for lag in range(401)]
    crossing = next(lag for lag, value in enumerate(lags) if value <= 0)
    assert (crossing > 401 // 8) == (waves < 2)
    expected = 2.0 / ((2 * sum(lags[:crossing]) - lags[0]) / 401)
    assert effective_samples(series, 2.0, 10**9) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("model", ["rigid", "paper-fig3-rest", "paper-fig4"])
def test_a_digit_of_a_single_joint_has_angles_under_every_model(model: str) -> None:
    layout = read_layout("liberty16")
    index = layout.digits["index"]
    short = replace(index, joints=index.joints[3:], segments=index.segments[3:], metacarpal=False)
    reader: Any = SimpleNamespace(
        is_fitted=False,
        layout=replace(layout, digits={"index": short}),
        model=read_model(model),
        unmeasured=lambda _: "",
        unbelieved=lambda *_: "",
        skeleton=SimpleNamespace(joints={}),
    )
    angles = {"index_dip": np.zeros((5, 3, 1))}
    movement = RecordedMovement(reader, np.arange(5), np.arange(5) / 240, {}, {}, _angles_deg=angles)
    assert [series.angle for series in movement.joints()] == ["flexion", "abduction", "rotation"]


@pytest.mark.parametrize(
    ("model", "kinds"), [("rigid", ["cmc"]), ("paper-fig3-rest", ["cmc", "mcp"]), ("paper-fig4", [])]
)
def test_angles_at_metacarpals_that_a_model_keeps_still_are_assumed(model: str, kinds: list[str]) -> None:
    """The thumb's metacarpal carries a receiver."""
    layout = read_layout("liberty16")
    reader: Any = SimpleNamespace(is_fitted=False, layout=layout, model=read_model(model))
    fingers = "index", "middle", "ring", "little"
    assert {*assumed_angles(reader)} == {f"{finger}_{kind}" for finger in fingers for kind in kinds}
