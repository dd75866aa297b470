"""The benchmark of the coach: what its numbers are of."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.coached.coached_tables import enough_table, time_table
from benchmarks.coached.hands import Hand, setup
from benchmarks.coached.people import FREE, draw
from benchmarks.coached.session import Known, Room, Session
from benchmarks.two_drawings import OTHER, OWN


def session(*known: tuple[float, float, bool], said: tuple[tuple[float, str, str], ...] = ()) -> Session:
    """Estimates of two joints at times, both so far off and of a stated sd of 1 mm, believed or not."""
    found = [Known(t, np.full(2, mm), np.ones(2), np.full(2, good)) for t, mm, good in known]
    return Session(found, list(said))


def test_times_and_shares_are_of_all_hands() -> None:
    enough = (12.0, "enough", ""), (3.0, "asked", FREE)
    one = session((4.0, 3.0, False), (12.0, 1.0, True), (13.0, 0.0, True), said=enough)
    other = session((6.0, 1.0, True), said=((6.0, "enough", ""),))
    hands = [Hand(OWN, None, np.full(2, 1.5), own, own) for own in (one, other)]
    (strict, _) = time_table(hands).rows
    assert strict[6:10] == (12.0, 48.0, 12.0, 48.0)
    assert strict[-1] == pytest.approx(100 / 3)
    (row,) = enough_table(hands).rows
    assert row[2:10] == pytest.approx((100.0, 9.0, 11.4, 0.5, 100.0, 0, 1.0, 100.0))


def test_an_estimate_of_before_it_was_put_right_is_none() -> None:
    swapped = session((4.0, 9.0, False), said=((5.0, "put-right", ""), (4.0, "finding", "swapped a b")))
    assert swapped.at(4.5) is not None
    assert swapped.at(5.0) is None
    (row,) = enough_table([Hand(OWN, ("a", "b"), np.ones(2), swapped, swapped)]).rows
    assert row[-4:] == (100.0, 4.0, 100.0, 1.0)


def test_somebody_is_coached() -> None:
    person = draw(OTHER, 9703)
    usual = setup(person.hand, 2.0)
    fitted = dict(usual.model["fit"], frames=40, steps=8)
    quick = replace(usual, model={**usual.model, "fit": fitted})
    coached = Room(person, quick, np.random.default_rng(1)).spend(2.0)
    assert ("asked", FREE) in [(kind, name) for _, kind, name in coached.said]
    assert coached.known
    assert np.median(coached.known[-1].error_mm) < 4.0
