"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest
import refusals
from hypothesis import settings
from refusals import (  # noqa: F401 - hooks and a fixture of all tests
    _sentences_can_be_followed,
    pytest_configure,
    pytest_configure_node,
    pytest_sessionfinish,
)

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as in the workflow; small matrices gain nothing from threads

# A slow machine is no failure; what takes many examples to break has a slow test with more of them.
settings.register_profile("steady", deadline=None, max_examples=30)
settings.load_profile("steady")

refusals.start()

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings, which are not part of the project; the test is skipped without it."""
    folder = Path(os.environ.get("SHUKOTSU_REAL_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no folder of real recordings; SHUKOTSU_REAL_DATA can name one")
    return folder
