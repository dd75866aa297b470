"""The map of a room with steel on one side: bad there, trusted away from it, unknown where nothing was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from wands import STEEL, TURN_DEG, bar

from shukotsu.checks.rigid_bar import Deviations
from shukotsu.checks.room_map import RoomMap, room_map, trusted_box
from shukotsu.errors import InputError


def test_errors_are_where_the_steel_is() -> None:
    room = room_map(own := bar(steel=True), Deviations.of(own))
    share = STEEL.share(room.centres_mm[room.known])
    for error, most in zip(room.error[:, room.known], (np.linalg.norm(STEEL.error), TURN_DEG), strict=True):
        assert np.corrcoef(error, share)[0, 1] > 0.7
        assert 0.3 * most < error[share > 0.7].mean() < most, "of differences, not of what both are off"
    assert room.trusted[room.known & (room.centres_mm[..., 0] < 250)].mean() > 0.9


def test_noise_is_no_error() -> None:
    room = room_map(own := bar(), Deviations.of(own))
    assert room.trusted.sum() == room.known.sum() > 200
    assert np.nanmedian(room.noise, axis=(1, 2, 3)) == pytest.approx([0.17, 0.10], rel=0.15)
    assert (np.nanmedian(room.error, axis=(1, 2, 3)) < [0.05, 0.03]).all()
    assert np.isnan(room.error[:, room.n_frames == 0]).all()


def test_a_bar_that_was_hardly_moved_or_is_everywhere_is_refused() -> None:
    own = bar()
    still = replace(own, position_mm=own.position_mm[:1].repeat(14_400, 0))
    with pytest.raises(InputError, match=r"hardly moved: \d+ cells of 50 mm have data; expected 12 or more"):
        room_map(still, Deviations.of(own))
    with pytest.raises(InputError, match=r"in a space of .* m; look whether positions are in mm"):
        room_map(replace(own, position_mm=own.position_mm * 20), Deviations.of(own))


def test_the_box_has_no_bad_cell_and_few_unknown_ones() -> None:
    error = np.full((2, 4, 3, 5), 0.1)
    error[0, 3, 1, 2], error[:, 0, 0, 0] = 9.0, np.nan
    room = RoomMap(np.zeros(3), 50.0, 100.0, np.ones(error.shape[1:], int), error, error, error)
    box = trusted_box(room)
    assert box is not None
    assert [*box[0], *box[1]] == [-25, -25, -25, 125, 125, 225], "of 45 cells one is unknown"
    assert trusted_box(replace(room, error=np.full_like(error, 9.0))) is None
