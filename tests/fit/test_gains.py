"""Predicted gains of one more measurement, checked by fits that use it."""

import numpy as np
import pytest
from simulated_poses import fitted, recorded
from small_study import Row

from shukotsu.fit.fingertips import fingertips
from shukotsu.fit.fit import FitSettings, HandFit, fit_hand
from shukotsu.fit.gains import DEEP_SD_MM, MEASURED_SD_MM, gains
from shukotsu.fit.measurements import Measurement
from shukotsu.simulate.random_hand import BONES
from shukotsu.study.layout import read_layout

QUICK = FitSettings(n_frames=60, rounds=1)


@pytest.fixture(scope="module")
def gained() -> dict[str, Row]:
    return {gain["quantity"]: gain for gain in gains(fingertips(fitted()))}


def sds(fit: HandFit) -> dict[str, float]:
    return {name: joint.sd_mm for name, joint in fit.joints.items()}


def test_every_possible_measurement_is_ranked_by_its_gain(gained: dict[str, Row]) -> None:
    model, order = fitted().model, [*gained.values()]
    assert {*model.length, *(f"{segment}.height" for segment in model.mount)} <= set(gained)
    assert len(gained) == 19 + 3 * 16 + 15 + 5
    after = [gain["mean_sd_after_mm"] for gain in order]
    assert after == sorted(after)
    now = sds(fitted())
    for gain in order:
        assert gain["mean_sd_before_mm"] == pytest.approx(np.mean(list(now.values())))
        assert gain["joint_sd_before_mm"] == pytest.approx(now[gain["joint"]])
        assert 0 < gain["joint_sd_after_mm"] < gain["joint_sd_before_mm"]
    for deep in ("hand.along", "index_metacarpal", "thumb_metacarpal.along"):
        assert gained[deep]["sd_mm"] == DEEP_SD_MM
    assert gained["thumb_metacarpal.distal"]["sd_mm"] == MEASURED_SD_MM
    assert gained["index_middle"]["sd_mm"] < gained["index_distal"]["sd_mm"] < DEEP_SD_MM


@pytest.mark.parametrize(
    "quantity",
    [
        "middle_proximal.lateral",
        pytest.param("ring_middle", marks=pytest.mark.slow),
        pytest.param("index_middle.distal", marks=pytest.mark.slow),
    ],
)
def test_a_gain_equals_that_of_a_fit_with_the_measurement(gained: dict[str, Row], quantity: str) -> None:
    """The predicted sds of the most improved joint and of all joints on average are those of a fit that is
    given the true value as a measurement.
    """
    drawn, poses = recorded(seed=4, n_frames=1600)
    gain = gained[quantity]
    segment, _, part = quantity.partition(".")
    length_mm = drawn.truth.hand.length_mm[BONES.index(segment)]
    place_mm = drawn.truth.mounts.position_mm[drawn.segments.index(segment)]
    value = {"": length_mm, "lateral": place_mm[1], "distal": length_mm - place_mm[0]}[part]
    anew = fit_hand(
        [poses],
        read_layout("liberty16"),
        "right",
        measurements=[Measurement(quantity, float(value), gain["sd_mm"])],
        settings=QUICK,
    )
    now = sds(anew)
    assert now[gain["joint"]] == pytest.approx(gain["joint_sd_after_mm"], rel=0.05)
    assert np.mean(list(now.values())) == pytest.approx(gain["mean_sd_after_mm"], rel=0.05)
    spared = gain["joint_sd_before_mm"] - now[gain["joint"]]
    assert spared > 0.6 * (gain["joint_sd_before_mm"] - gain["joint_sd_after_mm"])
