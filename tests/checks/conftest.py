"""Fixtures for the tests of the checks: a hand simulated once."""

import pytest
from simulated_poses import hand_of

from benchmarks.faultless_hands import Planted


@pytest.fixture(scope="session")
def planted() -> Planted:
    return hand_of(7)
