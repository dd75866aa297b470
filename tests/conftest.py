"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as in the workflow; small matrices gain nothing from threads

# A slow machine is no failure; what takes many examples to break has a slow test with more of them.
settings.register_profile("steady", deadline=None, max_examples=30)
settings.load_profile("steady")

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings, which are not part of the project; the test is skipped without it."""
    folder = Path(os.environ.get("SHUKOTSU_REAL_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no folder of real recordings; SHUKOTSU_REAL_DATA can name one")
    return folder
