"""Fixtures for the tests of exports: simulated hands and external programs."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

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


@pytest.fixture(scope="session")
def export_tool() -> Callable[[str], Path]:
    """Return a function that finds an external program by its path in the folder of such programs.

    The folder is .tools or SHUKOTSU_TOOLS; the test is skipped if the program, or node if needed, is missing.
    """
    folder = Path(os.environ.get("SHUKOTSU_TOOLS", Path(__file__).parents[2] / ".tools"))

    def find(name: str) -> Path:
        if not (folder / name).exists():
            pytest.skip(f"no {name} in {folder}; SHUKOTSU_TOOLS can name another")
        if name.startswith("node_modules") and shutil.which("node") is None:
            pytest.skip("no node on PATH")
        return folder / name

    return find
