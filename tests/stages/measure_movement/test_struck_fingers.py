"""Fingering on made-up strokes, from a hand that lies anyhow in the room: who struck, and the keyboard."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.measure_movement.struck_fingers import WHITE_KEYS, Approach, StruckFingers, find_fingers

COUNT, TIMES, DIGITS = 80, 5, 5
IN_OCTAVE = (0, 2, 4, 5, 7, 9, 11, 1, 6)


def made_up(seed: int, foreign: int = 0) -> tuple[Approach, Array, Array, Array]:
    """Strokes of five fingers about a hand that wanders along the keys; `foreign` ones of another hand.

    Give the approach, pitches, which digit struck (-1: none) and the way down.
    """
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed)
    struck = np.append(rng.integers(0, DIGITS, COUNT), np.full(foreign, -1))
    n = len(struck)
    pitch = 48 + 12 * rng.integers(0, 2, n) + rng.choice(IN_OCTAVE, n)
    key_mm = 23.5 * (7 * (pitch // 12) + WHITE_KEYS[pitch % 12]) + rng.normal(0, 4, n)
    black = np.isin(pitch % 12, (1, 3, 6, 8, 10))
    place = np.zeros((n, DIGITS, 3))
    place[..., 0] = (key_mm - 23 * struck)[:, None] + 23 * np.arange(DIGITS) + rng.normal(0, 5, (n, DIGITS))
    place[..., 1] = rng.normal(0, 12, (n, DIGITS))
    place[..., 2] = rng.uniform(4, 25, (n, DIGITS))
    before = rng.normal(0, [40, 40, 80], (n, DIGITS, 3))
    after = before + rng.normal(0, 40, (n, DIGITS, 3))
    own = np.flatnonzero(struck >= 0)
    place[own, struck[own], 0] = key_mm[own]
    place[own, struck[own], 2] = 12.0 * black[own] + rng.normal(0, 1.0, len(own))
    before[own, struck[own]] = np.stack(
        [*rng.normal(0, 40, (2, len(own))), -rng.uniform(150, 600, len(own))], -1
    )
    after[own, struck[own]] = rng.normal(0, 15, (len(own), 3))

    def seen(values: Array) -> Array:
        return np.repeat(turn.apply(values.reshape(-1, 3)).reshape(values.shape)[:, None], TIMES, 1)

    approach = Approach(seen(before), seen(after), seen(place) + 300.0)
    return approach, pitch.astype(float), struck, turn.apply([0.0, 0.0, -1.0])


def found_in(approach: Approach, pitch: Array, given: Array | None = None) -> StruckFingers:
    none = np.full(len(pitch), -1)
    return find_fingers(approach, pitch, none if given is None else given)


@pytest.mark.parametrize("seed", range(3))
def test_who_struck_and_where_the_keys_are(seed: int) -> None:
    approach, pitch, struck, down = made_up(seed)
    found = found_in(approach, pitch)
    right = found.probability.argmax(1) == struck
    assert right.mean() > 0.97
    assert found.probability.max(1).mean() == pytest.approx(right.mean(), abs=0.03), "as sure as it is right"
    assert np.degrees(np.arccos(found.down @ down)) < 4


def test_notes_of_the_other_hand_are_nobodys() -> None:
    approach, pitch, struck, _ = made_up(3, foreign=30)
    found = found_in(approach, pitch)
    nobody = found.probability.sum(1) < 0.5
    assert (nobody == (struck < 0)).mean() > 0.95


def test_what_is_given_stays_and_pitches_may_be_unknown() -> None:
    approach, pitch, struck, _ = made_up(4)
    given = np.where(np.arange(COUNT) % 4 == 0, (struck + 1) % DIGITS, -1)
    found = found_in(approach, np.full(COUNT, np.nan), given)
    assert (found.probability.argmax(1) == given)[given >= 0].all()
    assert (found.probability.argmax(1) == struck)[given < 0].mean() > 0.9
    assert pitch.any()
