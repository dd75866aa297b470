"""A browser for the coach's page, and recordings that its tests share."""

from pathlib import Path

import pytest
from browser import browser, watched_page  # noqa: F401
from coached_hands import archive, calibration


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return archive(tmp_path_factory.mktemp("recorded"), calibration(5.0))
