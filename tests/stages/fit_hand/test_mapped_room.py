"""Centres are stated less certain by what a room's map says, and by no more."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_poses import hand_of

from shukotsu.schemas.catalogue import ROOM_MAP
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.tables import Provenance, write_table
from shukotsu.stages.fit_hand.fit import HandFit, Settings, fit_hand
from shukotsu.stages.fit_hand.mapped_room import MappedRoom, widened


@pytest.fixture(scope="module")
def fit(layout: Layout) -> HandFit:
    return fit_hand([hand_of(7).poses], layout, "right", settings=Settings(30, 10, 1))


def room(mm: float, deg: float, *, trusted: bool, reach_mm: float = 4000.0) -> MappedRoom:
    """A room that is alike everywhere."""
    at = np.zeros((1, 3))
    return MappedRoom(at, np.array([[mm, deg]]), np.array([float(trusted)]), reach_mm, 10.0)


def test_where_the_tracker_is_good_nothing_changes(fit: HandFit) -> None:
    same, said = widened(fit, room(0.05, 0.05, trusted=True))
    assert said == ""
    for name, joint in fit.joints.items():
        np.testing.assert_allclose(same.joints[name].covariance_mm2, joint.covariance_mm2, atol=1e-4)


def test_both_halves_grow_by_what_both_receivers_are_off(fit: HandFit) -> None:
    wide, said = widened(fit, room(3.0, 4.0, trusted=False))
    assert "off by 3.0 mm and 4.0 deg: 100 % of the poses are outside" in said
    assert "0 % where the wand was not" in said
    own, grown = fit.joints["index_pip"], wide.joints["index_pip"]
    added = 0.0
    for segment, centre in ((own.parent_segment, own.parent_mm), (own.child_segment, own.child_mm)):
        covered_mm, covered_deg = fit.residual_rms[segment]
        added += 9.0 - 3 * covered_mm**2 + (16.0 - 3 * covered_deg**2) * (np.radians(centre) ** 2).sum()
    difference = grown.covariance_mm2 - own.covariance_mm2
    np.testing.assert_allclose(difference, np.eye(6) * added / 3, atol=1e-9)
    assert grown.sd_mm == pytest.approx(np.hypot(own.sd_mm, added**0.5), rel=0.02)
    near = widened(fit, replace(room(3.0, 4.0, trusted=False), bar_mm=1000.0))[0].joints["index_pip"]
    assert own.sd_mm < near.sd_mm < own.sd_mm + 0.02, "receivers 40 mm apart hardly differ"


def test_where_the_wand_was_not_the_nearest_place_speaks(fit: HandFit) -> None:
    wide, said = widened(fit, room(3.0, 4.0, trusted=True, reach_mm=50.0))
    assert "100 % where the wand was not" in said
    assert wide.joints["index_pip"].sd_mm > fit.joints["index_pip"].sd_mm + 1.0


def test_a_written_map_is_read_without_cells_that_lack_data(tmp_path: Path) -> None:
    numbers = {name: [1.0, np.nan] for name in ("error_mm", "error_deg", "error_sd_mm", "error_sd_deg")}
    numbers |= {"noise_mm": [0.1, np.nan], "noise_deg": [0.1, np.nan], "n_frames": [99, 0]}
    places = {"x_mm": [25.0, 75.0], "y_mm": [25.0, 25.0], "z_mm": [25.0, 25.0]}
    sizes = {"cell_mm": [50.0, 50.0], "bar_mm": [100.0, 100.0], "trusted": [True, False]}
    write_table(tmp_path / "room.parquet", ROOM_MAP, numbers | places | sizes, Provenance())
    own = MappedRoom.read(tmp_path / "room.parquet")
    assert own.at(np.array([[30.0, 20.0, 20.0], [80.0, 20.0, 20.0]])).tolist() == [[1, 1, 1, 1], [1, 1, 0, 0]]
