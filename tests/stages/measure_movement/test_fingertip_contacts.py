"""When two fingertips touch."""

import numpy as np
import pytest

from shukotsu.anatomy.recorded_movement import FingertipPath
from shukotsu.stages.measure_movement.fingertip_contacts import (
    CONTACT_MM,
    RELEASE_MM,
    contact_count,
    contacts,
)
from shukotsu.stages.measure_movement.movement_rows import distance_rows
from shukotsu.stages.measure_movement.sampling import grid_of

BETWEEN_MM = (CONTACT_MM + RELEASE_MM) / 2


def test_a_contact_lasts_until_the_tips_are_well_apart() -> None:
    near, far = CONTACT_MM - 1, RELEASE_MM + 1
    distance_mm = np.array([far, BETWEEN_MM, near, BETWEEN_MM, near, BETWEEN_MM, far, BETWEEN_MM, near])
    touching = contacts(distance_mm)
    assert touching.tolist() == [False, False, True, True, True, True, False, False, True]
    assert contact_count(touching) == 2


def test_a_gap_ends_a_contact() -> None:
    distance_mm = np.array([BETWEEN_MM, CONTACT_MM - 1, np.nan, BETWEEN_MM, CONTACT_MM - 1])
    touching = contacts(distance_mm)
    assert touching.tolist() == [False, True, False, False, True]
    assert contact_count(touching) == 2


def test_lost_frames_make_no_contacts_and_long_gaps_end_them() -> None:
    """Two contacts of a second: one with frames lost here and there, one with a gap of a tenth second."""
    n = 1200
    distance_mm = np.full(n, RELEASE_MM + 10.0)
    distance_mm[200:440] = distance_mm[700:940] = CONTACT_MM - 2.0
    distance_mm[210:430:20] = np.nan
    distance_mm[800:824] = np.nan
    here, there = np.zeros((n, 3, 1)), np.column_stack([distance_mm, np.zeros((n, 2))])[..., None]
    unknown = np.full((n, 1, 1), np.nan)
    tips = {name: FingertipPath(place, here, unknown, True) for name, place in (("a", here), ("b", there))}
    (row,) = distance_rows(tips, grid_of(np.arange(n) / 240))
    assert row["n_contacts"] == 3
    known = ~np.isnan(distance_mm)
    assert row["contact_percent"] == pytest.approx(100.0 * (distance_mm[known] < CONTACT_MM).mean())
    (row,) = distance_rows(tips, None)  # without times nothing says how long a gap is
    assert row["n_contacts"] == 2 + 11 + 1
