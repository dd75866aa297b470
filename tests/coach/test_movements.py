"""Every movement has a sentence, joints of the layout, and postures that move what it is said to move."""

from __future__ import annotations

import numpy as np
import pytest

from shukotsu.coach.movements import MOVEMENTS, Movement
from shukotsu.coach.requests import MOVEMENT
from shukotsu.coach.wording import request_sentence
from shukotsu.schemas.layout import read_layout


@pytest.mark.parametrize("movement", MOVEMENTS.values(), ids=MOVEMENTS)
def test_a_movement_goes_as_far_as_is_seen_to_be_done(movement: Movement) -> None:
    known = read_layout("liberty16").joints
    for (joint, kind), wanted_deg in movement.shown.items():
        assert joint in known
        angles = [posture[joint][kind == "abduction"] for posture in movement.postures if joint in posture]
        assert np.ptp(angles) > wanted_deg


@pytest.mark.parametrize("name", MOVEMENTS)
def test_a_movement_is_one_imperative_sentence_of_its_own(name: str) -> None:
    sentence = request_sentence(MOVEMENT, name, {})
    assert sentence.endswith(".")
    assert "{" not in sentence
    assert [other for other in MOVEMENTS if request_sentence(MOVEMENT, other, {}) == sentence] == [name]
