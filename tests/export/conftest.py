"""Fixtures for the tests of exports: simulated hands."""

import pytest
from browser import browser  # noqa: F401
from simulated_hands import SimulatedHand, simulated_hand


@pytest.fixture(scope="session")
def right(tmp_path_factory: pytest.TempPathFactory) -> SimulatedHand:
    return simulated_hand(tmp_path_factory.mktemp("right"), "right")


@pytest.fixture(scope="session", params=["right", "left"])
def hand(request: pytest.FixtureRequest, right: SimulatedHand, tmp_path_factory) -> SimulatedHand:
    is_right = request.param == "right"
    return right if is_right else simulated_hand(tmp_path_factory.mktemp("left"), "left")


@pytest.fixture
def fresh(tmp_path_factory: pytest.TempPathFactory) -> SimulatedHand:
    """A very short recording of a right hand, which tests may change."""
    return simulated_hand(tmp_path_factory.mktemp("fresh"), "right", 40)
