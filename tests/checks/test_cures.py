"""Cures are true: done word for word nothing is found, and joints are where they were without the mistake."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from cures.brought_files import Door, Result, check
from cures.followed_cures import obeyed, to_do
from cures.planted_cases import CASES, Case
from simulated_poses import hand_of

from shukotsu.schemas.findings import kinds

FAR_MM, FAR_OF_OTHER_FRAMES_MM = 0.1, 5.0
"""How far a joint's centre may be from that without the mistake; the latter: solved from other frames,
which moves the base of the thumb by 4 mm, and a mistake each joint by 18 and more.
"""

QUICK = {case.door: case.name for case in reversed(CASES)}.values()
"""One of each way in, for every run of the tests."""


@cache
def without_mistake(door: Door) -> Result:
    return check(door(hand_of(7)))


def apart_mm(one: Result, other: Result) -> float:
    assert {*one.centre_mm} == {*other.centre_mm}
    return max(float(np.abs(own - other.centre_mm[name]).max()) for name, own in one.centre_mm.items())


@pytest.mark.parametrize(
    "case",
    [pytest.param(own, marks=() if own.name in QUICK else pytest.mark.slow, id=own.name) for own in CASES],
)
def test_a_cure_done_word_for_word_cures(case: Case) -> None:
    planted, clean = hand_of(7), without_mistake(case.door)
    assert clean.findings == ()
    wrong, cured = obeyed(case.plant(planted, case.door, np.random.default_rng(3)), case.door(planted))
    assert wrong.findings[0].kind in case.kind.split(" and ")
    assert to_do(cured) == []
    if case.kind != "too-short":  # which leaves the recording out, so that there is no joint
        assert apart_mm(cured, clean) < (FAR_OF_OTHER_FRAMES_MM if case.other_frames else FAR_MM)


def test_every_kind_is_cured() -> None:
    """But for a recording whose check failed, one that broke, which is made again, and those that the sheet
    cures (test_compared_recordings).
    """
    others = {"unchecked", "sudden-change", "same-file", "other-person"}
    assert {*kinds()} - others == {case.kind for case in CASES if " and " not in case.kind}
