"""When two fingertips touch."""

import numpy as np

from stages.measure_movement.fingertip_contacts import CONTACT_MM, RELEASE_MM, contact_count, contacts

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


def test_tips_that_stay_apart_never_touch() -> None:
    assert contact_count(contacts(np.full(9, RELEASE_MM + 1))) == 0
